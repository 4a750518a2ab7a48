#!/usr/bin/env python3
"""Does the same work with other tools: reads a LAS file, removes the floor, finds connected bodies, and writes 5 m tiles with
their numbers. Prints one line of JSON for each tool and file; results that exist already are not computed again.

    stillpoint bench throughput --points 10M,50M --truth --keep --out bench
    scripts/peers.py bench/10000000 bench/50000000 --robots bench/robots --out peers

Tools that are not installed are passed over by name: numpy + CSF + scipy (pip: laspy cloth-simulation-filter scipy),
PDAL, Open3D, CloudCompare."""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

VOXEL = 0.05
TILE = 5.0
FLOOR = 3


def by_script(source, out):
    """numpy + CSF + scipy, as a user would write it."""
    import CSF
    import laspy
    import numpy as np
    from scipy import ndimage

    las = laspy.read(source)
    xyz = np.ascontiguousarray(las.xyz)
    filter = CSF.CSF()
    filter.params.bSloopSmooth = False
    filter.params.cloth_resolution = 0.5
    filter.params.class_threshold = 0.05
    filter.setPointCloud(xyz)
    ground, rest = CSF.VecInt(), CSF.VecInt()
    filter.do_filtering(ground, rest, False)
    ground, rest = np.array(ground, dtype=np.int64), np.array(rest, dtype=np.int64)
    np.save(out / "floor.npy", ground)
    cells = np.floor(xyz[rest] / VOXEL).astype(np.int32)
    cells -= cells.min(axis=0)
    grid = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    numbers, _ = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    cluster = np.zeros(len(xyz), dtype=np.uint32)
    cluster[rest] = numbers[tuple(cells.T)]
    las.add_extra_dim(laspy.ExtraBytesParams("cluster", np.uint32))
    las.cluster = cluster
    tile = np.floor(xyz[:, :2] / TILE).astype(np.int32)
    order = np.lexsort((tile[:, 0], tile[:, 1]))
    cuts = np.flatnonzero(np.any(np.diff(tile[order], axis=0), axis=1)) + 1
    for part in np.split(order, cuts):
        name = f"{tile[part[0], 0]}_{tile[part[0], 1]}.las"
        laspy.LasData(las.header, las.points[part]).write(out / name)


def by_pdal(source, out, floor=("csf", {"resolution": 0.5, "threshold": 0.05})):
    """PDAL: floor, cluster, split."""
    name, options = floor
    pipeline = [
        str(source),
        {"type": f"filters.{name}", **options},
        {"type": "filters.cluster", "tolerance": 0.1, "where": "Classification != 2"},
        {"type": "filters.splitter", "length": TILE},
        {"type": "writers.las", "filename": str(out / "tile_#.las"), "extra_dims": "all"},
    ]
    subprocess.run(["pdal", "pipeline", "--stdin"], input=json.dumps(pipeline), text=True, check=True)


def by_pdal_smrf(source, out):
    """The same with its other floor filter: csf of PDAL 2.2 takes 12 GiB, however few points there are."""
    by_pdal(source, out, ("smrf", {"cell": 0.5, "threshold": 0.05}))


def by_open3d(source, out):
    """Open3D: segment_plane only; it picks the ceiling where that has more points."""
    import laspy
    import numpy as np
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(laspy.read(source).xyz))
    _, ground = cloud.segment_plane(0.02, 3, 1000)
    np.save(out / "floor.npy", np.array(ground))


def by_cloudcompare(source, out):
    """CloudCompare: CSF plugin, components."""
    command = ["CloudCompare", "-SILENT", "-AUTO_SAVE", "ON", "-O", str(source), "-CSF", "-EXTRACT_CC", "9", "100"]
    subprocess.run(command, check=True, cwd=out)


PEERS = {
    "script": (by_script, ["numpy", "scipy", "laspy", "cloth-simulation-filter"], None),
    "pdal": (by_pdal, [], "pdal"),
    "pdal-smrf": (by_pdal_smrf, [], "pdal"),
    "open3d": (by_open3d, ["open3d", "laspy"], None),
    "cloudcompare": (by_cloudcompare, [], "CloudCompare"),
}


