#!/usr/bin/env python3
"""Runs that are killed at random moments, again and again, until one ends: how much work that takes beside one run that
nobody disturbs, and whether the outputs are the same bytes.

    stillpoint bench throughput --points 20M --robots ROBOTS --keep --out hall
    scripts/kills.py --inputs hall/20000000/scans.las --scanners hall/20000000/scanners.toml --robots ROBOTS --kills 200

Each chain begins with an empty folder. Its runs are killed (SIGKILL) after a random time, evenly drawn from the length of an
undisturbed run, until one of them ends before. Work is the time that all runs of a chain took."""

import json
import random
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

    whole = []
    for k in range(3):
        out = folder / "whole"
        shutil.rmtree(out, ignore_errors=True)
        begun = time.monotonic()
        run = start(out)
        if run.wait() != 0:
            raise SystemExit(run.stderr.read().decode())
        whole.append(time.monotonic() - begun)
    length, wanted = statistics.median(whole), manifest(folder / "whole")
    print(f"an undisturbed run takes {length:.1f} s (of {len(whole)}: {min(whole):.1f} to {max(whole):.1f})", flush=True)

    n_kills, chains = 0, []
    rows = (folder / "kills.jsonl").open("w")
    while n_kills < args.kills:
        out = folder / "killed"
        shutil.rmtree(out, ignore_errors=True)
        work, lives = 0.0, []
        while True:
            life = draw.uniform(0.0, length)
            begun = time.monotonic()
            run = start(out)
            try:
                code = run.wait(timeout=life)
            except subprocess.TimeoutExpired:
                run.kill()
                run.wait()
                code = None
                n_kills += 1
            spent = time.monotonic() - begun
            work += spent
            lives.append(round(spent, 3))
            if code is not None:
                break
        is_right = code == 0 and manifest(out) == wanted
        chains.append((work / length, is_right))
        rows.write(json.dumps({"lives": lives, "work": work / length, "code": code, "same": is_right}) + "\n")
        rows.flush()
        print(f"{n_kills} kills: {len(lives)} runs, work {work / length:.2f}, {'same bytes' if is_right else 'OTHER BYTES'}", flush=True)
        if code != 0:
            print(run.stderr.read().decode())
    works = sorted(work for work, _ in chains)
    wrong = sum(not right for _, right in chains)
    print(
        f"{n_kills} kills in {len(chains)} chains: work of a chain, median {statistics.median(works):.2f}, "
        f"90 % {works[int(0.9 * (len(works) - 1))]:.2f}, largest {works[-1]:.2f} of one run; {wrong} with other bytes"
    )


if __name__ == "__main__":
    main()
