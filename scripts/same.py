#!/usr/bin/env python3
"""Runs two builds on the same jobs and compares every file of their results byte for byte.

The old build draws the scenes (the demo, halls, a rescan), so a change of the generator of scenes
does not matter. The new build runs each job with one thread and with two. Words may differ:
sentences, names of the build, digests and times are left aside, in JSON files by key.

    scripts/same.py OLD NEW --work DIR [--shared ../shared] [--halls 3] [--seed 60]
"""

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

# Keys of JSON files whose values are words, or name the build and its files.
WORDS = {
    "version", "reasons", "why", "notes", "note", "advice", "digest", "digests", "told", "left_out", "said",
    "warnings", "warning", "words", "cause", "sentence", "text", "base", "inputs", "robots_dir", "program",
}  # fmt: skip
# Folders and files that hold the work of one build, words, or pictures with words.
ASIDE = ("store/", "pictures/", "manifest.json", "plant.bin", "report.", "robots.xml", "junit")


def jobs(flags):
    """Name, scans, robot library, scanners and base (for a rescan) of each job."""
    work = flags.work / "drawn"
    old = flags.old
    demo = work / "demo"
    if not demo.is_dir():
        call([old, "demo", "--out", demo, "--threads", "2"])
    yield "demo", [demo / "scans/scans.e57"], demo / "robots", None, None
    yield "demo-las", [demo / "scans/scans.las"], demo / "robots", demo / "scans/scanners.toml", None
    halls = work / "halls"
    if not halls.is_dir():
        call([old, "bench", "plan", "--halls", flags.halls, "--seed", flags.seed, "--robots", demo / "robots", "--keep", "--out", halls, "--threads", "2"])
    for scans in sorted([*halls.rglob("scans.e57"), *halls.rglob("scans.las")]):
        hall = scans.relative_to(halls).parts[0]
        scanners = scans.with_name("scanners.toml")
        yield f"hall-{hall}", [scans], halls / hall / "robots", scanners if scans.suffix == ".las" else None, None
    pairs = work / "rescans"
    if not pairs.is_dir():
        call([old, "bench", "rescan", "--cases", 2, "--n-robots", 3, "--scans", 4, "--step", 0.2, "--seed", flags.seed, "--keep", "--out", pairs, "--threads", "2"])
    for then in sorted(pairs.rglob("then*/scans.e57")):
        now = Path(str(then).replace("then", "now"))
        yield f"rescan-{then.relative_to(pairs).parts[0]}", [now], demo / "robots", None, [then]
    if flags.shared.is_dir():
        scans, robots = flags.shared / "scans", flags.shared / "robots"
        yield "library", [demo / "scans/scans.e57"], robots, None, None
        yield "pump", sorted((scans / "e57-real-pump").glob("*.e57")), robots, None, None
        yield "corridor", [scans / "kurt3d-corridor/kurt_2scans.ptx"], demo / "robots", None, None
        for laz in sorted((scans / "robot-cell-covered").glob("*.laz"))[:2]:
            yield f"covered-{laz.stem}", [laz], scans / "robot-urdf", None, None
        for laz in sorted(scans.glob("robot-*7-*/frame_00.laz")):
            yield f"frame-{laz.parent.name}", [laz], scans / "robot-urdf", None, None
    else:
        print(f"{flags.shared} is not there: real scans and the large library are left out")


def call(line):
    """Runs a command; its exit code and the end of what it said."""
    done = subprocess.run([str(a) for a in line], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        print(f"exit {done.returncode}: {' '.join(str(a) for a in line)}\n{done.stderr[-800:]}", file=sys.stderr)
    return done.returncode


def answer(program, job, out, threads):
    """The folder with a build's answer to a job, and its exit code."""
    _, inputs, robots, scanners, base = job
    shutil.rmtree(out, ignore_errors=True)
    given = ["--robots", robots, *(["--scanners", scanners] if scanners else [])]
    common = ["--threads", threads, "--progress", "none"]
    if base is None:
        return call([program, "run", *inputs, *given, "--out", out, *common])
    first = out.with_name(out.name + "-base")
    shutil.rmtree(first, ignore_errors=True)
    code = call([program, "run", *base, *given, "--out", first, *common])
    return (code, call([program, "rescan", "--base", first, *inputs, "--out", out, *common]))


def files(out, aside):
    """Files of a result that are compared, by name."""
    found = (p for p in sorted(out.rglob("*")) if p.is_file())
    named = {p.relative_to(out).as_posix(): p for p in found}
    return {name: path for name, path in named.items() if not any(part in name for part in (*ASIDE, *aside))}


def without_words(value):
    """A JSON value without what is words."""
    if isinstance(value, dict):
        return {k: without_words(v) for k, v in value.items() if k not in WORDS}
    return [without_words(v) for v in value] if isinstance(value, list) else value


def same(a, b):
    if a.read_bytes() == b.read_bytes():
        return True
    if a.suffix != ".json":
        return False
    return without_words(json.loads(a.read_text())) == without_words(json.loads(b.read_text()))


def compare(old, new, aside):
    """What differs between two results, and how many files were compared."""
    a, b = files(old, aside), files(new, aside)
    if not a:
        return ["no file of the old build to compare"], 0
    wrong = [f"only in one of them: {name}" for name in sorted(a.keys() ^ b.keys())]
    wrong += [name for name in sorted(a.keys() & b.keys()) if not same(a[name], b[name])]
    return wrong, len(a)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--shared", type=Path, default=Path("../shared"))
    parser.add_argument("--halls", type=int, default=3)
    parser.add_argument("--seed", type=int, default=60)
    parser.add_argument("--only", help="jobs whose names begin so")
    parser.add_argument("--aside", nargs="*", default=[], help="files that are meant to differ, by a part of their names")
    flags = parser.parse_args()
    n_wrong = 0
    for job in jobs(flags):
        if flags.only and not job[0].startswith(flags.only):
            continue
        old = flags.work / "old" / job[0]
        kept = flags.work / "old" / f"{job[0]}.code"
        if not kept.is_file():
            old.parent.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(answer(flags.old, job, old, 2)))
        code = json.loads(kept.read_text())
        for threads in (1, 2):
            new = flags.work / "new" / job[0]
            new.parent.mkdir(parents=True, exist_ok=True)
            again = json.loads(json.dumps(answer(flags.new, job, new, threads)))
            wrong, n = compare(old, new, flags.aside)
            if again != code:
                wrong.append(f"exit {code} before, {again} now")
            n_wrong += len(wrong)
            print(f"{job[0]}, {threads} threads: {n} files, {'same' if not wrong else ', '.join(wrong[:8])}", flush=True)
    print("nothing differs" if n_wrong == 0 else f"{n_wrong} differ")
    sys.exit(n_wrong > 0)


if __name__ == "__main__":
    main()
