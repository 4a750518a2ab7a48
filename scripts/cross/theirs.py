"""What other programs write, opened by Stillpoint: points come back from the tiles of a run, robots from a scan of them."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import compare
import numpy as np
from programs import labelled, program

# Points of the cloud that others write: enough for all that is compared, few enough for every program.
N_POINTS = 40_000


def clouds(setting, material, table):
    library, cell, _, _ = material
    part = "Clouds of other programs, read by Stillpoint"
    cloud, step = compare.las(cell / "coloured.las")
    every = np.arange(0, len(cloud["x"]), max(1, len(cloud["x"]) // N_POINTS))
    points = {name: column[every] for name, column in cloud.items()}
    folder = setting.work / "theirs"
    folder.mkdir(exist_ok=True)
    np.savez(folder / "points.npz", **points)
    lasp = labelled(setting, "laspy")
    full = ("intensity", "gps_time", "point_source_id", "red", "green", "blue")
    bare = full[:3]
    files = [
        ("1_2.las", lasp, "las", ("1.2", "3"), full), ("1_4.las", lasp, "las", ("1.4", "8"), full),
        ("lazrs.laz", f"{lasp} with {labelled(setting, 'lazrs')}", "las", ("1.4", "7", "Lazrs"), full),
        ("laszip.laz", f"{lasp} with {labelled(setting, 'laszip')}", "las", ("1.4", "6", "Laszip"), bare),
        ("copclib.copc.laz", labelled(setting, "copclib"), "copc", (), full),
        ("pye57.e57", labelled(setting, "pye57"), "pye57", (), ("red", "green", "blue")),
        *((f"open3d.{kind}", labelled(setting, "open3d-cpu", "open3d.io"), "open3d", (), ()) for kind in ("ply", "pcd", "xyz")),
    ]
    for name, who, writer, more, kept in files:
        _, wrong = setting.probe("writers.py", writer, folder / "points.npz", folder / name, *more)
        said = f"not written: {wrong}" if wrong else ran(setting, library, folder / name, points, kept, step)
        table.add(part, f"`{name}`", who, said)
    converted(setting, table, part, (library, folder, points, step, full))


def converted(setting, table, part, given):
    """What PDAL and CloudCompare make of a LAS file of laspy."""
    library, folder, points, step, full = given
    source = folder / "1_4.las"
    jobs = [("pdal", "pdal.las", full), ("pdal", "pdal.laz", full), ("pdal", "pdal.e57", ("red", "green", "blue")),
            ("cloudcompare", "cc.las", full), ("cloudcompare", "cc.e57", ("red", "green", "blue"))]
    for name, made, kept in jobs:
        call = program(setting, name)
        version = getattr(setting.given, f"{name}_version") or ""
        who = f"{'PDAL' if name == 'pdal' else 'CloudCompare'} {version}".strip()
        if call is None:
            table.add(part, f"`{made}`", who, "absent: not installed where the table was made")
            continue
        out = folder / made
        out.unlink(missing_ok=True)
        if name == "pdal":
            line = [*call.split(), "translate", str(source), str(out)]
            if not made.endswith("e57"):
                line += ["--writers.las.minor_version=4", "--writers.las.forward=all", "--writers.las.dataformat_id=7"]
        else:
            kind = made.split(".")[1].upper()
            line = [*call.split(), "-SILENT", "-AUTO_SAVE", "OFF", "-NO_TIMESTAMP", "-C_EXPORT_FMT", kind, "-O", "-GLOBAL_SHIFT",
                    "0", "0", "0", str(source), "-SAVE_CLOUDS", "FILE", str(out)]
        environment = os.environ | {"QT_QPA_PLATFORM": "offscreen"}
        done = subprocess.run(line, capture_output=True, text=True, timeout=240, env=environment, check=False)
        if "unhandled file extension" in done.stdout:
            table.add(part, f"`{made}`", who, "absent: this build has no plugin for the format")
            continue
        wrong = None if out.is_file() else " ".join((done.stderr or done.stdout).strip().splitlines()[-1:])
        said = f"not written: {wrong}" if wrong is not None else ran(setting, library, out, points, kept, step)
        table.add(part, f"`{made}`", who, said)


def ran(setting, library, path, points, kept, step):
    """A run of a library of one model over the file: its tiles against the points that were written."""
    seen = setting.run("inspect", path, "--json", check=False)
    if seen.returncode == 4:
        return f"refused by name: {seen.stderr.strip().splitlines()[-1].split('error: ')[-1]}"
    one = setting.work / "one"
    if not one.is_dir():
        shutil.copytree(library / "demo_arm_1100", one / "demo_arm_1100")
    out = setting.work / "theirs" / "out"
    shutil.rmtree(out, ignore_errors=True)
    done = setting.run("run", path, "--robots", one, "--out", out, "--set", "export.fixed_cloud=false", check=False)
    if done.returncode:
        return f"the run ends with {done.returncode}: {done.stderr.strip().splitlines()[-1]}"
    tiles = [compare.las(tile) for tile in sorted((out / "tiles").glob("*.las"))]
    got = {n: np.concatenate([t[n] for t, _ in tiles]) for n in tiles[0][0]}
    truth = {n: np.asarray(points[n]) for n in ("x", "y", "z", *kept)}
    if path.suffix == ".e57":
        truth |= {n: truth[n] >> 8 << 8 for n in ("red", "green", "blue") if n in truth}
        got |= {n: got[n] >> 8 << 8 for n in ("red", "green", "blue") if n in got}
    sides = [{n: side[n] for n in truth if n in side} for side in (truth, got)]
    return compare.clouds(*sides, step, in_order=False)


SCENE = """
[[robot]]
name = "R1"
model = "{model}"
xyz = [0.0, 0.0, 0.0]
[[scanner]]
name = "s"
position = [4.0, 2.0, 2.0]
noise = 0.0
dropouts = 0.0
[scanner.raster]
elevation_deg = [-60.0, 45.0]
azimuth_deg = [-180.0, 180.0]
step_deg = 0.4
"""


def robots(setting, material, table):
    """Robots and meshes that other programs wrote, linted and scanned: the points must be those of the original."""
    library, _, _, packed = material
    part = "Robots of other programs, read by Stillpoint"
    folder = setting.work / "their_robots"
    shutil.rmtree(folder, ignore_errors=True)
    model = "demo_arm_1100"
    source = library / model
    original = scanned(setting, library, model, folder / "original")
    for writer in ("yourdfpy", "urchin"):
        made = folder / writer / model
        shutil.copytree(source, made)
        (made / "robot.urdf").unlink()
        _, wrong = setting.probe("writers.py", writer, source / "robot.urdf", made / "robot.urdf")
        said = f"not written: {wrong}" if wrong else linted(setting, folder / writer, model, original)
        table.add(part, "a URDF that was read and written again", labelled(setting, writer), said)
    for writer, package, kinds in (("mesh", "trimesh", ("stl", "obj", "dae", "ply", "glb")),
                                   ("open3d_mesh", "open3d-cpu", ("stl", "obj")), ("meshio_mesh", "meshio", ("stl", "obj"))):
        for kind in kinds:
            made = folder / f"{package}_{kind}" / model
            shutil.copytree(source, made)
            wrong = remeshed(setting, made, writer, kind)
            said = f"not written: {wrong}" if wrong else linted(setting, made.parent, model, original)
            table.add(part, f"meshes as {kind.upper()}", labelled(setting, package), said)


def remeshed(setting, made, writer, kind):
    """All meshes of a model in another format, and its URDF with their new names; what went wrong, or none."""
    text = (made / "robot.urdf").read_text()
    for path in sorted((made / "meshes").iterdir()):
        text = text.replace(path.name, f"{path.stem}_new.{kind}")
    (made / "robot.urdf").write_text(text)
    return setting.probe("writers.py", "meshes", made / "meshes", kind, writer)[1]


def linted(setting, folder, model, original):
    found = json.loads(setting.run("robots", "lint", folder, "--json", check=False).stdout)
    bad = [f["what"] for f in found["findings"] if f["severity"] == "error" or "not read" in f["what"]]
    if bad:
        return f"refused by name: {bad[0]}"
    points = scanned(setting, folder, model, folder / "scan")
    if points is None:
        return "cannot be scanned"
    return compare.clouds(original[0], points[0], original[1], in_order=False)


def scanned(setting, library, model, out):
    """What the virtual scanner sees of a model in its zero posture."""
    out.parent.mkdir(parents=True, exist_ok=True)
    scene = Path(f"{out}.toml")
    scene.write_text(SCENE.format(model=model))
    done = setting.run("simulate", scene, "--robots", library, "--out", out, check=False)
    if done.returncode:
        return None
    cloud, step = compare.las(out / "scans.las")
    return {name: cloud[name] for name in "xyz"}, 2 * step
