#!/usr/bin/env bash
# One URDF, one COLLADA mesh that declares millimetres: 0.1 m wide in PyBullet, 100 m in pinocchio, yourdfpy and urchin.
#
# Expected: `<unit meter="0.001"/>` is applied by all, since COLLADA says that it scales the numbers of the file; or by none.
# Seen (2026-11-28, Linux, Python 3.11): pinocchio 4.1.0 with coal 3.0.3 (through assimp), yourdfpy 0.0.60 and urchin 0.0.30 (both through
#   trimesh 5.2.0) take the numbers as metres; PyBullet 3.2.7 applies the unit. trimesh knows the unit and hands it out as
#   `units`, but the two readers of URDF above it do not ask. None of them says anything. A collision check in one and
#   a simulation in the other differ by a factor of 1000 (39.37 for inches).
# PyBullet is compiled where it has no wheel for the Python at hand: that takes minutes.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q pin==4.1.0 yourdfpy==0.0.60 urchin==0.0.30 pybullet==3.2.7 trimesh==5.2.0 pycollada==0.9.3 numpy==2.4.6
env/bin/python - <<'PY'
import numpy as np
import pinocchio
import pybullet
import trimesh
import urchin
import yourdfpy

SIZE = np.array([100.0, 200.0, 300.0])
made = trimesh.creation.box(SIZE).export(file_type="dae")
made = made.decode() if isinstance(made, bytes) else made
widths = {}
for unit in ("0.001", "0.0254", "1"):
    text = made.replace("<up_axis>Y_UP</up_axis>", f'<unit name="own" meter="{unit}"/><up_axis>Z_UP</up_axis>')
    assert unit in text
    open("box.dae", "w").write(text)
    shape = '<geometry><mesh filename="box.dae"/></geometry>'
    open("box.urdf", "w").write(f'<robot name="r"><link name="a"><visual>{shape}</visual><collision>{shape}</collision></link></robot>')
    model = pinocchio.buildModelFromUrdf("box.urdf")
    shapes = pinocchio.buildGeomFromUrdf(model, "box.urdf", pinocchio.GeometryType.VISUAL, package_dirs=["."])
    pybullet.connect(pybullet.DIRECT)
    body = pybullet.loadURDF("box.urdf", useFixedBase=True)
    corners = np.array(pybullet.getMeshData(body, -1, collisionShapeIndex=0)[1])
    pybullet.disconnect()
    sizes = {
        "pinocchio": np.ptp(np.asarray(shapes.geometryObjects[0].geometry.vertices()), axis=0),
        "yourdfpy": yourdfpy.URDF.load("box.urdf").scene.extents,
        "urchin": list(urchin.URDF.load("box.urdf").visual_trimesh_fk())[0].extents,
        "PyBullet": np.ptp(corners, axis=0),
    }
    widths[unit] = {name: round(float(size[0]), 4) for name, size in sizes.items()}
    print(f"unit {unit} m, trimesh says {trimesh.load('box.dae').units}: width in metres {widths[unit]}")
for unit, width in widths.items():
    assert width == {"pinocchio": 100, "yourdfpy": 100, "urchin": 100, "PyBullet": round(100 * float(unit), 4)}, width
PY
