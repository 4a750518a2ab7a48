#!/usr/bin/env python3
"""Measures collision meshes of drawn cells against the truth.

    scripts/mesh_cells.py --program target/release/stillpoint --work DIR [--robots LIBRARY]
                          [--seed N] [--cells N] [--csv FILE]

Cells come from `bench plant`: every other one with robots of LIBRARY, the rest with those of the
demo. Two to four of the scanners stay; a wire fence and six pipes of 20 mm are added. Each cell is
scanned twice with the same beams: with noise, mixed pixels and lost beams, and without any error.
The noisy scans are run and exported as mesh, with the default bound and with 50,000 triangles.

A true point is where a beam without error ends on a thing that stands still. Its beam *met* it if
the noisy scan has it within three standard deviations of its place; other beams were lost, mixed,
or slid along a grazing face, and are counted apart. Prints one line of CSV for each mesh. Needs
numpy, open3d and pye57.
"""

import argparse
import json
import random
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import open3d as o3d
import pye57

sys.path.insert(0, str(Path(__file__).parent))
from figures import Figures  # noqa: E402
from mesh_quality import distances, share_in_free, spaces  # noqa: E402

# Suites of `bench plant` and how many scanners stay.
SUITES = (("two", 2), ("hoses", 3), ("cells", 4), ("two", 2), ("joined", 3))
PIPE_RADIUS = 0.010
N_PIPES = 6
TRIANGLES = 50_000
# Three standard deviations of a range of the drawn scanners.
MET = 0.006
# How deep in free space area is counted by itself, metres.
DEEP = 0.005


def toml(table, path=""):
    """A scene as TOML: values, tables and arrays of tables."""

    def value(v):
        if isinstance(v, dict):
            return "{ " + ", ".join(f"{json.dumps(k)} = {value(x)}" for k, x in v.items()) + " }"
        return "[" + ", ".join(map(value, v)) + "]" if isinstance(v, list) else json.dumps(v)

    lines = []
    for key, own in table.items():
        is_list = isinstance(own, list) and own and isinstance(own[0], dict)
        for part in own if is_list else []:
            lines += [f"[[{key}]]"] + [f"{json.dumps(k)} = {value(v)}" for k, v in part.items()]
        if isinstance(own, dict):
            lines += [f"[{key}]"] + [f"{json.dumps(k)} = {value(v)}" for k, v in own.items()]
        elif not is_list:
            lines.insert(0, f"{json.dumps(key)} = {value(own)}")
    return "\n".join(lines) + "\n"


