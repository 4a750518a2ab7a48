#!/usr/bin/env python3
"""Measures what a new user waits for and what a result takes on disk, and prints the table of the guide (src/guide/before_and_now.md).

  scripts/sizes.py target/release/stillpoint [--before PROGRAM] [--install] [--folder FOLDER]

Each program is taken from its first run, the demo, to a result of the demo's E57 file, plain and with --lean. `--before` adds a column
for an earlier program. `--install` also clones the repository into FOLDER and times `cargo install --path .` there, with no library
built: minutes on a quiet machine. FOLDER (else a temporary one) needs 3 GB; all that is made there is removed.

Processor time is that of the program and its children, user and system; times by the clock count what else the machine does.
"""
import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def timed(command, **more):
    """Runs a command; seconds by the clock and of processors, and the greatest memory of any child so far, bytes."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **more)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.monotonic() - start, cpu


def size(path):
    """Bytes of all files in a folder; a file with two names counts once. Loaded models do not depend on the scans."""
    if path.is_file():
        return path.stat().st_size
    files = {}
    for file in path.rglob("*"):
        if file.is_file() and not file.is_symlink() and path / "store/models" not in file.parents:
            files[file.stat().st_ino] = file.stat().st_size
    return sum(files.values())


def knows_lean(program):
    return "--lean" in subprocess.run([program, "run", "--help"], capture_output=True, text=True, check=True).stdout


def measured(program, folder):
    """Rows of one program: what, and its value."""
    demo, lean = folder / "demo", folder / "lean"
    clock, cpu = timed([program, "demo", "--out", demo])
    scans = demo / "scans/scans.e57"
    rows = {
        "size of the program": f"{program.stat().st_size / 1e6:.1f} MB",
        "first run, `demo`: by the clock": f"{clock:.0f} s",
        "first run, `demo`: of processors": f"{cpu:.0f} s",
        f"result of an E57 file of {scans.stat().st_size / 1e6:.0f} MB": f"{size(demo / 'result') / 1e6:.0f} MB",
    }
    if knows_lean(program):
        timed([program, "run", scans, "--robots", demo / "robots", "--out", lean, "--lean"])
        rows["the same with `--lean`"] = f"{size(lean) / 1e6:.0f} MB"
    for path in (demo, lean):
        shutil.rmtree(path, ignore_errors=True)
    return rows


def installed(folder):
    """Seconds of `cargo install --path .` in a fresh clone, by the clock and of processors."""
    clone, root = folder / "clone", folder / "root"
    subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
    own = {**os.environ, "CARGO_TARGET_DIR": str(folder / "target")}
    clock, cpu = timed(["cargo", "install", "--path", ".", "--root", root], cwd=clone, env=own)
    for path in (clone, root, folder / "target"):
        shutil.rmtree(path, ignore_errors=True)
    return f"{clock // 60:.0f} min {clock % 60:.0f} s by the clock, {cpu / 60:.0f} min of processors"


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("program", type=Path)
    args.add_argument("--before", type=Path)
    args.add_argument("--install", action="store_true")
    args.add_argument("--folder", type=Path)
    args = args.parse_args()
    with tempfile.TemporaryDirectory(dir=args.folder) as folder:
        folder = Path(folder)
        before = measured(args.before.resolve(), folder) if args.before else {}
        now = measured(args.program.resolve(), folder)
        if args.install:
            now["`cargo install --path .` from a fresh clone"] = installed(folder)
    print("| what | before | now |\n| --- | --- | --- |" if before else "| what | now |\n| --- | --- |")
    for what, value in now.items():
        print(f"| {what} | {before.get(what, '–')} | {value} |" if before else f"| {what} | {value} |")
    print(f"\n{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f} at the end", file=sys.stderr)


if __name__ == "__main__":
    main()
