#!/usr/bin/env bash
# A prismatic URDF joint with <axis xyz="0 0 2"/>: two of six readers move the link twice as far as they are told.
#
# Expected: all readers make the axis a unit vector, as they all do for revolute joints, or refuse it.
# Seen (2026-11-28, Linux, Python 3.11): for 0.5 m pinocchio 4.1.0, urchin 0.0.30, pytransform3d 3.17.0 and MuJoCo 4.0.0 move by 0.5 m; yourdfpy 0.0.60 and
#   PyBullet 3.2.7 by 1.0 m: the length of the axis is a gear ratio there. With an axis of a thousandth they move by half a
#   millimetre. Revolute joints are turned by 0.5 rad by all six. Nobody says anything.
# PyBullet is compiled where it has no wheel for the Python at hand: that takes minutes.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q pin==4.1.0 yourdfpy==0.0.60 urchin==0.0.30 pytransform3d==3.17.0 pybullet==3.2.7 mujoco==4.0.0 numpy==2.4.6
env/bin/python - <<'PY'
import math

import mujoco
import numpy as np
import pinocchio
import pybullet
import urchin
import yourdfpy
from pytransform3d.urdf import UrdfTransformManager

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def by_all(text, value, measure):
    open("axis.urdf", "w").write(text)
    found = {}
    model = pinocchio.buildModelFromXML(text)
    data, q = model.createData(), pinocchio.neutral(model)
    q[0] = value
    pinocchio.framesForwardKinematics(model, data, q)
    found["pinocchio"] = measure(data.oMf[model.getFrameId("b")].homogeneous)
    poses = {link.name: pose for link, pose in urchin.URDF.load("axis.urdf").link_fk(cfg={"j": value}).items()}
    found["urchin"] = measure(poses["b"])
    manager = UrdfTransformManager()
    manager.load_urdf(text)
    manager.set_joint("j", value)
    found["pytransform3d"] = measure(manager.get_transform("b", "a"))
    simulated = mujoco.MjModel.from_xml_string(text)
    state = mujoco.MjData(simulated)
    state.qpos[0] = value
    mujoco.mj_forward(simulated, state)
    found["MuJoCo"] = measure(np.vstack([np.c_[state.xmat[1].reshape(3, 3), state.xpos[1]], [0, 0, 0, 1]]))
    robot = yourdfpy.URDF.load("axis.urdf")
    robot.update_cfg({"j": value})
    found["yourdfpy"] = measure(robot.get_transform("b"))
    pybullet.connect(pybullet.DIRECT)
    body = pybullet.loadURDF("axis.urdf", useFixedBase=True)
    pybullet.resetJointState(body, 0, value)
    place, turn = pybullet.getLinkState(body, 0, computeForwardKinematics=True)[4:6]
    pybullet.disconnect()
    turn = np.reshape(pybullet.getMatrixFromQuaternion(turn), (3, 3))
    found["PyBullet"] = measure(np.vstack([np.c_[turn, place], [0, 0, 0, 1]]))
    return found


def lifted(pose):
    return round(float(pose[2][3]), 5)


def turned(pose):
    return round(math.atan2(pose[1][0], pose[0][0]), 5)


for kind, measure in (("revolute", turned), ("prismatic", lifted)):
    for length in (2.0, 0.001):
        text = (f'<robot name="r"><link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link><joint name="j" type="{kind}">'
                f'<parent link="a"/><child link="b"/><axis xyz="0 0 {length}"/><limit lower="-3" upper="3" effort="1" velocity="1"/>'
                "</joint></robot>")
        found = by_all(text, 0.5, measure)
        print(f"{kind} joint at 0.5, axis of length {length}: {found}")
        wanted = dict.fromkeys(found, 0.5)
        if kind == "prismatic":
            wanted |= dict.fromkeys(("yourdfpy", "PyBullet"), 0.5 * length)
        assert found == wanted, found
PY
