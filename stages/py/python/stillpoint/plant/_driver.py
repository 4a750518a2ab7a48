"""The driver: hands ready shards to Ray and takes note of their ends. It keeps nothing that a new driver would need: Ray
ends a driver that has lost the head without an exception and without ``finally``."""

import json
import os
import time
from concurrent.futures import Future, ThreadPoolExecutor

from . import _task
from ._job import FINAL, PARTIAL, Event, Job, JobFailed, ShardFailed, last_lines

#: Seconds after which a look is taken at what else could be started.
LOOK = 1.0
#: Seconds before the next attempt of a shard that has failed, for each failure so far.
BACK_OFF = 1.0
#: Kinds of shards that join what others have made, and run alone: they get all threads of a node.
JOINS = ("ground", "robots", "gather")
#: Kinds of shards that wait for the disk: they get more threads than cores, so that one computes while others wait.
WAITS = ("files",)
THREADS_OF_WAITS = 3
#: Share of a node's memory that one shard may ask for, so that a large estimate never waits for ever.
MEMORY = 0.9


def drive(job: Job) -> int:
    """Does a job, and writes events to standard output, the last one with the end."""
    # The first list loads the library, and the engine takes seconds to start: both at once.
    first = ThreadPoolExecutor(1).submit(job.shards)
    try:
        import ray

        ray.init(address=job.address, logging_level="ERROR", log_to_driver=False, include_dashboard=None)
        outcome = _Driver(job, ray, first).run()
        _say({"event": "end", "code": PARTIAL if outcome["partial"] else 0, **outcome})
    except JobFailed as error:
        shard = error.shard if isinstance(error, ShardFailed) else None
        _say({"event": "end", "code": error.code or 1, "why": str(error), "shard": shard})
    except ConnectionError as error:
        _say({"event": "lost", "why": str(error).splitlines()[0]})
    return 0


def _say(event: Event) -> None:
    print(json.dumps(event), flush=True)


