"""The commands as functions: answers, progress, errors, Ctrl-C."""

import multiprocessing
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time

import pytest

import stillpoint
from conftest import Demo
from stillpoint import _stillpoint

#: Longest time between Ctrl-C and the end of a call, seconds: steps look for it between items.
SOON = 20.0


def test_a_run_that_was_done_is_not_done_again(demo: Demo) -> None:
    stillpoint.run(demo.scans, robots=demo.robots, out=demo.out)
    before = (demo.out / "result.json").stat().st_mtime_ns
    result = stillpoint.run(demo.scans, robots=demo.robots, out=demo.out)
    assert (demo.out / "result.json").stat().st_mtime_ns == before
    assert result.partial is False
    assert [robot.id for robot in result.robots] == ["R1", "R2", "R3"]


def test_progress_is_told_and_a_thread_may_run(demo: Demo, tmp_path: pathlib.Path) -> None:
    told: list[tuple[str, int, int | None]] = []
    results = []

    def work() -> None:
        results.append(
            stillpoint.run(
                [demo.scans],
                robots=demo.one,
                out=tmp_path / "out",
                threads=2,
                set={"export.page": False, "export.tiles": False},
                progress=lambda *now: told.append(now),
            )
        )

    thread = threading.Thread(target=work)
    thread.start()
    n_turns = 0
    while thread.is_alive():
        n_turns += 1
        time.sleep(0.01)
    stages = [name for name, _, _ in told]
    assert {"ingest", "surfaces", "fit"} <= set(stages), stages
    assert all(total is None or 0 <= done <= total for _, done, total in told)
    # The lock of the interpreter was free while work went on.
    assert n_turns > 50
    (result,) = results
    assert [robot.model for robot in result.robots if robot.is_trusted] == [demo.model]
    with pytest.raises(stillpoint.BadInputError, match="tiles"):
        result.points("floor")


def test_an_exception_of_the_callback_ends_the_work(demo: Demo, tmp_path: pathlib.Path) -> None:
    class Enough(Exception):
        pass

    def stop(*_: object) -> None:
        raise Enough

    with pytest.raises(Enough):
        stillpoint.run(demo.scans, robots=demo.robots, out=tmp_path / "out", progress=stop)
    assert not (tmp_path / "out/result.json").exists()


def test_inspect_and_plan_answer_as_the_command_line(demo: Demo, tmp_path: pathlib.Path) -> None:
    seen = stillpoint.inspect([demo.scans, demo.las], scanners=demo.scanners)
    assert seen["schema"] == "stillpoint.inspect/1"
    assert [len(one["scans"]) for one in seen["inputs"]] == [4, 4]
    plan = stillpoint.plan(demo.scans, robots=demo.robots, out=tmp_path / "out", threads=3)
    assert plan["n_models"] == 3
    # Beams without return count as points of the file.
    assert plan["n_points"] >= sum(scan.n_points for scan in demo.result.scans) > 0
    assert not (tmp_path / "out").exists()


def test_a_path_is_checked(demo: Demo, tmp_path: pathlib.Path) -> None:
    robot = demo.result.robots[0]
    turned = {name: value for name, value in robot.joints.items()}
    lines = [",".join(turned)]
    for turn in (0.0, 0.01):
        lines.append(",".join(str(v + turn * (i == 0)) for i, v in enumerate(turned.values())))
    path = tmp_path / "path.csv"
    path.write_text("\n".join(lines) + "\n")
    answer = stillpoint.check(
        demo.result, trajectory=path, robot="R1", allow=["unseen", "beside", "as-found", "posture"]
    )
    assert answer.report["robot"] == "R1", answer.report
    assert bool(answer) == answer.passes and not (answer.passes and answer.blocked)
    doubts = ["unseen", "beside", "as-found", "posture"]
    several = stillpoint.check(demo.out, trajectory=[path, path], robot="R1", allow=doubts)
    assert [one.passes for one in several] == [answer.passes] * 2
    assert [one.blocked for one in several] == [answer.blocked] * 2
    alone = stillpoint.check(demo.out, trajectory=[path], robot="R1", allow=doubts)
    assert [one.report for one in alone] == [answer.report]
    with pytest.raises(stillpoint.UsageError, match="margin"):
        stillpoint.check(demo.out, trajectory=path, margin=7.0)


