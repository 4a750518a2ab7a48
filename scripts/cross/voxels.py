#!/usr/bin/env python3
"""One reader of OctoMap trees: a `.bt` and the middles of voxels (.npy) in; for each 1 occupied, 0 free, 255 unknown, and the
middles of all single leaves, out as .npz. Run by cross.py in a process of its own."""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np


def octomap(path, middles):
    import octomap

    tree = octomap.OcTree(path.encode())
    known = []
    for point in middles:
        node = tree.search(point)
        try:
            known.append(int(tree.isNodeOccupied(node)))
        except Exception:  # what the package says where there is no node
            known.append(255)
    leaves = [leaf.getCoordinate() for leaf in tree.begin_leafs() if abs(leaf.getSize() - tree.getResolution()) < 1e-9]
    return np.array(known, np.uint8), np.array(leaves)


def pyoctomap(path, middles):
    import pyoctomap

    tree = pyoctomap.OcTree(path.encode())
    known = []
    for point in middles:
        node = tree.search(point)
        known.append(255 if node is None else int(tree.isNodeOccupied(node)))
    edge = tree.getResolution()
    leaves = [leaf.getCoordinate() for leaf in tree.begin_leafs() if abs(leaf.getSize() - edge) < 1e-9]
    return np.array(known, np.uint8), np.array(leaves)


def octomap_tools(path, middles, call=""):
    """`bt2vrml` of the C++ library: boxes of what is occupied."""
    with tempfile.TemporaryDirectory(dir=Path(path).parent) as folder:
        copy = Path(folder) / "tree.bt"
        copy.write_bytes(Path(path).read_bytes())
        ran = subprocess.run([*call.split(), "bt2vrml", str(copy)], stdout=sys.stderr, check=False)
        made = copy.with_name("tree.bt.wrl")
        if not made.is_file():
            raise RuntimeError(f"bt2vrml ends with {ran.returncode}")
        text = made.read_text()
    number = r"(-?[\d.e+-]+)"
    found = re.findall(rf"translation {number} {number} {number}\s*\n\s*children \[ Shape {{ geometry Box {{ size {number}", text)
    boxes = np.array(found, float)
    inside = np.zeros(len(middles), bool)
    for size in np.unique(boxes[:, 3]):
        index = lambda p: np.round(np.asarray(p) / size - 0.5).astype(np.int64)
        keys = {tuple(v) for v in index(boxes[boxes[:, 3] == size, :3]).tolist()}
        inside |= [tuple(v) in keys for v in np.floor(middles / size).astype(np.int64).tolist()]
    single = boxes[boxes[:, 3] == boxes[:, 3].min(), :3]
    return np.where(inside, 1, 254).astype(np.uint8), single


READERS = {f.__name__: f for f in (octomap, pyoctomap, octomap_tools)}

if __name__ == "__main__":
    reader, path, middles, out, *more = sys.argv[1:]
    known, leaves = READERS[reader](path, np.load(middles), *more)
    np.savez(out, known=known, leaves=leaves)