def versions(tool):
    """What is installed of a tool; nothing where something is missing."""
    _, packages, program = PEERS[tool]
    found = {}
    for package in packages:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            return None
    if program:
        if not shutil.which(program):
            return None
        said = subprocess.run([program, "--version"], capture_output=True, text=True)
        found[program] = (said.stdout + said.stderr).strip().splitlines()[:1]
    return found


def measured(command):
    """Seconds and peak resident memory of a command, GiB; an error where it failed."""
    with tempfile.TemporaryFile("w+") as said:
        started = time.monotonic()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
        # Of this one process: what `resource` knows of children is the most of all of them.
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.monotonic() - started
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        last = (said.read().strip().splitlines() or ["failed"])[-1]
    error = None if process.returncode in (0, 3) else last
    return {"seconds": round(seconds, 2), "peak_gib": round(usage.ru_maxrss / 2**20, 2), "error": error}


def floor_iou(plant, mine):
    """Of a boolean floor mask against the truth; None without truth."""
    import numpy as np

    truth = plant / "scans/truth/las/labels/0.kind.npy"
    if not truth.exists():
        return None
    truth = np.load(truth) == FLOOR
    return round(float((mine & truth).sum() / max(1, (mine | truth).sum())), 4)


def ours(plant, out, arguments):
    import numpy as np

    scans = plant / "scans"
    command = [arguments.stillpoint, "run", scans / "scans.las", "--scanners", scans / "scanners.toml"]
    command += ["--robots", arguments.robots, "--out", out, "--progress", "none"]
    # What the others do: tiles with the numbers of bodies, and nothing twice; no robot is as tall as is asked for, so
    # none is searched.
    settings = ["export.fixed_cloud=false", f"export.tile_edge={TILE}", "export.bodies=true", "region.min_height=1000"]
    for setting in settings:
        command += ["--set", setting]
    row = measured(list(map(str, command)))
    kinds = out / "labels/0.kind.npy"
    row["floor_iou"] = floor_iou(plant, np.load(kinds) == FLOOR) if kinds.exists() else None
    return row


def peer(tool, plant, out):
    import numpy as np

    source = plant / "scans/scans.las"
    row = measured([sys.executable, __file__, "--as", tool, str(source), "--out", str(out)])
    ground = out / "floor.npy"
    if ground.exists():
        n = len(np.load(plant / "scans/truth/las/labels/0.kind.npy", mmap_mode="r"))
        mine = np.zeros(n, dtype=bool)
        mine[np.load(ground)] = True
        row["floor_iou"] = floor_iou(plant, mine)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plants", nargs="*", type=Path, help="folders of `bench throughput --truth --keep`")
    parser.add_argument("--robots", type=Path, help="robot library, for the run of ours")
    parser.add_argument("--stillpoint", default="stillpoint", help="our program")
    parser.add_argument("--tools", default="ours,script,pdal,pdal-smrf,open3d,cloudcompare")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--as", dest="tool", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.tool:
        PEERS[arguments.tool][0](arguments.plants[0], arguments.out)
        return
    journal = arguments.out / "peers.jsonl"
    rows = [json.loads(line) for line in journal.read_text().splitlines()] if journal.exists() else []
    for plant in arguments.plants:
        for tool in arguments.tools.split(","):
            if any(row["tool"] == tool and row["plant"] == plant.name for row in rows):
                continue
            known = {} if tool == "ours" else versions(tool)
            if known is None:
                print(f"{tool} is not installed")
                continue
            work = arguments.out / f"{tool}-{plant.name}"
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir()
            row = {"tool": tool, "plant": plant.name, "versions": known, "machine": platform.machine()}
            row |= ours(plant, work, arguments) if tool == "ours" else peer(tool, plant, work)
            shutil.rmtree(work, ignore_errors=True)
            rows.append(row)
            with journal.open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(row, flush=True)


if __name__ == "__main__":
    main()
