#!/usr/bin/env python3
"""Fills the disk at random moments during a run. Checks the message of the run, that an earlier result stays complete, and that
the next run, with free space again, writes the same bytes as an undisturbed one. Needs Linux, and the right to mount.

    stillpoint bench throughput --points 5M --robots ROBOTS --keep --out hall
    scripts/full_disk.py --inputs hall/5000000/scans.las --scanners hall/5000000/scanners.toml --robots ROBOTS

The output folder lies on a file system in memory that is as large as a run needs. Somewhat into the run a file takes all room
that is left; it goes away before the next run."""

import random
import subprocess
import tempfile
import time
from pathlib import Path

from job import Job, manifest

# Exit codes of the program: all is well, and what was asked for does not fit.
WELL, NO_ROOM = 0, 5
# Room beside what a run leaves behind, of it: the result of the run before stays until the next is whole.
ROOM = 3.0


def fill(path):
    """Takes all room that is left."""
    with path.open("wb", buffering=0) as file:
        for n_bytes in (1 << 20, 1 << 12):
            try:
                while True:
                    file.write(bytes(n_bytes))
            except OSError:
                continue


def main():
    job = Job(__doc__, lambda parser: parser.add_argument("--cases", type=int, default=20))
    args, command = job.flags, job.command
    draw = random.Random(args.seed)

    def run(out, *more):
        return subprocess.run(command(out, *more), capture_output=True, text=True)

    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        begun = time.monotonic()
        assert run(whole).returncode == WELL, "an undisturbed run fails"
        length = time.monotonic() - begun
        n_bytes = sum(f.stat().st_size for f in whole.rglob("*") if f.is_file())
        wanted = manifest(whole)
        print(f"an undisturbed run takes {length:.1f} s and leaves {n_bytes / 2**20:.0f} MiB", flush=True)
        disk = Path(folder) / "disk"
        disk.mkdir()
        n_full = n_wrong = 0
        for case in range(args.cases):
            size = int(n_bytes * (1 + ROOM))
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", disk], check=True)
            try:
                out, ballast = disk / "out", disk / "ballast"
                # Every second case has an old result that must not be lost.
                if case % 2:
                    run(out, "--set", "fit.beam=90")
                process = subprocess.Popen(command(out), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                wait = draw.uniform(0.0, length)
                time.sleep(wait)
                fill(ballast)
                said = process.communicate()[1].strip()
                wrong = []
                if process.returncode not in (WELL, NO_ROOM):
                    wrong.append(f"code {process.returncode}")
                if process.returncode == NO_ROOM and str(disk) not in said:
                    wrong.append("the error does not say where")
                if case % 2 and subprocess.run([args.program, "verify", out], capture_output=True).returncode != WELL:
                    wrong.append("the result that was there is not whole")
                ballast.unlink()
                again = run(out)
                if again.returncode != WELL:
                    wrong.append(f"the next run fails: {again.stderr.strip()}")
                elif manifest(out) != wanted:
                    wrong.append("the next run has other bytes")
                n_full += process.returncode == NO_ROOM
                n_wrong += bool(wrong)
                last = said.splitlines()[-1] if said and process.returncode else "ended before"
                print(f"full after {wait:.1f} s: {last}; {', '.join(wrong) or 'as it should be'}", flush=True)
            finally:
                subprocess.run(["umount", disk], check=True)
        print(f"{args.cases} cases, {n_full} runs without room, {n_wrong} not as they should be")


if __name__ == "__main__":
    main()
