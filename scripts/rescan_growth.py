#!/usr/bin/env python3
"""Times the rescan of one cell, alone and beside increasingly large parts of a plant, and prints a table.

    stillpoint bench rescan --cases 1 --seed 7 --keep --out CASE        # leaves CASE/700000/then and now
    stillpoint bench throughput --points 100M --out HALL                # leaves scans.las and scanners.toml
    scripts/rescan_growth.py --case CASE/700000 --beside HALL/.../scans [--beside ...] --robots LIBRARY --out DIR

What stands beside is moved by 300 m along x: its LAS header and the positions of its scanners say so. The cell and its new
scans are the same in all rows, so the rescan's time should be, too.
"""
import argparse
import json
import re
import shutil
import struct
import subprocess
import time
from pathlib import Path

SHIFT = 300.0  # metres
MAX_X, X_OFFSET = 179, 155  # places in a LAS header (LAS 1.4 R15, table 3)


def moved(beside: Path, out: Path) -> None:
    """A hall's scans, moved."""
    out.mkdir(parents=True)
    shutil.copyfile(beside / "scans.las", out / "beside.las")
    with open(out / "beside.las", "r+b") as file:
        for place in (X_OFFSET, MAX_X, MAX_X + 8):
            file.seek(place)
            (value,) = struct.unpack("<d", file.read(8))
            file.seek(place)
            file.write(struct.pack("<d", value + SHIFT))
    text = (beside / "scanners.toml").read_text()
    shift = lambda m: f"position = [{float(m[1]) + SHIFT}"
    (out / "scanners.toml").write_text(re.sub(r"position = \[([^,\]]+)", shift, text))


def timed(*command) -> float:
    started = time.monotonic()
    subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", type=Path, required=True)
    parser.add_argument("--beside", type=Path, action="append", default=[])
    parser.add_argument("--robots", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--program", default="stillpoint")
    parser.add_argument("--times", type=int, default=3, help="rescans of each plant")
    args = parser.parse_args()
    print("| points of the plant | whole run s | rescan s, least, middle and most | share |")
    print("| --- | --- | --- | --- |")
    for beside in [None, *args.beside]:
        place = args.out / "growth"
        shutil.rmtree(place, ignore_errors=True)
        inputs = [args.case / "then" / "scans.e57"]
        more = []
        if beside:
            moved(beside, place)
            inputs.append(place / "beside.las")
            more = ["--scanners", place / "scanners.toml"]
        base, again = place / "base", place / "again"
        whole = timed(args.program, "run", *inputs, *more, "--robots", args.robots, "--out", base)
        seconds = []
        for _ in range(args.times):
            shutil.rmtree(again, ignore_errors=True)
            new = args.case / "now" / "scans.e57"
            seconds.append(timed(args.program, "rescan", "--base", base, new, "--robots", args.robots, "--out", again))
        seconds.sort()
        result = json.loads((base / "result.json").read_text())
        n_points = sum(scan["n_points"] for scan in result["inputs"])
        middle = seconds[len(seconds) // 2]
        spread = f"{seconds[0]:.1f}, {middle:.1f}, {seconds[-1]:.1f}"
        print(f"| {n_points / 1e6:.1f} M | {whole:.1f} | {spread} | {100 * middle / whole:.1f} % |", flush=True)
        shutil.rmtree(place)


if __name__ == "__main__":
    main()
