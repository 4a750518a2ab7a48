"""The job that a script runs repeatedly: its flags, its command line, and the digests of its result."""

import argparse
import hashlib
from pathlib import Path


class Job:
    """A main job, as flags give it."""

    def __init__(self, about, add_flags):
        parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.add_argument("--program", default="target/release/stillpoint")
        parser.add_argument("--inputs", nargs="+", required=True, type=Path)
        parser.add_argument("--robots", required=True, type=Path)
        parser.add_argument("--scanners", type=Path)
        parser.add_argument("--seed", type=int, default=1)
        add_flags(parser)
        self.flags = parser.parse_args()

    def command(self, out, *more):
        """Its command line, into a folder."""
        flags = self.flags
        line = [flags.program, "run", *map(str, flags.inputs), "--robots", str(flags.robots), "--out", str(out)]
        line += ["--scanners", str(flags.scanners)] if flags.scanners else []
        return [*line, "--progress", "none", *more]


def manifest(out):
    """The digest of a result's list of outputs and their digests."""
    return hashlib.sha256((out / "manifest.json").read_bytes()).hexdigest()
