#!/usr/bin/env python3
"""Measures time and memory of `export --to mesh` and `--to e57` by the number of points.

    scripts/export_rates.py --program target/release/stillpoint --demo DIR --work DIR
                            [--millions 5,10,20,40] [--csv FILE]

DIR of --demo is the output of `stillpoint demo --out DIR`: its cell is scanned again with that many
beams in all, by four scanners, and run. Each export is made twice, and the faster one counts by its
wall clock. Asked are 40 M points in a mesh in 60 s on two cores below 2 GiB, linear in points, and
15 M points a second given back as E57. Needs 120 bytes of disk a point in --work, numpy, open3d and
pye57 (of which the functions of mesh_cells.py are shared).
"""

import argparse
import csv
import json
import shutil
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from mesh_cells import child, toml  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--demo", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--millions", default="5,10,20,40")
    parser.add_argument("--csv", type=argparse.FileType("w"), default=sys.stdout)
    args = parser.parse_args()
    program, demo = args.program.resolve(), args.demo.resolve()
    quiet = ["--progress", "none"]
    writer = csv.writer(args.csv)
    writer.writerow("export,points,bound_mm,triangles,processor_s,wall_s,m_points_per_s,peak_mib".split(","))
    for millions in map(float, args.millions.split(",")):
        dir = args.work.resolve() / f"rate-{millions:g}"
        shutil.rmtree(dir, ignore_errors=True)
        dir.mkdir(parents=True)
        scene = tomllib.loads((demo / "scene.toml").read_text())
        for scanner in scene["scanner"]:
            n = millions * 1e6 / len(scene["scanner"])
            scanner["raster"] = {**scanner.get("raster", {}), "n_beams": int(n)}
        (dir / "scene.toml").write_text(toml(scene))
        robots = ["--robots", demo / "robots"]
        child([program, "simulate", dir / "scene.toml", *robots, "--out", dir / "scans", *quiet])
        (dir / "scans/scans.las").unlink()
        out = dir / "out"
        child([program, "run", dir / "scans/scans.e57", *robots, "--out", out, *quiet])
        result = json.load(open(out / "result.json"))
        points = sum(scan["n_points"] for scan in result["labels"]["scans"])
        for format in ("mesh", "e57"):
            call = [program, "export", out, "--to", format, *quiet]
            cpu, wall, peak = min((child(call) for _ in range(2)), key=lambda use: use[1])
            report = json.load(open(out / "export/mesh/mesh.json")) if format == "mesh" else {}
            bound = report and round(report["bound"] * 1e3, 1)
            rate = round(points / wall / 1e6, 2)
            row = [format, points, bound or "", report.get("triangles", "")]
            writer.writerow([*row, round(cpu, 2), round(wall, 2), rate, round(peak)])
            args.csv.flush()
        shutil.rmtree(dir)


main()