def test_a_cell_is_scanned_again(demo: Demo, tmp_path: pathlib.Path) -> None:
    later = demo.folder / "demo/scene_later.toml"
    scan = ["simulate", f"--robots={demo.robots}", f"--out={tmp_path / 'later'}", str(later)]
    _stillpoint.call(scan)
    result = stillpoint.rescan(
        tmp_path / "later/scans.e57",
        base=demo.result,
        out=tmp_path / "again",
        robot=["R3"],
        frame="same",
    )
    assert [robot.id for robot in result.robots] == ["R1", "R2", "R3"]
    assert result.changes is not None and "robots" in result.changes
    assert demo.result.changes is None
    masks = [result.labels(scan) for scan in result.scans]
    assert sum(len(mask.superseded) for mask in masks) > 0


def test_errors_say_what_where_and_what_to_do(demo: Demo, tmp_path: pathlib.Path) -> None:
    gone = tmp_path / "gone.e57"
    with pytest.raises(stillpoint.BadInputError) as missing:
        stillpoint.inspect(gone)
    assert missing.value.file == gone
    assert str(gone) in str(missing.value)
    with pytest.raises(stillpoint.UsageError, match="fit.bean"):
        stillpoint.run(demo.scans, robots=demo.robots, out=tmp_path / "o", set={"fit.bean": 1})
    with pytest.raises(stillpoint.LimitError) as small:
        stillpoint.run(demo.scans, robots=demo.robots, out=tmp_path / "o", memory="1MiB")
    assert small.value.way_out is not None and "memory" in small.value.way_out
    with pytest.raises(stillpoint.Error, match="library"):
        stillpoint.run(demo.scans, robots=tmp_path, out=tmp_path / "o")
    broken = tmp_path / "broken.e57"
    broken.write_bytes(demo.scans.read_bytes()[:-4096])
    with pytest.raises(stillpoint.BadInputError) as cut:
        stillpoint.run(broken, robots=demo.robots, out=tmp_path / "o")
    assert cut.value.file == broken
    # An exception passes between processes with all its parts.
    again = pickle.loads(pickle.dumps(small.value))
    assert (str(again), again.way_out) == (str(small.value), small.value.way_out)
    # A name that looks like a flag is a name.
    with pytest.raises(stillpoint.BadInputError):
        stillpoint.inspect("--help")


def test_ctrl_c_ends_a_call_and_the_next_one_goes_on(demo: Demo, tmp_path: pathlib.Path) -> None:
    program = f"""
        import stillpoint
        def progress(stage, done, total):
            print(stage, flush=True)
        try:
            stillpoint.run({str(demo.scans)!r}, robots={str(demo.one)!r},
                           out={str(tmp_path / "out")!r}, progress=progress)
        except KeyboardInterrupt as error:
            assert isinstance(error, stillpoint.Interrupted), type(error)
            assert isinstance(error, stillpoint.Error)
            print("interrupted", flush=True)
    """
    # A shell may have told its children to ignore Ctrl-C.
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert child.stdout is not None
    first = child.stdout.readline()
    assert first, "work has begun"
    at = time.monotonic()
    child.send_signal(signal.SIGINT)
    rest = child.stdout.read()
    assert child.wait(60) == 0
    assert "interrupted" in rest and time.monotonic() - at < SOON
    assert not (tmp_path / "out/result.json").exists()
    result = stillpoint.run(demo.scans, robots=demo.one, out=tmp_path / "out")
    assert [robot.model for robot in result.robots if robot.is_trusted] == [demo.model]


def _forked(queue: "multiprocessing.Queue[str]", scans: str) -> None:
    try:
        stillpoint.inspect(scans)
        queue.put("worked")
    except stillpoint.UsageError as error:
        queue.put(str(error))


def test_a_forked_process_is_refused_and_does_not_hang(demo: Demo) -> None:
    stillpoint.inspect(demo.scans)
    fork = multiprocessing.get_context("fork")
    queue: multiprocessing.Queue[str] = fork.Queue()
    child = fork.Process(target=_forked, args=(queue, os.fspath(demo.scans)))
    child.start()
    assert "spawn" in queue.get(timeout=60)
    child.join(60)
