"""A job and its command lines."""

import json
import os
import subprocess
from dataclasses import asdict, dataclass, field
from typing import Any

#: Something that happened: ``{"event": "shard", ...}``; every event is small and can be written as JSON.
Event = dict[str, Any]

#: Exit code of the program where a result or shard is done in part.
PARTIAL = 3
#: Exit codes of a shard after which another attempt cannot help: bad input, over a limit, interrupted. Usage is none: a
#: network disk may show what another machine has made a little later, and until then a shard is not known or not ready.
FINAL = {4: "bad input", 5: "over a resource limit", 130: "interrupted"}


class JobFailed(RuntimeError):
    """A job that cannot be done; ``code`` is the exit code of the program, as in its guide."""

    def __init__(self, message: str, code: int = 1):
        super().__init__(message)
        self.code = code


class ShardFailed(JobFailed):
    """A shard that failed in all attempts; ``shard`` is its entry in the list."""

    def __init__(self, shard: Event, why: str, code: int = 1):
        super().__init__(f"shard {shard['id']} ({shard['what']}) failed: {why}", code)
        self.shard = shard


@dataclass(frozen=True)
class Job:
    """What a plant run does, and how."""

    inputs: list[str]
    robots: str
    out: str
    address: str | None = None
    program: str = "stillpoint"
    flags: list[str] = field(default_factory=list)
    attempts: int = 4
    keep_going: bool = False
    folder: str = field(default_factory=os.getcwd)

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Job":
        return cls(**json.loads(text))

    def command(self, *what: str) -> list[str]:
        """The command line of a step of this job. Paths stay as they were given, since results name their inputs."""
        line = [self.program, *what, *self.inputs, "--robots", self.robots, "--out", self.out]
        line += ["--keep-going"] if self.keep_going else []
        return [*line, *self.flags, "--progress", "none"]

    def shards(self) -> Event:
        """The list of shards as it is now."""
        done = subprocess.run([*self.command("shards"), "--json"], cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            raise JobFailed(last_lines(done.stderr), done.returncode)
        return json.loads(done.stdout)

    def leave_out(self, shard: Event, why: str) -> bool:
        """Records that a shard cannot be made; false where the result cannot do without it."""
        line = self.command("shard", shard["id"]) + ["--leave-out", why]
        return subprocess.run(line, cwd=self.folder, capture_output=True).returncode == PARTIAL


def last_lines(text: str, most: int = 2000) -> str:
    """The end of what a program said, without ``error:`` before it."""
    text = text.strip()
    text = text if len(text) <= most else "..." + text[-most:]
    return text.removeprefix("error: ") or "it said nothing"
