#!/usr/bin/env bash
# meshio 5.3.5: bytes of a PLY file are signed or unsigned by which of its two names the type has.
#
# PLY has two names for each type: `uchar` and `uint8` are one type.
# Expected: a colour of 200 is read as 200 under both names, and `ushort` and `uint16` are both known.
# Seen (2026-11-28, Linux, Python 3.11): `uint8` gives 200, `uchar` gives -56 (int8), without a word; nearly all writers say `uchar`. `uint16` is read,
#   `ushort` ends with KeyError. plyfile 1.1.5 gives 200 and 40000 under all names.
# Exits with 1 where that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv env
env/bin/pip install -q meshio==5.3.5 plyfile==1.1.5 numpy==2.4.6
env/bin/python - <<'PY'
import struct

import meshio
from plyfile import PlyData


def write(kind, letter, value):
    head = ("ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n"
            f"property {kind} red\nend_header\n")
    open("one.ply", "wb").write(head.encode() + struct.pack(f"<3d{letter}", 1, 2, 3, value))


def by_meshio():
    try:
        red = meshio.read("one.ply").point_data["red"]
    except KeyError as error:
        return f"KeyError {error}"
    return int(red[0]), str(red.dtype)


found = {}
for kind, letter, value in (("uchar", "B", 200), ("uint8", "B", 200), ("ushort", "H", 40000), ("uint16", "H", 40000)):
    write(kind, letter, value)
    assert int(PlyData.read("one.ply")["vertex"]["red"][0]) == value
    found[kind] = by_meshio()
    print(f"{kind} {value}: plyfile {value}, meshio {found[kind]}")
assert found["uchar"] == (-56, "int8") and found["uint8"] == (200, "uint8"), found
assert found["ushort"] == "KeyError 'ushort'" and found["uint16"] == (40000, "uint16"), found
PY
