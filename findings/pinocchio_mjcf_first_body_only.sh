#!/usr/bin/env bash
# pinocchio 4.1.0 reads one robot of an MJCF scene with two, and believes limits that MJCF switches off.
#
# Expected: two bodies beside one another under <worldbody> become two branches of the model, or the reader says that it cannot.
# Seen (2026-11-28, Linux, Python 3.11): MuJoCo 4.0.0 has both joints; pinocchio has the first body's joint only, without a word. Put into one body
#   without a joint, both are read. A joint with limited="false" range="-1 1" turns freely in MuJoCo, and has the limits -1 and
#   1 in pinocchio.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q pin==4.1.0 mujoco==4.0.0 numpy==2.4.6
env/bin/python - <<'PY'
import mujoco
import pinocchio

ROBOTS = ('<body name="r1"><joint name="j1" type="hinge" axis="0 0 1" limited="false" range="-1 1"/><geom size="0.1"/></body>'
          '<body name="r2" pos="1 0 0"><joint name="j2" type="hinge" axis="0 0 1"/><geom size="0.1"/></body>')
found = {}
for name, world in (("beside one another", ROBOTS), ("in one body", f'<body name="cell">{ROBOTS}</body>')):
    text = f'<mujoco><compiler angle="radian"/><worldbody>{world}</worldbody></mujoco>'
    open("cell.xml", "w").write(text)
    simulated = mujoco.MjModel.from_xml_string(text)
    model = pinocchio.buildModelFromMJCF("cell.xml")
    found[name] = simulated.njnt, list(model.names)[1:], bool(simulated.jnt_limited[0]), model.upperPositionLimit.tolist()[0]
    print(f"two robots {name}: MuJoCo has {simulated.njnt} joints, pinocchio {list(model.names)[1:]}; upper limit of j1:",
          "none in MuJoCo," if not simulated.jnt_limited[0] else "some in MuJoCo,", model.upperPositionLimit.tolist()[0], "in pinocchio")
assert found["beside one another"] == (2, ["j1"], False, 1.0), found
assert found["in one body"] == (2, ["j1", "j2"], False, 1.0), found
PY
