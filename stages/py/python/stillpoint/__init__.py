"""Stillpoint finds the robots in laser scans of a plant, and in which posture they stand.

>>> import stillpoint
>>> result = stillpoint.run("hall.e57", robots="library", out="result")  # doctest: +SKIP
>>> result.robots[0].joints                                               # doctest: +SKIP

All is in metres and radians, in the world frame of the scans. Work runs on threads of its own without
the interpreter's lock; Ctrl-C ends it. Start processes with ``multiprocessing.get_context("spawn")``:
a process that was forked after a call has none of the threads, and is refused.
"""

from ._clouds import Cloud
from ._errors import (
    AccessError,
    BadInputError,
    BugError,
    Error,
    Interrupted,
    LimitError,
    UnsupportedError,
    UsageError,
)
from ._fit import fit
from ._jobs import PathCheck, Progress, check, inspect, plan, rescan, run
from ._kinematics import Urdf
from ._result import KINDS, Labels, Points, Result, Scan
from ._robot import BaseSigma, LinkEvidence, Robot, RunnerUp, Tool

__all__ = [
    "KINDS",
    "AccessError",
    "BadInputError",
    "BaseSigma",
    "BugError",
    "Cloud",
    "Error",
    "Interrupted",
    "Labels",
    "LimitError",
    "LinkEvidence",
    "PathCheck",
    "Points",
    "Progress",
    "Result",
    "Robot",
    "RunnerUp",
    "Scan",
    "Tool",
    "UnsupportedError",
    "Urdf",
    "UsageError",
    "check",
    "fit",
    "inspect",
    "plan",
    "rescan",
    "run",
]
