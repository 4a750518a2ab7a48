#!/usr/bin/env bash
# MuJoCo 4.0.0: a joint whose range is written the wrong way round, or as one value, is a joint without limits, in silence.
#
# Expected: range="1 -1" is an error, as it is with limited="true".
# Seen (2026-11-28, Linux, Python 3.11): MJCF with range="1 -1" or range="0.5 0.5" and no `limited` loads without a warning, and the joint is not limited; a
#   torque turns it far beyond. The same range with limited="true" is refused. A URDF whose lower and upper limit are equal (a joint
#   locked by its maker) loads with a warning and turns freely.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q mujoco==4.0.0 numpy==2.4.6
env/bin/python - <<'PY'
import mujoco
import numpy as np

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def mjcf(attributes):
    return (f'<mujoco><option gravity="0 0 0"/><compiler angle="radian"/><worldbody><body><joint name="j" type="hinge" {attributes}/>'
            '<geom size="0.1"/></body></worldbody></mujoco>')


def urdf(lower, upper):
    return (f'<robot name="r"><link name="a">{INERTIAL}</link><link name="b">{INERTIAL}</link><joint name="j" type="revolute"><parent link="a"/>'
            f'<child link="b"/><axis xyz="0 0 1"/><limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint></robot>')


def pushed(text):
    """Whether the joint is limited, and whether a torque takes it beyond two radians; none where the model is refused."""
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError:
        return None
    data = mujoco.MjData(model)
    for _ in range(4000):
        data.qfrc_applied[0] = 0.2
        mujoco.mj_step(model, data)
    return bool(model.jnt_limited[0]), bool(abs(data.qpos[0]) > 2)


cases = {
    'range="-1 1"': (mjcf('range="-1 1"'), (True, False)),
    'range="1 -1"': (mjcf('range="1 -1"'), (False, True)),
    'range="0.5 0.5"': (mjcf('range="0.5 0.5"'), (False, True)),
    'limited="true" range="1 -1"': (mjcf('limited="true" range="1 -1"'), None),
    "URDF, limits 0.5 and 0.5": (urdf(0.5, 0.5), (False, True)),
}
for name, (text, wanted) in cases.items():
    found = pushed(text)
    print(f"{name}: (limited, turns beyond 2 rad) = {found}")
    assert found == wanted, (name, found)
PY
