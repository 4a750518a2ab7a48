#!/usr/bin/env bash
# Open3D 0.20.0: whether a 16-bit property of a PLY file is kept depends on which of its two names the type has.
#
# PLY has two names for each type: `ushort` and `uint16` are one type, `uchar` and `uint8` another.
# Expected: the tensor reader takes both names of a type or neither.
# Seen (2026-11-28, Linux, Python 3.11): `uint16` is kept and `ushort` is dropped with a warning. `char`, `int8`, `short`,
#   `int16`, `uint` and `uint32` are dropped under both names; all other types are kept under both. The writer
#   says `uint16` itself, so that its own files come back whole, and those of writers that say `ushort` do not.
#   Second: colours that are `float` from 0 to 1 stay as they are in the tensor reader, and are divided by 255 in the legacy
#   reader; `ushort` colours are lost in the tensor reader, and become numbers far above 1 in the legacy one.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q open3d-cpu==0.20.0 numpy==2.4.6
env/bin/python - <<'PY'
import struct

import numpy as np
import open3d as o3d

FORMATS = {"int8": "b", "char": "b", "uint8": "B", "uchar": "B", "int16": "h", "short": "h", "uint16": "H", "ushort": "H",
           "int32": "i", "int": "i", "uint32": "I", "uint": "I", "float32": "f", "float": "f", "float64": "d", "double": "d"}


def write(path, kind, names, value):
    head = "".join(f"property {kind} {name}\n" for name in names)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n{head}end_header\n"
    values = struct.pack(f"<{len(names)}{FORMATS[kind]}", *[value] * len(names))
    open(path, "wb").write(head.encode() + struct.pack("<3d", 1, 2, 3) + values)


kept = {}
for kind in FORMATS:
    write("one.ply", kind, ["ring"], 7)
    kept[kind] = "ring" in o3d.t.io.read_point_cloud("one.ply").point
print("tensor reader keeps:", *[k for k, is_kept in kept.items() if is_kept])
print("tensor reader drops:", *[k for k, is_kept in kept.items() if not is_kept])
dropped = {k for k, is_kept in kept.items() if not is_kept}
assert dropped == {"int8", "char", "int16", "short", "ushort", "uint32", "uint"}, dropped

colours = {}
for kind, value in (("float", 0.5), ("uchar", 200), ("ushort", 40000)):
    write("one.ply", kind, ["red", "green", "blue"], value)
    tensor = o3d.t.io.read_point_cloud("one.ply").point
    tensor = float(tensor["colors"].numpy()[0, 0]) if "colors" in tensor else None
    colours[kind] = tensor, round(float(np.asarray(o3d.io.read_point_cloud("one.ply").colors)[0, 0]), 5)
print("colour as (tensor, legacy):", colours)
assert colours == {"float": (0.5, 0.00196), "uchar": (200.0, 0.78431), "ushort": (None, 156.86275)}, colours
PY
