"""The parts of the table: which file each reader opens, and the truth that it is compared with."""

import json
import shutil
import subprocess
from pathlib import Path

import compare
import numpy as np
import ours
import theirs
from programs import labelled, program

# The names of our PLY's columns, and what CloudCompare makes of them.
PLY_NAMES = {f"scalar_{name}": name for name in ("kind", "robot", "link")}
KIND_OF_CLASS = {64: 0, 65: 1, 66: 2, 2: 3, 69: 255}


def reads(setting, table, part, file, who, probe, compared):
    """One cell: `probe` is a reader of clouds.py and what it needs more."""
    reader, path, *more = probe
    out = setting.work / "read.npz"
    out.unlink(missing_ok=True)
    _, wrong = setting.probe("clouds.py", reader, path, out, *more)
    if wrong or not out.is_file():
        table.add(part, file, who, f"absent: {wrong.split(chr(58) + chr(32))[-1]}" if "no plugin" in str(wrong) else f"not read: {wrong}")
        return
    with np.load(out) as got:
        table.add(part, file, who, compared(dict(got)))


def outside(setting, table, part, file, path, compared, driver=""):
    """PDAL and CloudCompare, where they are there."""
    for name, reader in (("pdal", "pdal"), ("cloudcompare", "cloudcompare")):
        call = program(setting, name)
        who = {"pdal": f"PDAL {setting.given.pdal_version or ''}", "cloudcompare": f"CloudCompare {setting.given.cloudcompare_version or ''}"}[name].strip()
        if call is None:
            table.add(part, file, who, "absent: not installed where the table was made")
            continue
        more = [call, driver] if name == "pdal" else [call]
        reads(setting, table, part, file, who, (reader, path, *more), compared)


def las_and_laz(setting, material, table):
    _, _, plain, packed = material
    tile = max((plain / "tiles").glob("*.las"), key=lambda p: p.stat().st_size)
    truth, step = compare.las(tile)
    compared = lambda got: compare.clouds(truth, got, step)
    part = "LAS and LAZ: a tile, with colours, classes and extra fields"
    reads(setting, table, part, "`tiles/*.las`", labelled(setting, "laspy"), ("laspy_lazrs", tile), compared)
    outside(setting, table, part, "`tiles/*.las`", tile, compared, "las")
    laz = packed / "tiles" / tile.with_suffix(".laz").name
    for reader, package in (("laspy_lazrs", "lazrs"), ("laspy_laszip", "laszip")):
        who = f"{labelled(setting, 'laspy')} with {labelled(setting, package)}"
        reads(setting, table, part, "`tiles/*.laz`", who, (reader, laz), compared)
    outside(setting, table, part, "`tiles/*.laz`", laz, compared, "las")


def copc(setting, material, table):
    _, _, plain, packed = material
    tiles = [compare.las(tile) for tile in sorted((plain / "tiles").glob("*.las"))]
    truth = {name: np.concatenate([tile[name] for tile, _ in tiles]) for name in tiles[0][0]}
    step, path = tiles[0][1], packed / "clouds/plant.copc.laz"
    compared = lambda got: compare.clouds(truth, got, step, in_order=False)
    part = "COPC: the whole plant"
    file = "`clouds/plant.copc.laz`"
    who = f"{labelled(setting, 'laspy')}, `CopcReader`"
    reads(setting, table, part, file, who, ("laspy_copc", path), compared)
    who = f"{labelled(setting, 'laspy')} with {labelled(setting, 'lazrs')}, as LAZ"
    reads(setting, table, part, file, who, ("laspy_lazrs", path), compared)
    who = f"{labelled(setting, 'laspy')} with {labelled(setting, 'laszip')}, as LAZ"
    reads(setting, table, part, file, who, ("laspy_laszip", path), compared)
    reads(setting, table, part, file, labelled(setting, "copclib"), ("copclib", path), compared)
    outside(setting, table, part, file, path, compared, "las")
    table.add(part, file, "the rules of COPC 1.0 that Potree and QGIS rely on", ours.copc_rules(path, len(truth["x"])))


