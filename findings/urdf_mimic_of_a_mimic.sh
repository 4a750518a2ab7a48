#!/usr/bin/env bash
# A URDF joint that mimics a joint that itself mimics: four readers, four postures, and one refusal.
#
# Three joints about z: j1 = 0.1; j2 = 2 j1 + 0.1; j3 = j2 + 0.05. The last link is turned by 0.1 + 0.3 + 0.35 = 0.75 rad.
# Expected: 0.75 rad everywhere, or a refusal.
# Seen (2026-11-28, Linux, Python 3.11): yourdfpy 0.0.60 puts j3 at its offset (0.45 rad; it warns while loading). urchin 0.0.30 leaves j3 at zero
#   (0.40 rad). pytransform3d 3.17.0 moves no follower (0.10 rad). pinocchio 4.1.0 has three free joints by default (0.10 rad with the
#   others at zero), and with mimic=True it refuses the file. Nobody gives 0.75.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q pin==4.1.0 yourdfpy==0.0.60 urchin==0.0.30 pytransform3d==3.17.0 numpy==2.4.6
env/bin/python - <<'PY'
import math

import pinocchio
import urchin
import yourdfpy
from pytransform3d.urdf import UrdfTransformManager

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def joint(name, parent, child, mimic=""):
    return (f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
            f'<limit lower="-3" upper="3" effort="1" velocity="1"/>{mimic}</joint>')


text = ('<robot name="r">' + "".join(f'<link name="{name}">{INERTIAL}</link>' for name in "abcd") + joint("j1", "a", "b")
        + joint("j2", "b", "c", '<mimic joint="j1" multiplier="2" offset="0.1"/>')
        + joint("j3", "c", "d", '<mimic joint="j2" multiplier="1" offset="0.05"/>') + "</robot>")
open("chain.urdf", "w").write(text)
angle = lambda pose: round(math.atan2(pose[1][0], pose[0][0]), 4)
found = {}
robot = yourdfpy.URDF.load("chain.urdf")
robot.update_cfg({"j1": 0.1})
found["yourdfpy"] = angle(robot.get_transform("d"))
poses = {link.name: pose for link, pose in urchin.URDF.load("chain.urdf").link_fk(cfg={"j1": 0.1}).items()}
found["urchin"] = angle(poses["d"])
manager = UrdfTransformManager()
manager.load_urdf(text)
manager.set_joint("j1", 0.1)
found["pytransform3d"] = angle(manager.get_transform("d", "a"))
model = pinocchio.buildModelFromXML(text)
data, q = model.createData(), pinocchio.neutral(model)
q[0] = 0.1
pinocchio.framesForwardKinematics(model, data, q)
found["pinocchio"] = angle(data.oMf[model.getFrameId("d")].rotation)
try:
    pinocchio.buildModelFromXML(text, mimic=True)
    found["pinocchio, mimic=True"] = "loads"
except ValueError:
    found["pinocchio, mimic=True"] = "refuses"
print("wanted 0.75;", found)
assert found == {"yourdfpy": 0.45, "urchin": 0.4, "pytransform3d": 0.1, "pinocchio": 0.1, "pinocchio, mimic=True": "refuses"}, found
PY
