"""The commands of the program as functions: keyword arguments are the flags."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, overload

from . import _stillpoint
from ._result import Result

#: A path as Python programs write it.
StrPath = str | os.PathLike[str]
#: Called while work goes on with the name of the stage, the amount that is done, and the whole
#: amount where it is known: points, pieces of a search, or items. An exception in it ends the work.
Progress = Callable[[str, int, int | None], object]
#: The value of a setting, as in a configuration file.
Setting = bool | int | float | str | Sequence[float]

log = logging.getLogger("stillpoint")


def paths(inputs: StrPath | Iterable[StrPath]) -> list[str]:
    """One path or several as a list."""
    if isinstance(inputs, (str, os.PathLike)):
        return [os.fspath(inputs)]
    return [os.fspath(one) for one in inputs]


def settings(values: Mapping[str, Setting] | None) -> list[str]:
    """Settings as the texts of ``--set``. JSON writes numbers, texts and lists as TOML does."""
    return [f"{key}={json.dumps(value)}" for key, value in (values or {}).items()]


def arguments(flags: Mapping[str, object]) -> list[str]:
    """Flags as arguments of the command line, without those that are not given."""
    out = []
    for name, value in flags.items():
        flag = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            out.append(flag)
        elif isinstance(value, list):
            out += [f"{flag}={one}" for one in value]
        else:
            text = os.fspath(value) if isinstance(value, os.PathLike) else str(value)
            out.append(f"{flag}={text}")
    return out


def call(
    command: str, inputs: Sequence[str], flags: Mapping[str, object], progress: Progress | None
) -> tuple[int, str]:
    """Run a command; warnings and notes go to the logger ``stillpoint``."""
    args = [command, *arguments(flags), "--", *inputs]
    code, text, warnings, notes = _stillpoint.call(args, progress, log.info)
    for warning in warnings:
        log.warning("%s", warning)
    for note in notes:
        log.info("%s", note)
    return code, text


def run(
    inputs: StrPath | Iterable[StrPath],
    *,
    robots: StrPath,
    out: StrPath,
    review: StrPath | None = None,
    keep_going: bool = False,
    calibrate: bool = False,
    lean: bool = False,
    memory: str | None = None,
    threads: int | None = None,
    scanners: StrPath | None = None,
    units: str | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    method: str | None = None,
    progress: Progress | None = None,
) -> Result:
    """Find the robots in scans, recover their postures and label all points.

    Parameters
    ----------
    inputs
        Scan files: E57, PTX, LAS, LAZ, PTS, XYZ, PLY, PCD.
    robots
        Robot library: a folder with one folder per model, each with ``robot.urdf`` and its meshes.
    out
        Output folder. A job that was done there already is not done again.
    review
        Review file (TOML) with what a person knows.
    keep_going
        Go on without files and robots that fail; :attr:`Result.partial` then tells.
    calibrate
        Also estimate the joint axes of each robot.
    lean
        Write a small result.
    memory
        Upper bound of the memory of the work, for example ``"4GiB"``.
    threads
        Number of worker threads; one per core without it.
    scanners
        File of scanner poses (TOML or JSON), for formats without poses.
    units
        Unit of the inputs' coordinates, as ``--units``.
    config
        Configuration file with settings (TOML).
    set
        Single settings, for example ``{"fit.beam": 150}``.
    method
        ``"beam"`` or ``"paper"``.
    progress
        Called about once a second with ``(stage, done, total)``.

    Returns
    -------
    Result
        The result in ``out``. All in it is metres and radians, in the world frame of the scans.

    Raises
    ------
    UsageError, BadInputError, LimitError, AccessError
        As the exit codes 2, 4, 5 and 1 of the command line.
    Interrupted
        Ctrl-C. The next run in ``out`` goes on from there.
    """
    flags = {
        "robots": robots, "out": out, "review": review, "keep_going": keep_going,
        "calibrate": calibrate, "lean": lean, "memory": memory, "threads": threads,
        "scanners": scanners, "units": units, "config": config, "set": settings(set),
        "method": method,
    }  # fmt: skip
    code, _ = call("run", paths(inputs), flags, progress)
    return Result(out, partial=code != 0)


def rescan(
    inputs: StrPath | Iterable[StrPath],
    *,
    base: StrPath | Result,
    out: StrPath,
    robots: StrPath | None = None,
    cell: Sequence[float] | None = None,
    robot: str | Iterable[str] | None = None,
    frame: str | Sequence[float] | None = None,
    memory: str | None = None,
    threads: int | None = None,
    scanners: StrPath | None = None,
    units: str | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    method: str | None = None,
    progress: Progress | None = None,
) -> Result:
    """Bring one cell of an earlier result up to date with new scans.

    Parameters
    ----------
    inputs
        New scans of the cell: E57, PTX, LAS, LAZ, PTS, XYZ, PLY, PCD.
    base
        The earlier result, or its folder.
    out
        Output folder; files that do not change are shared with the earlier result.
    robots
        Robot library; that of the earlier run without it.
    cell
        Bounds of the cell, metres: least x, y, z, then greatest x, y, z. What the new scans see well
        without it.
    robot
        Ids of robots of the earlier run whose reach is the cell, instead of bounds.
    frame
        Frame of the new scans: ``"same"`` for the plant's, or the approximate position of the first
        new scanner in the plant, metres, and the turn of the new frame, degrees. Found without it.

    The other parameters and the exceptions are those of :func:`run`.

    Returns
    -------
    Result
        The whole result in ``out``; :attr:`Result.changes` lists what changed.
    """
    of = base.path if isinstance(base, Result) else base
    ids = [robot] if isinstance(robot, str) else list(robot or [])
    if frame is not None and not isinstance(frame, str):
        frame = ",".join(repr(float(v)) for v in frame)
    flags = {
        "base": of, "out": out, "robots": robots,
        "cell": None if cell is None else ",".join(repr(float(v)) for v in cell),
        "robot": ids, "frame": frame, "memory": memory, "threads": threads, "scanners": scanners,
        "units": units, "config": config, "set": settings(set), "method": method,
    }  # fmt: skip
    code, _ = call("rescan", paths(inputs), flags, progress)
    return Result(out, partial=code != 0)


def inspect(
    inputs: StrPath | Iterable[StrPath],
    *,
    scanners: StrPath | None = None,
    units: str | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """What scans contain, and which missing data make results worse.

    Returns
    -------
    dict
        What ``stillpoint inspect --json`` prints: ``inputs`` with their scans, and ``warnings``.

    Raises
    ------
    BadInputError
        A file that cannot be read, or points that no plant can have.
    """
    flags = {
        "json": True, "scanners": scanners, "units": units, "config": config, "set": settings(set),
    }  # fmt: skip
    return _json(call("inspect", paths(inputs), flags, progress)[1])


def plan(
    inputs: StrPath | Iterable[StrPath],
    *,
    robots: StrPath,
    out: StrPath,
    review: StrPath | None = None,
    keep_going: bool = False,
    calibrate: bool = False,
    lean: bool = False,
    memory: str | None = None,
    threads: int | None = None,
    scanners: StrPath | None = None,
    units: str | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    method: str | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Memory, disk space and time of a run, estimated without running it.

    The parameters are those of :func:`run`.

    Returns
    -------
    dict
        What ``stillpoint plan --json`` prints: bytes and seconds.

    Raises
    ------
    LimitError
        The run would not fit on the disk or into the memory that it may use.
    """
    flags = {
        "json": True, "robots": robots, "out": out, "review": review, "keep_going": keep_going,
        "calibrate": calibrate, "lean": lean, "memory": memory, "threads": threads,
        "scanners": scanners, "units": units, "config": config, "set": settings(set),
        "method": method,
    }  # fmt: skip
    return _json(call("plan", paths(inputs), flags, progress)[1])