def ply(setting, material, table):
    _, _, plain, packed = material
    part = "PLY: moving and fixed points"
    tiles = [compare.las(tile) for tile in sorted((plain / "tiles").glob("*.las"))]
    all_of = {name: np.concatenate([tile[name] for tile, _ in tiles]) for name in tiles[0][0]}
    kind = np.vectorize(KIND_OF_CLASS.get)(all_of["classification"])
    for name, moves in (("robots.ply", True), ("fixed.ply", False)):
        these = ((kind == 1) | (kind == 2)) == moves
        of = {c: all_of[c][these] for c in ("x", "y", "z", "intensity")}
        of |= {"kind": kind[these], "robot": all_of["RobotId"][these].astype(int) - 1, "link": all_of["LinkId"][these].astype(int) - 1}
        of |= {c: all_of[c][these] >> 8 for c in ("red", "green", "blue")}
        compared = lambda got, of=of: compare.clouds(of, got, tiles[0][1], in_order=tile_order(of, got), names=PLY_NAMES)
        path, file = packed / "export" / name, f"`export/{name}`"
        for reader, package, who in (("plyfile", "plyfile", None), ("open3d_legacy", "open3d-cpu", "open3d.io"), ("trimesh", "trimesh", None),
                                     ("open3d_tensor", "open3d-cpu", "open3d.t.io"), ("pyntcloud", "pyntcloud", None), ("meshio", "meshio", None)):
            reads(setting, table, part, file, labelled(setting, package, who), (reader, path), compared)
        if moves:
            outside(setting, table, part, file, path, compared)


def tile_order(of, got):
    """The tiles' own order may be another than that of their names; then both are sorted."""
    return len(of["x"]) == len(got["x"]) and bool(np.allclose(of["x"][:100], got["x"][:100], atol=1e-4))


def e57(setting, material, table):
    _, cell, _, _ = material
    part, path = "E57: scans of the virtual scanner", cell / "scans.e57"
    cloud, step = compare.las(cell / "scans.las")
    truth = {name: cloud[name] for name in "xyz"} | {"intensity": cloud["intensity"] / 65535}
    coarse = {"intensity": 0.6 / 65535}
    file = "`simulate`'s `scans.e57`"
    # The simulator's LAS rounds to its step what E57 holds exactly.
    compared = lambda got: without_misses(truth, scaled(got), path, lambda got: compare.clouds(truth, got, 2 * step, coarse=coarse))
    reads(setting, table, part, file, labelled(setting, "pye57"), ("pye57", path), compared)
    reads(setting, table, part, file, labelled(setting, "e57"), ("e57", path), compared)
    outside(setting, table, part, file, path, compared)
    table.add(part, file, labelled(setting, "open3d-cpu", "open3d.io"), "absent: it reads no E57")


def without_misses(truth, got, path, compared):
    """Beams that found nothing are no points; a reader may hand them out at the place of their scanner."""
    import pye57

    more = len(got["x"]) - len(truth["x"])
    if more <= 0:
        return compared(got)
    file = pye57.E57(str(path))
    xyz = np.stack([got[c] for c in "xyz"], axis=1)
    at = [np.abs(xyz - file.get_header(i).translation).max(axis=1) < 1e-6 for i in range(file.scan_count)]
    hit = ~np.any(at, axis=0)
    said = compared({name: column[hit] for name, column in got.items()})
    return f"gives {int((~hit).sum())} beams as points that are flagged as invalid, at the place of the scanner; all others: {said}"


def scaled(got):
    """PDAL and CloudCompare may give intensities as 16 bits."""
    if "intensity" in got and np.max(got["intensity"], initial=0) > 1.5:
        got["intensity"] = np.asarray(got["intensity"], float) / 65535
    return got


def urdf(setting, material, table):
    _, _, _, packed = material
    part = "URDF of a found robot with what hangs on it, in the posture of `joints.yaml`"
    result = compare.read_json(packed / "result.json")
    packages = {"yourdfpy": "yourdfpy", "urchin": "urchin", "pytransform3d": "pytransform3d", "pinocchio": "pin",
                "pybullet": "pybullet", "mujoco": "mujoco"}
    for robot in result["robots"]:
        truth = compare.robot_truth(packed, robot)
        joints = setting.work / "joints.json"
        joints.write_text(json.dumps(robot["joints"] | robot["passive"]))
        path = packed / "robots" / robot["id"] / "robot.urdf"
        fixed = ours.fixed_links(path)
        for reader, package in packages.items():
            out = setting.work / "robot.json"
            out.unlink(missing_ok=True)
            _, wrong = setting.probe("robots.py", reader, path, joints, out)
            said = f"not read: {wrong}" if wrong else compare.robots(truth, compare.read_json(out), fixed, reader == "pybullet")
            table.add(part, f"`robots/{robot['id']}/robot.urdf` ({robot['model']})", labelled(setting, package), said)


