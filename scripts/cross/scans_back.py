#!/usr/bin/env python3
"""Gives scan files back without their moving points and compares each field of each scan with the original, by libE57Format
(through pye57) for E57 and by the lines themselves for PTX. Prints a table; exits with 1 if anything differs that should not.

Usage: scans_back.py EXAMPLE FILE_OR_FOLDER...         EXAMPLE is target/release/examples/give_back; labels are made up
       scans_back.py --result OUT --scans FILE...      what `stillpoint export OUT --to e57|ptx` wrote, against the labels of OUT

Needs Python 3.9 and the pye57 and numpy of requirements.txt."""

import argparse
import hashlib
import json
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pye57
from pye57 import libe57

MOVING = (1, 2)
OWN = ("class", "robot", "link")
WAYS = {"flagged": [], "plain": ["--without-labels"], "dropped": ["--drop-moving"]}


def fields_of(points):
    """Names of the fields of a scan."""
    prototype = libe57.StructureNode(points.prototype())
    return [prototype.get(i).elementName() for i in range(prototype.childCount())]


def columns(file, index):
    """All fields of a scan by libE57Format, whatever extension they belong to."""
    header = file.get_header(index)
    n, fields = header.point_count, fields_of(header.points)
    # In arrays of whole numbers of eight bytes pye57 0.4.19 puts them at every fourth byte.
    arrays = {name: np.zeros(max(n, 1)) for name in fields}
    buffers = libe57.VectorSourceDestBuffer()
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(file.image_file, name, array, len(array), True, True))
    if n:
        reader = header.points.reader(buffers)
        assert reader.read() == n
        reader.close()
    return {name: array[:n] for name, array in arrays.items()}


def tree(node, path=""):
    """Every element of a description as (path, type, value); points, offsets and what is ours apart. Blobs are digests."""
    name = node.elementName()
    path = f"{path}/{name}"
    kind = node.type()
    if name.split(":")[0] == "sp" or path == "/guid" or name == "points":
        return
    if kind == libe57.NodeType.E57_STRUCTURE:
        node = libe57.StructureNode(node)
    elif kind == libe57.NodeType.E57_VECTOR:
        node = libe57.VectorNode(node)
    elif kind == libe57.NodeType.E57_BLOB:
        blob = libe57.BlobNode(node)
        size = blob.byteCount()
        content = np.zeros(max(size, 1), np.uint8)
        if size:
            blob.read(content, 0, size)
        yield path, "blob", hashlib.sha256(content[:size].tobytes()).hexdigest()
        return
    elif kind == libe57.NodeType.E57_COMPRESSED_VECTOR:
        yield path, "table", libe57.CompressedVectorNode(node).childCount()
        return
    else:
        wrap = {libe57.NodeType.E57_INTEGER: libe57.IntegerNode, libe57.NodeType.E57_FLOAT: libe57.FloatNode,
                libe57.NodeType.E57_STRING: libe57.StringNode, libe57.NodeType.E57_SCALED_INTEGER: libe57.ScaledIntegerNode}
        leaf = wrap[kind](node)
        yield path, str(kind), leaf.rawValue() if kind == libe57.NodeType.E57_SCALED_INTEGER else leaf.value()
        return
    for i in range(node.childCount()):
        yield from tree(node.get(i), path)


def state_of(names):
    """The field by which a point counts as valid, and all kinds of coordinates that the scan has."""
    kinds = [k for k, axis in (("cartesian", "cartesianX"), ("spherical", "sphericalRange")) if axis in names]
    field = f"{kinds[0]}InvalidState" if kinds else None
    return (field if field in names else None), kinds


def compare_scan(before, after, labels, way):
    """What differs between two scans apart from what must; number of points taken out."""
    said = []
    state, kinds = state_of(before)
    n = len(next(iter(before.values()))) if before else 0
    valid = np.ones(n, bool) if state is None else before[state] == 0
    kind, robot, link = (np.full(n, fill, np.int64) for fill in (255, -1, -1))
    if valid.sum() != len(labels["kind"]):
        return [f"{valid.sum()} valid points, {len(labels['kind'])} labels"], 0
    kind[valid], robot[valid], link[valid] = labels["kind"], labels["robot"], labels["link"]
    out = np.isin(kind, MOVING)
    kept = ~out if way == "dropped" else np.ones(n, bool)
    n_after = len(next(iter(after.values()))) if after else 0
    if n_after != kept.sum():
        return [f"{n_after} records instead of {kept.sum()}"], int(out.sum())
    for name, column in before.items():
        if name.split(":")[0] == "sp":
            continue
        want = column[kept]
        if way != "dropped" and name.endswith("InvalidState") and name[:-12] in kinds:
            want = np.where(out, 2, column)
        if name not in after:
            said.append(f"{name} is missing")
        elif not np.array_equal(want, after[name], equal_nan=want.dtype.kind == "f"):
            said.append(f"{name} differs in {(want != after[name]).sum()} of {len(want)} points")
    for k in kinds:
        field = f"{k}InvalidState"
        if way != "dropped" and field not in before and n and not np.array_equal(after.get(field), np.where(out, 2, 0)):
            said.append(f"{field} is not as it should be")
    own = {name: after.get(f"sp:{name}") for name in OWN}
    for name, want in zip(OWN, (kind, robot, link)):
        if way == "plain" or not n:
            if own[name] is not None and n:
                said.append(f"sp:{name} is there")
        elif not np.array_equal(own[name], want[kept]):
            said.append(f"sp:{name} differs")
    return said, int(out.sum())


