#!/usr/bin/env python3
"""Opens everything under an output folder with the libraries that others use (numpy, laspy; pye57 and PDAL where
installed) and checks that points, classes and extra fields agree with result.json."""

import argparse
import json
import math
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np

CLASSES = {2: "floor", 64: "fixed", 65: "robot link", 66: "attachment", 69: "uncertain"}
KINDS = {0: 64, 1: 65, 2: 66, 3: 2, 255: 69}
problems = []
seen = []


def check(holds, what):
    if not holds:
        problems.append(what)


def check_masks(out, result):
    """Masks have one entry a point, and point into the robots and links of the result."""
    counts = dict.fromkeys(KINDS, 0)
    for scan in result["labels"]["scans"]:
        kind, robot, link = (np.load(out / scan[k], mmap_mode="r") for k in ("kind", "robot", "link"))
        name = scan["scan"]
        check((kind.dtype, robot.dtype, link.dtype) == (np.uint8, np.int16, np.int16), f"{name}: wrong types")
        check(kind.shape == robot.shape == link.shape == (scan["n_points"],), f"{name}: lengths differ")
        check(set(np.unique(kind).tolist()) <= set(KINDS), f"{name}: unknown kind")
        moving = (kind == 1) | (kind == 2)
        check(bool((robot[~moving] == -1).all()), f"{name}: robot number on a point that does not move")
        check(bool((robot[moving] >= 0).all()), f"{name}: moving point without robot")
        for index in np.unique(robot[moving]).tolist():
            check(0 <= index < len(result["robots"]), f"{name}: robot {index} is not in the result")
            if 0 <= index < len(result["robots"]):
                links = link[robot == index]
                n_links = len(result["robots"][index]["links"])
                check(links.min() >= 0 and links.max() < n_links, f"{name}: link outside robot {index}")
        for value in KINDS:
            counts[value] += int((kind == value).sum())
        seen.append(f"mask {name}: {len(kind)} points")
    table = json.loads((out / result["labels"]["table"]).read_text())
    check([r["id"] for r in table["robots"]] == [r["id"] for r in result["robots"]], "table and result differ")
    return counts


def check_robots(result):
    for robot in result["robots"]:
        check(set(robot["joints"]) == set(robot["sigma"]), f"{robot['id']}: joints without sigma")
        norm = math.sqrt(sum(q * q for q in robot["base_pose"]["quat_wxyz"]))
        check(abs(norm - 1) < 1e-9, f"{robot['id']}: quaternion is not of unit length")
        check(robot["verdict"] in ("trusted", "doubtful", "refused"), f"{robot['id']}: unknown verdict")
        check(robot["base_link"] == robot["links"][0], f"{robot['id']}: base link is not the first")


def check_cloud(path):
    """A labelled LAS or LAZ file; returns how many points there are of each class."""
    import laspy

    with laspy.open(path) as file:
        header = file.header
        cloud = file.read()
    check((header.version.major, header.version.minor) == (1, 4), f"{path}: not LAS 1.4")
    check(header.point_format.id in (6, 7), f"{path}: point format {header.point_format.id}")
    check(len(cloud.points) == header.point_count, f"{path}: header counts {header.point_count}")
    extra = list(header.point_format.extra_dimension_names)
    check(extra == ["RobotId", "LinkId"], f"{path}: extra fields {extra}")
    if len(cloud.points) == 0:
        return {}
    xyz = cloud.xyz
    step = header.scales.max() * 1.01
    check(bool((abs(xyz.min(axis=0) - header.mins) < step).all()), f"{path}: smallest corner is wrong")
    check(bool((abs(xyz.max(axis=0) - header.maxs) < step).all()), f"{path}: largest corner is wrong")
    check(int(header.number_of_points_by_return[0]) == header.point_count, f"{path}: points by return")
    classes = np.asarray(cloud.classification)
    check(set(np.unique(classes).tolist()) <= set(CLASSES), f"{path}: unknown class")
    moving = (classes == 65) | (classes == 66)
    robot, link = np.asarray(cloud["RobotId"]), np.asarray(cloud["LinkId"])
    check(bool(((robot > 0) == moving).all()), f"{path}: RobotId and class differ")
    check(bool(((link > 0) == moving).all()), f"{path}: LinkId and class differ")
    return {int(c): int((classes == c).sum()) for c in np.unique(classes)}


def files_of(out, folder):
    """The clouds of a folder, without the one that holds all of them once more."""
    return sorted(p for p in (out / folder).glob("*.la[sz]") if not p.name.endswith(".copc.laz"))


def check_clouds(out, folder, counts):
    files = files_of(out, folder)
    total = {}
    for path in files:
        for value, n in check_cloud(path).items():
            total[value] = total.get(value, 0) + n
    if files:
        seen.append(f"{folder}: {len(files)} files, {sum(total.values())} points, by class {dict(sorted(total.items()))}")
    for kind, n in counts.items():
        # Points that were dropped have an entry in the mask, but no place in a cloud.
        n_cloud = total.get(KINDS[kind], 0)
        whole = n_cloud == n if kind != 255 else n_cloud <= n
        check(not files or whole, f"{folder}: {n_cloud} points of kind {kind}, mask has {n}")