def child(args):
    """Runs a program; its processor seconds, wall seconds and peak MiB."""
    started = time.time()
    # A child of this process would inherit its peak of memory.
    call = ["/usr/bin/time", "-f", "%U %S %M", *map(str, args)]
    ended = subprocess.run(call, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if ended.returncode not in (0, 3):
        sys.exit(f"{' '.join(call)}: {ended.stderr}")
    user, system, peak = ended.stderr.split()[-3:]
    return float(user) + float(system), time.time() - started, int(peak) / 1024


def furnished(scene, n_scanners, draw):
    """Leaves some scanners, and adds pipes along the walls and a fence of wires."""
    draw.shuffle(scene["scanner"])
    scene["scanner"] = scene["scanner"][:n_scanners]
    for scanner in scene["scanner"]:
        scanner.pop("registration", None)
        scanner["range_bias"] = 0.0
    for robot in scene.get("robot", []):
        robot.pop("later", None)
    half = [0.5 * edge for edge in scene["hall"]["size"][:2]]
    high = scene["hall"]["size"][2]
    for k in range(N_PIPES):
        side, off = draw.randrange(4), draw.uniform(0.03, 0.35)
        along = 1 - side // 2
        across, sign = 1 - along, 1 if side % 2 else -1
        start, end = [0.0] * 3, [0.0] * 3
        start[across] = end[across] = sign * (half[across] - off)
        if k % 3 == 0:
            start[along] = end[along] = draw.uniform(-0.8, 0.8) * half[along]
            start[2], end[2] = 0.1, min(high, 4.0) - 0.2
        else:
            middle, long = draw.uniform(-0.5, 0.5) * half[along], draw.uniform(1.0, 2.5)
            start[along], end[along] = middle - long / 2, middle + long / 2
            start[2] = end[2] = draw.uniform(0.3, 2.6)
        anchors = [{"xyz": start}, {"xyz": end}]
        pipe = {"name": f"pipe {k}", "anchors": anchors, "radius": PIPE_RADIUS, "sag": 0.0}
        scene.setdefault("hose", []).append(pipe)
    y, x = half[1] - 0.7, draw.uniform(-0.4, 0.0) * half[0]
    fence = {"name": "added", "from": [x, y], "to": [x + 0.4 * half[0] + 1.0, y]}
    scene.setdefault("fence", []).append(fence | {"height": 2.0, "filling": "wires"})


def exact(scene):
    """The same scene and beams without any error."""
    for scanner in scene["scanner"]:
        for key in ("noise", "noise_per_metre", "jitter", "dropouts", "dark_dropouts"):
            scanner[key] = 0.0
        scanner.pop("mixed", None)


def scans(folder):
    """Points of each beam in the world, and whether it returned."""
    file = pye57.E57(str(folder / "scans.e57"))
    for k, scan in enumerate(json.load(open(folder / "truth/truth.json"))["scans"]):
        raw = file.read_scan_raw(k)
        w, x, y, z = scan["stated_pose"]["quat_wxyz"]
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        own = np.stack([raw[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
        yield own @ turn.T + scan["stated_pose"]["xyz"], raw["cartesianInvalidState"] == 0


def true_points(noisy, without, out):
    """True points on what stands still: place, whether met, whether labelled as moving, thing."""
    names = json.load(open(without / "truth/truth.json"))["objects"]
    parts = []
    for k, (measured, true) in enumerate(zip(scans(noisy), scans(without))):
        (at, is_there), (true_at, is_true) = measured, true
        kind, thing = (np.load(without / f"truth/labels/{k}.{w}.npy") for w in ("kind", "object"))
        said = np.full(len(at), 255, np.uint8)
        said[is_there] = np.load(out / f"labels/{k}.kind.npy")
        stands = (kind == 0) | (kind == 3)
        beams = np.flatnonzero(is_true)[stands]
        off = np.linalg.norm(at[beams] - true_at[beams], axis=1)
        met = is_there[beams] & (off <= MET)
        moves = np.isin(said[beams], (1, 2))
        parts.append((true_at[beams], met, moves, thing[stands]))
    columns = [np.concatenate(column) for column in zip(*parts)]
    return *columns, names


def measured(mesh, bound, truth):
    at, met, moves, thing, names = truth
    off = distances(mesh, at)
    far = off > bound
    has = lambda word: np.isin(thing, [k for k, n in enumerate(names) if word in n.lower()])
    pipes, fences = has("pipe "), has("fence")
    most = lambda which: round(float(off[which].max()) * 1e3, 2) if which.any() else ""
    share = lambda which: round(100 * float(far[which].mean()), 4) if which.any() else ""
    out = {
        "true_points": len(at),
        "met": int(met.sum()),
        "met_beyond": int((met & far).sum()),
        "of_these_said_to_move": int((met & far & moves).sum()),
        "met_farthest_mm": most(met),
        "met_and_still_farthest_mm": most(met & ~moves),
        "met_99_9_mm": round(float(np.percentile(off[met], 99.9)) * 1e3, 2),
        "not_met_beyond": int((~met & far).sum()),
    }
    for word, which in (("pipe", pipes), ("fence", fences)):
        out[f"{word}_points_met"] = int((which & met).sum())
        out[f"{word}_farthest_mm"] = most(which & met)
        out[f"{word}_beyond_percent"] = share(which & met)
    for k in np.unique(thing[met & far]):
        n = int(((thing == k) & met & far).sum())
        print(f"#   beyond: {n} of {names[k]!r}, {most((thing == k) & met)} mm", file=sys.stderr)
    return out


def cell(args, k, figures):
    suite, n_scanners = SUITES[k % len(SUITES)]
    draw = random.Random(args.seed * 1000 + k)
    dir = args.work / f"cell-{k}"
    shutil.rmtree(dir, ignore_errors=True)
    real = k % 2 == 1 and args.robots
    quiet = ["--progress", "none"]
    library = ["--robots", args.robots] if real else []
    call = [args.program, "bench", "plant", "--suite", suite, "--cases", 1, "--first", k]
    child([*call, "--seed", args.seed, "--keep", "--out", dir / "drawn", *library, *quiet])
    drawn = next((dir / "drawn").rglob("scene.toml"))
    scene = tomllib.loads(drawn.read_text())
    robots = args.robots if real else args.work / "demo/robots"
    furnished(scene, n_scanners, draw)
    shutil.rmtree(dir / "drawn")
    for name in ("noisy", "exact"):
        if name == "exact":
            exact(scene)
        (dir / f"{name}.toml").write_text(toml(scene))
        file = dir / f"{name}.toml"
        child([args.program, "simulate", file, "--robots", robots, "--out", dir / name, *quiet])
    out = dir / "out"
    call = [args.program, "run", dir / "noisy/scans.e57", "--robots", robots, "--out", out]
    child([*call, *quiet])
    truth = true_points(dir / "noisy", dir / "exact", out)
    found = [r["model"] for r in json.load(open(out / "result.json"))["robots"]]
    grids = list(spaces(str(out)))
    for budget in [[]] + ([["--triangles", TRIANGLES]] if args.budget else []):
        call = [args.program, "export", out, "--to", "mesh", "--mesh-format", "ply", *budget]
        cpu, wall, peak = child([*call, *quiet])
        report = json.load(open(out / "export/mesh/mesh.json"))
        mesh = o3d.io.read_triangle_mesh(str(out / "export/mesh/fixed.ply"))
        row = {
            "cell": k, "suite": suite, "robots": " ".join(found), "scanners": n_scanners,
            "budget": budget[1] if budget else "", "bound_mm": round(report["bound"] * 1e3, 2),
            "triangles": report["triangles"], "boxes": report["boxes"],
            "measured_farthest_mm": round(report["measured_maximum"] * 1e3, 2),
            **measured(mesh, report["bound"], truth),
            "area_in_free_percent": round(100 * share_in_free(mesh, grids), 3),
            "deeper_than_5_mm_percent": round(100 * share_in_free(mesh, grids, depth=DEEP), 3),
            "processor_s": round(cpu, 1), "wall_s": round(wall, 1), "peak_mib": round(peak),
        }  # fmt: skip
        figures.add(row)
    if not args.keep:
        shutil.rmtree(dir)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--robots", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cells", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--csv", type=argparse.FileType("w"), default=sys.stdout)
    parser.add_argument("--no-budget", dest="budget", action="store_false", help="the default bound only")
    parser.add_argument("--keep", action="store_true", help="keep scans and results")
    args = parser.parse_args()
    args.program, args.work = args.program.resolve(), args.work.resolve()
    args.robots = args.robots and args.robots.resolve()
    args.work.mkdir(parents=True, exist_ok=True)
    demo = args.work / "demo"
    if not demo.exists():
        child([args.program, "demo", "--out", demo, "--progress", "none"])
    figures = Figures(args.csv)
    for k in range(args.first, args.first + args.cells):
        cell(args, k, figures)


if __name__ == "__main__":
    main()