def common_readers(path, scans):
    """How pye57's own functions take a file: what `read_scan` and `read_scan_raw` give."""
    said = []
    file = pye57.E57(str(path))
    for index, after in enumerate(scans):
        state, kinds = state_of(after)
        n = len(next(iter(after.values()))) if after else 0
        if not n or not kinds or len(kinds) > 1:
            continue
        n_valid = n if state is None else int((after[state] == 0).sum())
        try:
            got = len(file.read_scan(index, ignore_missing_fields=True, row_column=False)["cartesianX"])
            if got != n_valid:
                said.append(f"read_scan gives {got} of {n_valid}")
        except Exception as error:
            said.append(f"read_scan: {error}"[:60])
        try:
            file.read_scan_raw(index)
        except Exception as error:
            said.append("read_scan_raw refuses other fields than its own" if "field" in str(error) else str(error)[:60])
    file.close()
    return sorted(set(said))


def compare_e57(before, after, labels, way):
    """(rows, what differs) of two files."""
    old, new = pye57.E57(str(before)), pye57.E57(str(after))
    said, out, n_points = [], 0, 0
    roots = [file.image_file.root() for file in (old, new)]
    trees = [[item for i in range(root.childCount()) for item in tree(root.get(i))] for root in roots]
    if way == "dropped":
        trees = [[item for item in t if "/pointGroupingSchemes" not in item[0]] for t in trees]
    if trees[0] != trees[1]:
        gone = [item for item in trees[0] if item not in trees[1]] + [item for item in trees[1] if item not in trees[0]]
        said.append(f"description: {gone[:2]}")
    n_blobs = sum(kind == "blob" for _, kind, _ in trees[0])
    n_scans = old.scan_count
    if new.scan_count != n_scans:
        said.append(f"{new.scan_count} of {n_scans} scans")
    scans = []
    for index in range(min(n_scans, new.scan_count)):
        then, now = columns(old, index), columns(new, index)
        wrong, taken = compare_scan(then, now, labels(index, then), way)
        said += [f"scan {index}: {w}" for w in wrong]
        out += taken
        n_points += len(next(iter(then.values()))) if then else 0
        scans.append(now)
    old.close()
    new.close()
    return n_scans, n_points, out, n_blobs, said, common_readers(after, scans)


def compare_ptx(before, after, labels):
    """The same of PTX files, line by line."""
    old, new = (Path(p).read_bytes().splitlines(keepends=True) for p in (before, after))
    said, out, n_points, n_scans, at = [], 0, 0, 0, 0
    if len(old) != len(new):
        said.append(f"{len(new)} of {len(old)} lines")
        return n_scans, n_points, out, 0, said, []
    while at < len(old):
        while at < len(old) and not old[at].strip():
            at += 1
        if at == len(old):
            break
        n = int(old[at]) * int(old[at + 1])
        if old[at:at + 10] != new[at:at + 10]:
            said.append(f"scan {n_scans}: header differs")
        rows = range(at + 10, at + 10 + n)
        words = [old[i].split() for i in rows]
        valid = [any(float(v) != 0 for v in w[:3]) for w in words]
        kind = iter(labels(n_scans, sum(valid))["kind"])
        for i, was, has in zip(rows, words, valid):
            moves = has and next(kind) in MOVING
            out += moves
            want = [b"0", b"0", b"0", *was[3:]] if moves else None
            if (new[i].split() != want) if moves else (new[i] != old[i]):
                said.append(f"line {i + 1} differs")
        n_points, n_scans, at = n_points + n, n_scans + 1, at + 10 + n
    return n_scans, n_points, out, 0, said[:3], []