def octomap(setting, material, table):
    _, _, _, packed = material
    part = "OctoMap: space about a robot"
    robot = compare.read_json(packed / "result.json")["robots"][0]
    space = robot["space"]
    kinds, edge = np.load(packed / space["grid"]), space["edge"]
    every = np.stack(np.unravel_index(np.arange(0, kinds.size, 7), kinds.shape), axis=1)
    middles = np.array(space["origin"]) - np.array(space["octomap_shift"]) + (every + 0.5) * edge
    np.save(setting.work / "middles.npy", middles)
    here = kinds.ravel()[::7]
    known = np.where(here == 0, 255, np.where((here == 2) | (here == 4), 1, 0))
    trees = (("space.bt", "octomap", known), ("unknown.bt", "unknown", (here == 0).astype(int)))
    for name, key, truth in trees:
        path, file = packed / space[key], f"`robots/R1/{name}`"
        for reader, package in (("octomap", "octomap-python"), ("pyoctomap", "pyoctomap"), ("octomap_tools", None)):
            call = program(setting, "octomap_tools") if package is None else ""
            who = labelled(setting, package) if package else f"octomap-tools {setting.given.octomap_tools_version or ''}".strip()
            if call is None:
                table.add(part, file, who, "absent: not installed where the table was made")
                continue
            out = setting.work / "voxels.npz"
            out.unlink(missing_ok=True)
            _, wrong = setting.probe("voxels.py", reader, path, setting.work / "middles.npy", out, *([call] if package is None else []))
            if wrong:
                table.add(part, file, who, f"not read: {wrong}")
                continue
            with np.load(out) as got:
                said = compare.voxels(truth, got["known"], got["leaves"], edge, tells_free=package is not None)
            table.add(part, file, who, said)


def small(setting, material, table):
    _, _, _, packed = material
    part = "Tables, reports, masks and pictures"
    for file, path, readers, expected, digits in ours.small_files(packed):
        for reader, package in readers:
            got, wrong = setting.probe("tables.py", reader, path)
            who = labelled(setting, package) if package else "Python's own"
            said = f"not read: {wrong}" if wrong else "right" if compare.numbers(expected, json.loads(got), digits) else "numbers differ"
            table.add(part, file, who, said)
    masks, result = [], compare.read_json(packed / "result.json")
    for scan in result["labels"]["scans"]:
        masks += [np.load(packed / scan[k]).shape == (scan["n_points"],) for k in ("kind", "robot", "link")]
    table.add(part, "`labels/*.npy`", f"numpy {np.__version__}", "right" if all(masks) else "lengths differ")


def readme(setting, material, table):
    """The Python lines of the README, on a LAS, a LAZ and a COPC file: the points that are kept must be those of the mask."""
    import laspy

    _, cell, plain, packed = material
    part = "The Python lines of the README"
    text = (Path(__file__).parents[2] / "README.md").read_text()
    lines = text.split("```python\n")[1].split("```")[0]
    tile = max((packed / "tiles").glob("*.laz"), key=lambda p: p.stat().st_size)
    for file, path in (("LAS", cell / "coloured.las"), ("LAZ", tile), ("COPC", packed / "clouds/plant.copc.laz")):
        folder = setting.work / "lines"
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "result/labels").mkdir(parents=True)
        shutil.copy(path, folder / "hall.laz")
        whole = laspy.read(path)
        mask = (np.arange(len(whole.points)) * 7 % 5).astype(np.uint8)
        if file == "LAS":
            mask = np.load(plain / "labels/0.kind.npy")
        np.save(folder / "result/labels/0.kind.npy", mask)
        ran = subprocess.run([setting.python, "-c", lines], cwd=folder, capture_output=True, text=True, check=False)
        if ran.returncode:
            said = ran.stderr.strip().splitlines()[-1]
        else:
            kept, wanted = laspy.read(folder / "fixed.laz"), whole.points.array[(mask != 1) & (mask != 2)]
            said = "right" if np.array_equal(kept.points.array, wanted) else f"{len(kept.points)} of {len(wanted)} points, or others"
        table.add(part, file, labelled(setting, "laspy"), said)


def others(setting, material, table):
    theirs.clouds(setting, material, table)
    theirs.robots(setting, material, table)


ALL = (las_and_laz, copc, ply, e57, urdf, octomap, small, readme, others)