def check_copc(out, pdal):
    """The COPC file, where there is one, holds all points of the tiles, and fewer of them at a coarser resolution."""
    import laspy

    path = out / "clouds/plant.copc.laz"
    if not path.is_file():
        return

    def lines(cloud):
        names = ("X", "Y", "Z", "intensity", "classification", "point_source_id", "gps_time", "RobotId", "LinkId")
        columns = np.stack([np.asarray(cloud[name], dtype=np.float64) for name in names], axis=1)
        return columns[np.lexsort(columns.T)]

    with laspy.CopcReader.open(path) as file:
        whole, coarse = file.query(), file.query(resolution=file.copc_info.spacing)
    tiles = [lines(laspy.read(tile)) for tile in files_of(out, "tiles")]
    tiles = np.concatenate(tiles) if tiles else np.zeros((0, 9))
    same = np.array_equal(lines(whole), tiles[np.lexsort(tiles.T)])
    check(same, f"{path}: {len(whole)} points are not the {len(tiles)} of the tiles")
    check(0 < len(coarse) <= len(whole), f"{path}: {len(coarse)} points at the coarsest")
    seen.append(f"COPC: {len(whole)} points, {len(coarse)} of them at the coarsest")
    if shutil.which(pdal[0]):
        counted = pdal_stats(pdal, path, ["--driver=readers.copc"]).get("X", {}).get("count")
        check(counted == len(whole), f"{path}: PDAL sees {counted} points, laspy {len(whole)}")


def check_e57(files):
    try:
        import pye57
    except ImportError:
        if files:
            seen.append("E57 not checked: no pye57")
        return
    for path in files:
        file = pye57.E57(str(path))
        for i in range(file.scan_count):
            header = file.get_header(i)
            if header.point_count == 0:
                continue
            # The crate under pye57 gives valid points only, moved to the world; raw ones keep their pixel.
            raw = file.read_scan_raw(i)
            check(len(raw["cartesianX"]) == header.point_count, f"{path}: scan {i} is short")
            valid = raw["cartesianInvalidState"] == 0
            world = file.read_scan(i, intensity=True, row_column=True)
            check(len(world["cartesianX"]) == int(valid.sum()), f"{path}: scan {i}: valid points differ")
            local = np.stack([raw[f"cartesian{c}"][valid] for c in "XYZ"], axis=1)
            moved = local @ header.rotation_matrix.T + header.translation
            got = np.stack([world[f"cartesian{c}"] for c in "XYZ"], axis=1)
            check(bool(np.allclose(moved, got, atol=1e-5)), f"{path}: scan {i}: pose is not applied as written")
        seen.append(f"{path.name}: {file.scan_count} scans")


def pdal_stats(pdal, path, options):
    """What `pdal info --stats` says of each field of a file: its count, and which classes are there."""
    call = [*pdal, "info", "--stats", "--enumerate", "Classification", *options, str(path)]
    ran = subprocess.run(call, capture_output=True, text=True)
    if ran.returncode:
        problems.append(f"{path}: PDAL says {ran.stderr.strip()}")
        return {}
    return {field["name"]: field for field in json.loads(ran.stdout)["stats"]["statistic"]}


def check_pdal(out, folder, counts, pdal):
    """PDAL sees as many points of each class as the masks have, and our extra fields."""
    files = files_of(out, folder)
    n_points, classes = 0, set()
    for path in files:
        fields = pdal_stats(pdal, path, ["--readers.las.use_eb_vlr=true"])
        check({"RobotId", "LinkId", "Classification"} <= set(fields), f"{path}: PDAL sees {sorted(fields)}")
        classes |= {int(float(value)) for value in fields.get("Classification", {}).get("values", [])}
        n_points += fields.get("Classification", {}).get("count", 0)
    if files:
        n = sum(counts[kind] for kind in counts if kind != 255)
        check(n <= n_points <= n + counts[255], f"{folder}: PDAL sees {n_points} points, the masks have {n}")
        check(classes <= set(CLASSES), f"{folder}: PDAL sees classes {sorted(classes)}")
        seen.append(f"PDAL, {folder}: {len(files)} files, {n_points} points, classes {sorted(classes)}")


def check_pdal_e57(files, pdal):
    """PDAL sees the beams of our E57 files; it keeps those that are flagged as invalid."""
    import pye57

    for path in files:
        file = pye57.E57(str(path))
        n = sum(file.get_header(i).point_count for i in range(file.scan_count))
        count = pdal_stats(pdal, path, []).get("X", {}).get("count")
        check(count == n, f"{path}: PDAL sees {count} beams, pye57 {n}")
        seen.append(f"PDAL, {path.name}: {count} beams")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="what `run --out` wrote")
    parser.add_argument("--e57", type=Path, nargs="*", default=[], help="simulated E57 files")
    parser.add_argument("--pdal", default="pdal", help="how PDAL is called, for example 'chroot /somewhere pdal'")
    given = parser.parse_args()
    out, pdal = given.out, shlex.split(given.pdal)
    result = json.loads((out / "result.json").read_text(), parse_constant=lambda c: problems.append(f"result has {c}"))
    check(result["schema"] == "stillpoint.result/1", "unknown schema")
    check_robots(result)
    counts = check_masks(out, result)
    check_clouds(out, "tiles", counts)
    check_clouds(out, "clouds", counts)
    check_copc(out, pdal)
    check_e57(sorted(out.rglob("*.e57")) + given.e57)
    if shutil.which(pdal[0]):
        for folder in ("tiles", "clouds"):
            check_pdal(out, folder, counts, pdal)
        check_pdal_e57(given.e57, pdal)
    else:
        seen.append("PDAL not checked: not installed")
    left = [str(p) for p in out.rglob("*.part")]
    check(not left, f"half-written files are left: {left}")
    print("\n".join(seen))
    for problem in problems:
        print(f"WRONG: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