def made_up(n, seed):
    """Labels in runs of all lengths; a fifth of the points moves."""
    dice = np.random.default_rng(seed)
    kind = np.zeros(n, np.uint8)
    at = 0
    while at < n:
        length = int(dice.geometric(1 / 30))
        kind[at:at + length] = dice.choice([0, 1, 2, 3, 255], p=[0.5, 0.15, 0.05, 0.2, 0.1])
        at += length
    moves = np.isin(kind, MOVING)
    robot, link = (np.where(moves, dice.integers(0, 9, n), -1).astype(np.int16) for _ in range(2))
    return {"kind": kind, "robot": robot, "link": link}


def npy(path, array):
    head = f"{{'descr': '{array.dtype.str}', 'fortran_order': False, 'shape': ({len(array)},), }}"
    Path(path).write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", 118) + head.ljust(117).encode() + b"\n" + array.tobytes())


def by_example(example, path, way, folder):
    """Gives a file back with made-up labels and compares."""
    kept = {}
    if path.suffix == ".ptx":
        compare = compare_ptx
        text = path.read_bytes().split(b"\n")
        lines = [line.split() for line in text if line.strip()]
        at = 0
        while at < len(lines):
            n = int(lines[at][0]) * int(lines[at + 1][0])
            rows = lines[at + 10:at + 10 + n]
            kept[len(kept)] = made_up(sum(any(float(v) != 0 for v in w[:3]) for w in rows), len(kept))
            at += 10 + n
    else:
        compare = compare_e57
        file = pye57.E57(str(path))
        for index in range(file.scan_count):
            columns_ = columns(file, index)
            state, _ = state_of(columns_)
            n = len(next(iter(columns_.values()))) if columns_ else 0
            kept[index] = made_up(int((columns_[state] == 0).sum()) if state else n, index)
        file.close()
    for index, labels in kept.items():
        for name, array in labels.items():
            npy(folder / f"{index}.{name}.npy", array)
    out = folder / f"out{path.suffix}"
    ran = subprocess.run([example, path, out, folder, *WAYS[way]], capture_output=True, text=True)
    if ran.returncode:
        return 0, 0, 0, 0, [ran.stderr.strip()[-200:]], []
    more = () if path.suffix == ".ptx" else (way,)
    return compare(path, out, lambda index, _: kept[index], *more)


def by_result(out, scans, way):
    """Compares what `export` wrote of a result with the originals; yields rows."""
    result = json.loads((out / "result.json").read_text())
    taken = set()
    for at, entry in enumerate(result["inputs"]):
        name, kind = Path(entry["path"]).name, entry["format"]
        if kind not in ("e57", "ptx"):
            continue
        # Names that several inputs have are numbered in the order of the inputs.
        back = next(n for n in [name, *(f"{k}-{name}" for k in range(2, 1000))] if n not in taken)
        taken.add(back)
        masks = [scan for scan in result["labels"]["scans"] if scan["input"] == at]

        def labels(index, _, masks=masks):
            return {column: np.load(out / masks[index][column]) for column in ("kind", "robot", "link")}

        original = next(Path(s) for s in scans if Path(s).name == name)
        given = out / "export" / kind / back
        if kind == "ptx":
            yield original, compare_ptx(original, given, labels)
        else:
            yield original, compare_e57(original, given, labels, way)


def row(name, way, outcome):
    n_scans, n_points, out, n_blobs, said, readers = outcome
    verdict = "**same**" if not said else "; ".join(map(str, said[:3]))
    print(f"| `{name}` | {way} | {n_scans} | {n_points:,} | {out:,} | {n_blobs} | {verdict} | {'; '.join(readers)} |", flush=True)
    return bool(said)


def files_of(given):
    for path in map(Path, given):
        yield from sorted(p for p in path.rglob("*") if p.suffix in (".e57", ".ptx")) if path.is_dir() else [path]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--result", type=Path)
    parser.add_argument("--way", choices=WAYS, default="flagged", help="how the result was exported")
    parser.add_argument("--scans", nargs="+", default=[])
    parser.add_argument("files", nargs="*")
    given = parser.parse_args()
    print("| file | given back | scans | records | taken out | blobs | all else | pye57's own functions |")
    print("| --- | --- | ---: | ---: | ---: | ---: | --- | --- |")
    wrong = 0
    if given.result:
        for original, outcome in by_result(given.result, given.scans, given.way):
            wrong += row(original.name, given.way, outcome)
        return wrong > 0
    example, *files = given.files
    for path in files_of(files):
        for way in WAYS if path.suffix == ".e57" else ["flagged"]:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    outcome = by_example(example, path, way, Path(folder))
                except Exception as error:
                    print(f"| `{path.name}` | | | | | | not read by pye57 either: {str(error).splitlines()[0][:80]} | |")
                    break
                wrong += row(path.name, way, outcome)
    return wrong > 0


if __name__ == "__main__":
    sys.exit(main())
