#!/usr/bin/env python3
"""Kills runs at random moments until one ends. Measures the work of all of them relative to one undisturbed run, and compares
the outputs byte for byte.

    stillpoint bench throughput --points 20M --robots ROBOTS --keep --out hall
    scripts/kills.py --inputs hall/20000000/scans/scans.las --scanners hall/20000000/scans/scanners.toml --robots ROBOTS --kills 200

Each chain begins with an empty folder. Its runs are killed (SIGKILL) after a random time, evenly drawn from the length of an
undisturbed run, until one of them ends before. Work is what all runs of a chain took, by the clock and in processor time: the one feels whatever
else the machine does."""

import json
import random
import resource
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

from job import Job, manifest


def main():
    def add_flags(parser):
        parser.add_argument("--kills", type=int, default=200)
        parser.add_argument("--out", type=Path, help="where rows and results go (else a temporary folder)")

    job = Job(__doc__, add_flags)
    args = job.flags
    draw = random.Random(args.seed)
    folder = args.out or Path(tempfile.mkdtemp(prefix="kills-"))
    folder.mkdir(parents=True, exist_ok=True)

    def start(out):
        return subprocess.Popen(job.command(out), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def finish(out, life=None):
        """Runs into `out`, for `life` seconds at most: exit code (none where it was killed), seconds, processor seconds."""
        begun, before = time.monotonic(), cpu()
        run = start(out)
        try:
            code = run.wait(timeout=life)
        except subprocess.TimeoutExpired:
            run.kill()
            run.wait()
            code = None
        if code:
            print(run.stderr.read().decode())
        return code, time.monotonic() - begun, cpu() - before

    whole = []
    for k in range(3):
        shutil.rmtree(folder / "whole", ignore_errors=True)
        code, *spent = finish(folder / "whole")
        if code != 0:
            raise SystemExit("the undisturbed run failed")
        whole.append(spent)
    length, length_cpu = (statistics.median(column) for column in zip(*whole))
    wanted = manifest(folder / "whole")
    print(f"an undisturbed run takes {length:.1f} s, {length_cpu:.1f} s of processors (medians of {len(whole)})", flush=True)

    n_kills, chains = 0, []
    rows = (folder / "kills.jsonl").open("w")
    while n_kills < args.kills:
        out = folder / "killed"
        shutil.rmtree(out, ignore_errors=True)
        lives, code = [], None
        while code is None:
            code, *spent = finish(out, draw.uniform(0.0, length))
            lives.append(spent)
        n_kills += len(lives) - 1
        work, work_cpu = (sum(column) for column in zip(*lives))
        chain = {
            "kills": len(lives) - 1,
            "work": work / length,
            "work_cpu": work_cpu / length_cpu,
            "same": code == 0 and manifest(out) == wanted,
            "lives": [round(life[0], 3) for life in lives],
        }
        chains.append(chain)
        rows.write(json.dumps(chain) + "\n")
        rows.flush()
        same = "same bytes" if chain["same"] else "OTHER BYTES"
        print(f"{n_kills} kills: {len(lives)} runs, work {chain['work']:.2f}, cpu {chain['work_cpu']:.2f}, {same}", flush=True)
    wrong = sum(not chain["same"] for chain in chains)
    print(f"{n_kills} kills in {len(chains)} chains, {wrong} with other bytes; work in parts of one run:")
    for name, some in [("all", chains)] + [(f"{n} kills", [c for c in chains if c["kills"] == n]) for n in range(1, 9)]:
        if some:
            print(f"  {name}, {len(some)} chains: " + ", ".join(words(some, key) for key in ("work", "work_cpu")))


def cpu():
    """Processor seconds of all programs that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def words(chains, key):
    works = sorted(chain[key] for chain in chains)
    tenth = works[int(0.9 * (len(works) - 1))]
    return f"{key} median {statistics.median(works):.2f}, 90 % {tenth:.2f}, largest {works[-1]:.2f}"


if __name__ == "__main__":
    main()