class _Driver:
    def __init__(self, job: Job, ray, first: "Future[Event]"):
        ray.cloudpickle.register_pickle_by_value(_task)
        self.job, self.ray = job, ray
        self.make = ray.remote(_task.make)
        self.shards: dict[str, Event] = {}
        self.done: set[str] = set()
        self.running: dict = {}
        self.n_failed: dict[str, int] = {}
        self.not_before: dict[str, float] = {}
        self.left_out: list[str] = []
        self.finished = False
        self.first = first

    def run(self) -> Event:
        """Runs until the result is there."""
        self._take(self.first.result())
        outcome = {"summary": "the result is there", "partial": bool(self.left_out)}
        while not self.finished:
            self._start()
            if not self.running:
                self._wait()
                continue
            ended, _ = self.ray.wait(list(self.running), num_returns=1, timeout=LOOK)
            for reference in ended:
                outcome = self._end(reference) or outcome
        return outcome

    def _wait(self) -> None:
        """Waits until a shard that has failed may be tried again; where there is none, the job cannot go on."""
        if not any(id in self.not_before for id in self.shards if id not in self.done):
            raise JobFailed("no shard of the job can be made: list them with `stillpoint shards`")
        time.sleep(LOOK / 4)

    def _list(self) -> None:
        """Takes the list of shards from the store."""
        self._take(self.job.shards())

    def _take(self, listed: Event) -> None:
        """Takes note of a list of shards."""
        self.shards = {shard["id"]: shard for shard in listed["shards"]}
        self.done |= {id for id, shard in self.shards.items() if shard["state"] == "done"}
        self.finished, self.left_out = listed["finished"], listed["left_out"]
        _say({"event": "list", "finished": self.finished, "done": len(self.done & set(self.shards)),
              "shards": len(self.shards), "seconds_left": sum(s["seconds"] for s in self._open())})

    def _open(self) -> list[Event]:
        return [shard for id, shard in self.shards.items() if id not in self.done]

    def _start(self) -> None:
        """Starts all shards that are ready, the longest first."""
        started = {shard["id"] for shard, *_ in self.running.values()}
        now = time.monotonic()
        ready = [s for s in self._open() if s["id"] not in started and self.done.issuperset(s["needs"])]
        ready = [s for s in ready if self.not_before.get(s["id"], now) <= now]
        if not ready:
            return
        nodes = [node["Resources"] for node in self.ray.nodes() if node["Alive"] and node["Resources"].get("CPU")]
        cores = [int(node["CPU"]) for node in nodes] or [1]
        memory = min((node.get("memory", 0) for node in nodes), default=0)
        # Few shards get several threads each.
        share = max(1, min(max(cores), sum(cores) // (len(ready) + len(started))))
        # Ray does not keep the order of tasks that ask for different amounts of memory, and the longest shards must not
        # come last: it gets those that have a place, and one a node that waits for its place there.
        room = sum(cores) + len(cores) - sum(cpus for *_, cpus in self.running.values())
        for shard in sorted(ready, key=lambda shard: (-shard["seconds"], shard["id"])):
            if room <= 0:
                break
            cpus = max(cores) if shard["kind"] in JOINS else share
            room -= cpus
            self._submit(shard, cpus, int(min(shard["memory_bytes"], MEMORY * memory)))

    def _submit(self, shard: Event, cpus: int, memory: int) -> None:
        threads = cpus * (THREADS_OF_WAITS if shard["kind"] in WAITS else 1)
        line = self.job.command("shard", shard["id"]) + ["--threads", str(threads)]
        # Ray sets this to the number of processors that a task asks for; settings of the program stay the caller's.
        own = {name: value for name, value in os.environ.items() if name.startswith("STILLPOINT_")}
        environment = {"PATH": os.environ.get("PATH", ""), "HOME": os.environ.get("HOME", "/"), **own}
        options = {"num_cpus": cpus, "max_retries": self.job.attempts - 1, "name": f"{shard['id']}: {shard['what']}"}
        options |= {"memory": memory} if memory > 0 else {}
        reference = self.make.options(**options).remote(line, self.job.folder, environment)
        self.running[reference] = (shard, time.monotonic(), cpus)

    def _end(self, reference) -> Event | None:
        """Takes note of the end of a task; returns the outcome of the job where it was the last."""
        shard, begun, _ = self.running.pop(reference)
        try:
            ended = self.ray.get(reference)
        except self.ray.exceptions.RayError as error:
            # Ray has tried as often as it may.
            return self._failed(shard, f"{type(error).__name__}: {str(error).splitlines()[0]}", 1, is_final=True)
        code = ended["code"]
        if code not in (0, PARTIAL):
            return self._failed(shard, last_lines(ended["said"]), code, code in FINAL)
        self.done.add(shard["id"])
        _say({"event": "shard", "id": shard["id"], "kind": shard["kind"], "what": shard["what"], "code": code,
              "seconds": round(ended["seconds"], 3), "processor": round(ended["processor"], 3), "waited": round(time.monotonic() - begun - ended["seconds"], 3),
              "done": len(self.done & set(self.shards)), "shards": len(self.shards),
              "seconds_left": sum(s["seconds"] for s in self._open())})
        if shard["kind"] == "gather":
            self.finished = True
            summary = ended["told"].partition("\n")[2].strip()
            return {"summary": summary or "the result is there", "partial": code == PARTIAL or bool(self.left_out)}
        if shard["opens"] or code == PARTIAL:
            self._list()
        return None

    def _failed(self, shard: Event, why: str, code: int, is_final: bool) -> None:
        """Tries a shard again; one that fails for good is left out, or ends the job."""
        n = self.n_failed[shard["id"]] = self.n_failed.get(shard["id"], 0) + 1
        _say({"event": "failure", "id": shard["id"], "what": shard["what"], "code": code, "attempt": n, "why": why})
        if not is_final and n < self.job.attempts:
            self.not_before[shard["id"]] = time.monotonic() + n * BACK_OFF
            return
        if self.job.keep_going and self.job.leave_out(shard, why):
            self._list()
            return
        raise ShardFailed(shard, why, code if code in FINAL else 1)
