"""The driver of a plant, with a small stand-in for the program and one for Ray: what is tried again, what is left out, what
ends a job, and what happens where the cluster is lost."""

import json
import os
import stat
import sys
import textwrap
import types

import pytest

from stillpoint import plant
from stillpoint.plant import _driver, _task
from stillpoint.plant._job import Job

#: A job of two inputs with a store of empty files; `trouble.json` says how shards fail.
PROGRAM = """
    #!{python}
    import json, os, signal, sys
    what, words = sys.argv[1], sys.argv[2:]
    out = words[words.index("--out") + 1]
    os.makedirs(out, exist_ok=True)
    at = lambda name: os.path.join(out, name)
    trouble = json.load(open(at("trouble.json"))) if os.path.exists(at("trouble.json")) else {{}}
    done = lambda id: os.path.exists(at(id)) or os.path.exists(at(id + ".left"))
    def shard(id, needs=(), opens=False):
        state = "done" if done(id) else "ready" if all(map(done, needs)) else "waiting"
        return dict(id=id, kind=id.split("-")[0], what="work of " + id, inputs=[], needs=list(needs), seconds=1.0,
                    memory_bytes=1 << 20, opens=opens, state=state)
    shards = [shard("tiles-0"), shard("tiles-1"), shard("ground-0", ["tiles-0", "tiles-1"], True)]
    if done("ground-0"):
        shards += [shard("region-0", ["ground-0"]), shard("region-1", ["ground-0"])]
        shards += [shard("gather-0", ["region-0", "region-1"])]
    left = [s["id"] for s in shards if os.path.exists(at(s["id"] + ".left"))]
    if what == "shards":
        print(json.dumps(dict(finished=done("gather-0"), shards=shards, left_out=left)))
        sys.exit(0)
    id = words[0]
    own = next((s for s in shards if s["id"] == id), None)
    if "--leave-out" in words:
        if not id.startswith("region"):
            sys.exit(2)
        open(at(id + ".left"), "w").close()
        sys.exit(3)
    if own is None or own["state"] == "waiting":
        print("error: not ready", file=sys.stderr)
        sys.exit(2)
    with open(at("starts"), "a") as file:
        file.write(id + "\\n")
    codes = trouble.get(id, [])
    n = open(at("starts")).read().split().count(id)
    if n <= len(codes) and codes[n - 1]:
        print("error: trouble of " + id, file=sys.stderr)
        if codes[n - 1] < 0:
            os.kill(os.getpid(), -codes[n - 1])
        sys.exit(codes[n - 1])
    open(at(id), "w").close()
    print(id + ": made\\nthe summary" if id == "gather-0" else id)
    sys.exit(3 if id == "gather-0" and left else 0)
"""


class FakeRay(types.ModuleType):
    """As much of Ray as the driver uses; tasks run when they are waited for, some after lost nodes."""

    def __init__(self, lost=()):
        super().__init__("ray")
        self.lost, self.options_seen, self.results, self.n = list(lost), [], {}, 0
        self.cloudpickle = types.SimpleNamespace(register_pickle_by_value=lambda module: None)

        class RayError(Exception):
            pass

        self.exceptions = types.SimpleNamespace(RayError=RayError)

    def init(self, **_):
        pass

    def nodes(self):
        return [{"Alive": True, "Resources": {"CPU": 2.0, "memory": 1e9}}, {"Alive": False, "Resources": {"CPU": 8.0}}]

    def remote(self, function):
        def options(**options):
            def start(*args):
                self.n += 1
                self.options_seen.append(options)
                self.results[self.n] = (function, args, options["name"])
                return self.n

            return types.SimpleNamespace(remote=start)

        return types.SimpleNamespace(options=options)

    def wait(self, references, num_returns, timeout):
        assert num_returns == 1 and timeout > 0
        return references[-1:], references[:-1]

    def get(self, reference):
        function, args, name = self.results.pop(reference)
        for prefix in self.lost:
            if name.startswith(prefix):
                raise self.exceptions.RayError("the worker died")
        return function(*args)


@pytest.fixture
def job(tmp_path):
    program = tmp_path / "program"
    program.write_text(textwrap.dedent(PROGRAM).strip().format(python=sys.executable))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    (tmp_path / "out").mkdir()

    def make(trouble=None, **more):
        (tmp_path / "out/trouble.json").write_text(json.dumps(trouble or {}))
        return Job(["a", "b"], "robots", str(tmp_path / "out"), program=str(program), folder=str(tmp_path), **more)

    return make


def starts(job):
    with open(os.path.join(job.out, "starts")) as file:
        return file.read().split()


