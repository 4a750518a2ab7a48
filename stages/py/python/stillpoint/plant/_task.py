"""What runs on a node: one process of the program for one shard. This file is sent to the nodes as it is, so it imports
nothing but the standard library."""

import resource
import subprocess
import tempfile
import time

#: Seconds between looks at the process: waiting for it in one call could not be cancelled.
LOOK = 0.01


def make(line: list[str], folder: str, environment: dict[str, str]) -> dict:
    """Runs a command line; returns its exit code, the end of what it said, and the seconds that it took, by the clock and
    of processors."""
    begun, before = time.monotonic(), _processor()
    with tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as told:
        # The process stays in the group of the worker, so that Ray ends both together.
        process = subprocess.Popen(line, cwd=folder, env=environment or None, stdout=told, stderr=said)
        try:
            while process.poll() is None:
                time.sleep(LOOK)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        texts = [_end(file) for file in (told, said)]
    return {"code": process.returncode, "told": texts[0], "said": texts[1], "seconds": time.monotonic() - begun,
            "processor": _processor() - before}


def _processor() -> float:
    """Processor time of all processes that this one has started and that have ended, seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _end(file, most: int = 4000) -> str:
    size = file.seek(0, 2)
    file.seek(max(0, size - most))
    return file.read().decode(errors="replace")
