#!/usr/bin/env bash
# rerun 0.41.0: a revolute URDF joint with <axis xyz="0 0 2"/> told to turn by 0.5 rad gives a quaternion that is no unit one.
#
# Expected: the axis is made a unit vector, as six other readers of URDF make it for revolute joints, or the file is refused.
# Seen (2026-12-01, Linux, Python 3.11): `UrdfJoint.compute_transform(0.5)` gives x, y, z, w = 0, 0, 2 sin 0.25, cos 0.25, of norm 1.088. Made a unit
#   quaternion, as most programs do with what they read, it turns by 0.944 rad; with an axis of a tenth by 0.051 rad. A unit axis gives
#   0.5 rad. The batches of `compute_joint_transform_batches` have the same numbers. Nothing is said.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q rerun-sdk==0.41.0 numpy==2.4.6
env/bin/python - <<'PY'
import numpy as np
import pyarrow as pa
import rerun.urdf

TOLD = 0.5
turned = {}
for length in (1.0, 2.0, 0.1):
    joint = f'<joint name="turn" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 {length}"/>'
    joint += '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
    open("arm.urdf", "w").write(f'<robot name="arm"><link name="a"/><link name="b"/>{joint}</robot>')
    tree = rerun.urdf.UrdfTree.from_file_path("arm.urdf")
    given = tree.get_joint_by_name("turn").compute_transform(TOLD).quaternion.as_arrow_array().to_pylist()[0]
    names, values = pa.array([["turn"]]), pa.array([[TOLD]])
    batch = tree.compute_joint_transform_batches(names, values, clamp=True).to_pylist()[0][0]["quaternion"]
    assert np.allclose(given, batch, atol=1e-6), (given, batch)
    assert np.allclose(given, [0, 0, length * np.sin(TOLD / 2), np.cos(TOLD / 2)], atol=1e-6), given
    turned[length] = 2 * np.arctan2(given[2], given[3])
    print(f"axis of length {length}: norm {np.linalg.norm(given):.4f}, {turned[length]:.3f} rad for {TOLD}")
assert abs(turned[1.0] - 0.5) < 1e-3 and abs(turned[2.0] - 0.944) < 1e-3 and abs(turned[0.1] - 0.051) < 1e-3, turned
PY