def drive(job, ray, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setattr(_driver, "BACK_OFF", 0.01)
    assert _driver.drive(job) == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_every_shard_is_made_once_and_threads_go_with_the_number_of_shards(job, monkeypatch, capsys):
    job, ray = job(), FakeRay()
    events = drive(job, ray, monkeypatch, capsys)
    assert events[-1] == {"event": "end", "code": 0, "summary": "the summary", "partial": False}
    assert sorted(starts(job)) == ["gather-0", "ground-0", "region-0", "region-1", "tiles-0", "tiles-1"]
    cores = {options["name"].split(":")[0]: options["num_cpus"] for options in ray.options_seen}
    assert cores["gather-0"] == cores["ground-0"] == 2 and cores["tiles-0"] == cores["region-1"] == 1
    assert all(options["max_retries"] == 3 and options["memory"] == 1 << 20 for options in ray.options_seen)
    # A driver that comes later finds the result.
    events = drive(job, FakeRay(), monkeypatch, capsys)
    assert events[-1]["code"] == 0 and len(starts(job)) == 6


def test_what_fails_is_tried_again_and_what_cannot_be_mended_is_not(job, monkeypatch, capsys):
    flaky = job({"tiles-0": [1, -9], "region-1": [2]})
    events = drive(flaky, FakeRay(), monkeypatch, capsys)
    assert events[-1]["code"] == 0
    assert [e["id"] for e in events if e["event"] == "failure"].count("tiles-0") == 2
    assert starts(flaky).count("tiles-0") == 3 and starts(flaky).count("region-1") == 2


@pytest.mark.parametrize("codes, n_starts, code", [([4], 1, 4), ([1, 1, 1, 1, 1], 4, 1), ([-9] * 9, 4, 1)])
def test_a_shard_that_fails_for_good_is_named(job, monkeypatch, capsys, codes, n_starts, code):
    broken = job({"region-0": codes})
    end = drive(broken, FakeRay(), monkeypatch, capsys)[-1]
    assert end["code"] == code and end["shard"]["id"] == "region-0"
    assert "region-0" in end["why"] and "trouble of region-0" in end["why"]
    assert starts(broken).count("region-0") == n_starts


def test_a_job_that_keeps_going_leaves_out_what_it_can(job, monkeypatch, capsys):
    broken = job({"region-0": [-9] * 9}, keep_going=True)
    end = drive(broken, FakeRay(), monkeypatch, capsys)[-1]
    assert end["code"] == 3 and end["partial"]
    ground = job({"ground-0": [1] * 9}, keep_going=True, attempts=2)
    os.remove(os.path.join(ground.out, "gather-0"))
    os.remove(os.path.join(ground.out, "ground-0"))
    end = drive(ground, FakeRay(), monkeypatch, capsys)[-1]
    assert end["code"] == 1 and end["shard"]["id"] == "ground-0"


def test_a_worker_that_dies_too_often_is_named(job, monkeypatch, capsys):
    lost = job()
    end = drive(lost, FakeRay(lost=["tiles-1"]), monkeypatch, capsys)[-1]
    assert end["shard"]["id"] == "tiles-1" and "the worker died" in end["why"]


def test_ray_gets_the_longest_shards_first_and_no_more_than_it_has_room_for(job):
    ray = FakeRay()
    driver = _driver._Driver(job(), ray, None)
    seconds = [3.0, 9.0, 1.0, 7.0, 8.0, 2.0]
    driver.shards = {f"region-{i}": {"id": f"region-{i}", "kind": "region", "what": "", "needs": [], "seconds": s, "memory_bytes": 1 << 20}
                     for i, s in enumerate(seconds)}

    def asked():
        driver._start()
        return [options["name"].split(":")[0] for options in ray.options_seen]

    # Two cores, and one that waits for its place on the only node.
    assert asked() == ["region-1", "region-4", "region-3"] == asked()
    driver.running.pop(2)
    driver.done.add("region-4")
    assert asked()[3:] == ["region-0"]
    files = {**driver.shards["region-0"], "kind": "files", "id": "files-0"}
    driver.shards, driver.running = {"files-0": files}, {}
    assert asked()[4:] == ["files-0"] and ray.options_seen[4]["num_cpus"] == 2
    line = ray.results[5][1][0]
    assert line[line.index("--threads") + 1] == str(2 * _driver.THREADS_OF_WAITS)


def test_another_driver_starts_where_the_cluster_is_lost(job, monkeypatch, tmp_path):
    from stillpoint.plant import _outer

    given, events, n = job(), [], 0

    def lost_twice(job, tell, counts):
        nonlocal n
        n += 1
        if n < 3:
            return None, False
        return {"event": "end", "code": 3, "summary": "done", "partial": True}, True

    monkeypatch.setattr(_outer, "_drive", lost_twice)
    monkeypatch.setattr(_outer, "PAUSE", 0.0)
    done = plant.run(given.inputs, given.robots, given.out, on_event=events.append)
    assert (done.drivers, done.partial, done.summary) == (3, True, "done")
    assert [event["event"] for event in events] == ["restart", "restart"]
    monkeypatch.setattr(_outer, "_drive", lambda *_: (None, False))
    with pytest.raises(plant.JobFailed, match="is lost"):
        plant.run(given.inputs, given.robots, given.out, patience=0.0)


def test_a_process_does_not_outlive_its_task(tmp_path):
    ended = _task.make([sys.executable, "-c", "import sys; print('told'); sys.exit('said')"], str(tmp_path), {})
    assert (ended["code"], ended["told"].strip(), ended["said"].strip()) == (1, "told", "said")
    pid = tmp_path / "pid"
    line = [sys.executable, "-c", f"import os, time; open({str(pid)!r}, 'w').write(str(os.getpid())); time.sleep(60)"]

    class Cancelled(Exception):
        pass

    def look(_):
        if pid.exists() and pid.read_text():
            raise Cancelled

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_task.time, "sleep", look)
        with pytest.raises(Cancelled):
            _task.make(line, str(tmp_path), {})
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)
