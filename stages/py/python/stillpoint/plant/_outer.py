"""The loop around the driver: it starts another driver where the cluster was lost."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ._job import PARTIAL, Event, Job, JobFailed

#: Seconds before another driver starts.
PAUSE = 2.0


@dataclass(frozen=True)
class PlantRun:
    """How a job went."""

    #: The output folder.
    out: Path
    #: What the program said of the result.
    summary: str
    #: Whether something was left out, as the result states.
    partial: bool
    #: Number of shards that were made, and of failures that did not end the job.
    shards: int
    failures: int
    #: Number of drivers that were started: more than one where the cluster was lost.
    drivers: int
    #: Wall-clock time, seconds.
    seconds: float


def run(
    inputs: Sequence[str | os.PathLike],
    robots: str | os.PathLike,
    out: str | os.PathLike,
    *,
    address: str | None = None,
    program: str = "stillpoint",
    flags: Sequence[str] = (),
    attempts: int = 4,
    patience: float = 600.0,
    keep_going: bool = False,
    on_event: Callable[[Event], None] | None = None,
) -> PlantRun:
    """Finds the robots in scans and labels all points, on the machines of a Ray cluster that share a disk.

    ``address`` is that of the cluster's head (none: this machine alone); this process must run on a machine of the
    cluster. ``flags`` are further options of ``stillpoint run``. A shard that fails is tried ``attempts`` times. Where
    the cluster is lost, another driver is started for ``patience`` seconds without progress; it goes on with what the
    store of ``out`` lacks. ``on_event`` is called with each event, a small dictionary.

    Raises :class:`ShardFailed` with the name of a shard that failed for good (with ``keep_going``, only where the result
    cannot do without it), and :class:`JobFailed` for everything else that ends the job.
    """
    job = Job([os.fspath(i) for i in inputs], os.fspath(robots), os.fspath(out), address, program, list(flags), attempts,
              keep_going)
    tell = on_event or (lambda event: None)
    begun = progressed = time.monotonic()
    counts = {"shard": 0, "failure": 0}
    drivers = 0
    while True:
        drivers += 1
        end, has_progressed = _drive(job, tell, counts)
        if end is not None:
            break
        now = time.monotonic()
        progressed = now if has_progressed else progressed
        if now - progressed > patience:
            raise JobFailed(f"the cluster is lost, and has not come back within {patience:.0f} s; what was made is kept, "
                            "and the next start goes on from it")
        tell({"event": "restart", "driver": drivers + 1})
        time.sleep(PAUSE)
    if end["code"] not in (0, PARTIAL):
        raise _failure(end)
    return PlantRun(Path(out), end["summary"], end["code"] == PARTIAL, counts["shard"], counts["failure"], drivers,
                    time.monotonic() - begun)


def _drive(job: Job, tell: Callable[[Event], None], counts: dict[str, int]) -> tuple[Event | None, bool]:
    """Runs one driver: its last event, none where it was lost, and whether it has made a shard."""
    before = counts["shard"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([_place(), os.environ.get("PYTHONPATH", "")])}
    line = [sys.executable, "-m", "stillpoint.plant", "--drive", job.to_json()]
    process = subprocess.Popen(line, stdout=subprocess.PIPE, text=True,
                               env=environment)
    end = None
    try:
        for text in process.stdout:
            try:
                event = json.loads(text)
            except ValueError:
                continue
            if event.get("event") in counts:
                counts[event["event"]] += 1
            if event.get("event") == "end":
                end = event
            else:
                tell(event)
    finally:
        if process.poll() is None and end is None:
            process.terminate()
        process.wait()
    return end, counts["shard"] > before




def _place() -> str:
    """The folder from which this package is imported, for the driver."""
    return str(Path(__file__).resolve().parents[2])


def _failure(end: Event) -> JobFailed:
    from ._job import ShardFailed

    if end.get("shard"):
        error = ShardFailed(end["shard"], "", end["code"])
        error.args = (end["why"],)
        return error
    return JobFailed(end["why"], end["code"])