@dataclass(frozen=True)
class PathCheck:
    """Whether a path of a robot keeps clear of what was scanned."""

    #: Whether the path is free apart from doubts that were allowed.
    passes: bool
    #: Whether something stands in the way. A path that neither passes nor is blocked leads through
    #: space of which not all is known.
    blocked: bool
    #: What ``stillpoint check --json`` prints: contacts with links, obstacles and places on the path.
    report: dict[str, Any]

    def __bool__(self) -> bool:
        return self.passes


# A string is an iterable of strings as well; as a path it comes first.
@overload
def check(  # type: ignore[overload-overlap]
    result: StrPath | Result,
    *,
    trajectory: StrPath,
    robot: str | None = None,
    margin: float | None = None,
    degrees: bool = False,
    allow: str | Iterable[str] | None = None,
    robots: StrPath | None = None,
    memory: str | None = None,
    threads: int | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    progress: Progress | None = None,
) -> PathCheck: ...
@overload
def check(
    result: StrPath | Result,
    *,
    trajectory: Iterable[StrPath],
    robot: str | None = None,
    margin: float | None = None,
    degrees: bool = False,
    allow: str | Iterable[str] | None = None,
    robots: StrPath | None = None,
    memory: str | None = None,
    threads: int | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    progress: Progress | None = None,
) -> list[PathCheck]: ...
def check(
    result: StrPath | Result,
    *,
    trajectory: StrPath | Iterable[StrPath],
    robot: str | None = None,
    margin: float | None = None,
    degrees: bool = False,
    allow: str | Iterable[str] | None = None,
    robots: StrPath | None = None,
    memory: str | None = None,
    threads: int | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    progress: Progress | None = None,
) -> PathCheck | list[PathCheck]:
    """Check whether paths of robots keep clear of scanned obstacles.

    Parameters
    ----------
    result
        A result, or its folder.
    trajectory
        Path: CSV with joint names in the first line, or JSON as
        ``trajectory_msgs/JointTrajectory``; radians and metres. Several paths take little longer
        than one, since what stands around a robot is read once.
    robot
        Id of the robot of all paths; of each the only robot that has all of its joints without it.
    margin
        Distance below which something is in the way, metres; 0.02 without it.
    degrees
        The paths state turning joints in degrees.
    allow
        Doubts that are allowed in a path that passes.
    robots
        Robot library; that of the run without it.

    Returns
    -------
    PathCheck
        True in a condition where the path passes. A list of them, in order, of several paths.
    """
    of = result.path if isinstance(result, Result) else result
    doubts = [allow] if isinstance(allow, str) else list(allow or [])
    given = paths(trajectory)
    if not given:
        return []
    flags = {
        "json": True, "trajectory": given, "robot": robot, "margin": margin,
        "degrees": degrees, "allow": doubts, "robots": robots, "memory": memory,
        "threads": threads, "config": config, "set": settings(set),
    }  # fmt: skip
    code, text = call("check", [os.fspath(of)], flags, progress)
    answer = _json(text)
    if len(given) == 1:
        one = PathCheck(passes=code == 0, blocked=code == 1, report=answer)
        return one if isinstance(trajectory, (str, os.PathLike)) else [one]
    return [
        PathCheck(
            passes=report["passes"],
            blocked=report["outcome"] in ("near", "blocked"),
            report=report,
        )
        for report in answer["paths"]
    ]


def _json(text: str) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(text)
    return answer
