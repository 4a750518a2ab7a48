#!/usr/bin/env python3
"""Measures the Python package, which must be installed, on a folder of the demo.

    python -m stillpoint demo --out demo --beams 12000000      # about 45 million points
    scripts/python_speed.py demo                               # opens and filters the result
    scripts/python_speed.py demo --fit 3 --program stillpoint  # arrays against files, in turns

The first part says how long it takes to open a result and to count what its masks say, in a new process
and with files that the system may have cached, and how much memory that process takes. The second runs
`fit` on the points of scans.las in memory and the program on scans.las, with an output folder that is
new each time; of both it takes the times that stages state until the fits are there, and the whole.
"""

import argparse
import pathlib
import resource
import subprocess
import sys
import tempfile
import time
import tomllib

import numpy as np

import stillpoint


def opened(out):
    """Seconds to open a result and to filter all of its masks."""
    start = time.perf_counter()
    result = stillpoint.Result(out)
    n = moving = of_first = 0
    for scan in result.scans:
        labels = result.labels(scan)
        n += len(labels.kind)
        moves = labels.moving()
        moving += int(np.count_nonzero(moves))
        of_first += int(np.count_nonzero(labels.robot == 0))
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{n:,} points opened and filtered in {seconds:.3f} s: {moving:,} move, {of_first:,} of R1; "
          f"peak of the process {peak:.0f} MiB, mapped pages included")


def points(out, kind):
    start = time.perf_counter()
    found = stillpoint.Result(out).points(kind)
    print(f"{len(found):,} points of kind {kind} as arrays in {time.perf_counter() - start:.2f} s")


def compared(demo, turns, program):
    """`fit` on arrays against the program on the file of the same points, in turns."""
    import laspy

    las = laspy.read(demo / "scans/scans.las")
    scanners = tomllib.loads((demo / "scans/scanners.toml").read_text())["scanner"]
    ids, xyz = np.asarray(las.point_source_id), np.asarray(las.xyz)
    arrays = [xyz[ids == one["point_source_id"]] for one in scanners]
    models = [path for path in sorted((demo / "robots").iterdir()) if path.is_dir()]
    positions = [one["position"] for one in scanners]
    for turn in range(turns):
        start, cpu = time.perf_counter(), time.process_time()
        stillpoint.fit(arrays, positions, models, threads=2)
        mine = (time.perf_counter() - start, time.process_time() - cpu)
        with tempfile.TemporaryDirectory(dir=demo) as folder:
            line = [program, "run", demo / "scans/scans.las", "--robots", demo / "robots",
                    "--scanners", demo / "scans/scanners.toml", "--out", f"{folder}/out",
                    "--threads", "2", "--progress", "json"]
            start = time.perf_counter()
            done = subprocess.run(line, capture_output=True, text=True, check=True)
            took = time.perf_counter() - start
        seconds, cpu = until_fits(done.stderr)
        print(f"turn {turn + 1}: fit {mine[0]:.2f} s ({mine[1]:.2f} s of processors); program {took:.2f} s, "
              f"until the fits were there {seconds:.2f} s ({cpu:.2f} s of processors)", flush=True)


def until_fits(lines):
    """Seconds, and processor seconds, of the stages of a run whose work `fit` does as well."""
    import json

    mine = {"robots", "ingest", "store", "surfaces", "fit", "tools", "calibrate"}
    ends = [json.loads(line) for line in lines.splitlines() if line.startswith("{")]
    ends = [one for one in ends if one.get("event") == "stage_end" and one["stage"] in mine]
    return [sum(one[name] for one in ends) for name in ("seconds", "cpu_seconds")]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("demo", type=pathlib.Path)
    parser.add_argument("--fit", type=int, default=0, metavar="TURNS")
    parser.add_argument("--program", default="stillpoint")
    given = parser.parse_args()
    if given.fit:
        compared(given.demo, given.fit, given.program)
        return 0
    opened(given.demo / "result")
    opened(given.demo / "result")
    points(given.demo / "result", "link")
    return 0


if __name__ == "__main__":
    sys.exit(main())
