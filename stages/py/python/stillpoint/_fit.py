"""The search for robots in points in memory."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _stillpoint
from ._errors import UsageError
from ._jobs import Progress, Setting, StrPath, log, paths, settings
from ._robot import Robot

#: Points of one scanner: N x 3, float32 or float64, world frame, metres.
Array = NDArray[np.float64] | NDArray[np.float32]
Rows = list[list[float]]


def fit(
    points: Array | Sequence[Array],
    scanner: ArrayLike | Sequence[ArrayLike | None] | None,
    model: StrPath | Iterable[StrPath],
    *,
    about: Sequence[float] | NDArray[np.float64] | None = None,
    radius: float = 0.5,
    calibrate: bool = False,
    memory: str | None = None,
    threads: int | None = None,
    config: StrPath | None = None,
    set: Mapping[str, Setting] | None = None,
    method: str | None = None,
    scratch: StrPath | None = None,
    progress: Progress | None = None,
) -> list[Robot]:
    """Find robots in points in memory, as :func:`stillpoint.run` would in a file of them.

    Parameters
    ----------
    points
        Points of one scanner, or a list with those of each: arrays of N x 3, float32 or float64,
        world frame, metres. Points that are not finite are passed over. About a map's origin,
        float32 is too coarse. A part of a scan is enough, as long as it holds the robot with its
        stand and what is around and behind it: beams that pass prove that nothing is there.
    scanner
        Position of the scanner in the world, metres, or its pose (world from scan, 4 x 4), or a list
        with that of each array. None where it is not known: then beams prove no free space, and
        postures are less certain. A position is enough unless the scanner leant.
    model
        Folder of the model, which holds ``robot.urdf`` and its meshes; or several, tools among them.
    about
        A place in the world, metres, near the base of the robot: only bases within ``radius`` of it
        are searched. All that stands in the points is, without it.
    radius
        Greatest distance of the base from ``about``, metres.
    calibrate
        Also estimate the joint axes of each robot.
    memory, threads, config, set, method, progress
        As those of :func:`stillpoint.run`.
    scratch
        Folder for temporary files, about as large as the points; that of the system without it.

    Returns
    -------
    list of Robot
        What was found, best explained first. ``entry`` is what ``result.json`` of a run would hold,
        without the known space around the robot.

    Raises
    ------
    UsageError
        Arrays, positions or settings that cannot be.
    BadInputError
        A model that cannot be loaded, or points in which no robot can be recognised.
    Interrupted
        Ctrl-C.

    Notes
    -----
    The arrays are copied once, 12 bytes a point, before the lock of the interpreter is released.
    """
    arrays = list(points) if isinstance(points, (list, tuple)) else [cast(Array, points)]
    at = _scanners(scanner, len(arrays))
    named = [(f"array {i}", at[i], _checked(array, i)) for i, array in enumerate(arrays)]
    place = None if about is None else (_xyz(about, "about"), float(radius))
    given = {"fit.calibrate": True} if calibrate else {}
    given |= {} if method is None else {"fit.method": method}  # type: ignore[dict-item]
    flags = (
        memory,
        threads,
        None if config is None else os.fspath(config),
        settings({**(set or {}), **given}),
    )
    models = [os.path.abspath(one) for one in paths(model)]
    folder = None if scratch is None else os.fspath(scratch)
    text = _stillpoint.fit(named, models, place, folder, flags, progress, log.info)
    return [Robot.of(entry, index) for index, entry in enumerate(json.loads(text))]


def _checked(array: Any, index: int) -> NDArray[Any]:
    """The array in a form that can be read by whole items, copied only where it is not so."""
    place = f"array {index}"
    native = array.dtype.newbyteorder("=") if isinstance(array, np.ndarray) else None
    if native not in (np.dtype(np.float32), np.dtype(np.float64)):
        kind = getattr(array, "dtype", type(array).__name__)
        hint = "convert it with numpy.asarray(points, dtype=float)"
        raise UsageError.of(f"points are float32 or float64, not {kind}", place, None, hint)
    if array.ndim != 2 or array.shape[1] != 3:
        what = f"points have N rows and 3 columns, not the shape {array.shape}"
        raise UsageError.of(what, place, None, "give x, y and z as columns")
    size = array.dtype.itemsize
    is_whole = array.flags.aligned and all(stride % size == 0 for stride in array.strides)
    whole: NDArray[Any] = array
    return whole if is_whole and array.dtype.isnative else np.ascontiguousarray(array, native)


def _scanners(scanner: Any, n: int) -> list[Rows | None]:
    """One pose, or None, for each of n arrays: its first three rows."""
    if scanner is None:
        return [None] * n
    # A list of places is told from a place, and one of poses from a pose, by its depth.
    given = [scanner] if _is_one(scanner) else list(scanner)
    if len(given) != n:
        what = f"there are {n} arrays and {len(given)} positions of scanners"
        raise UsageError.of(what, "scanner", None, "give a position, or None, for each array")
    return [None if one is None else _rows(one) for one in given]


def _is_one(scanner: Any) -> bool:
    """Whether this is one position or one pose."""
    try:
        return np.shape(scanner) in ((3,), (4, 4))
    except ValueError:
        # A list with None or with positions and poses.
        return False


def _rows(scanner: Any) -> Rows:
    """The first three rows of a pose."""
    if np.shape(scanner) == (4, 4):
        pose = np.asarray(scanner, float)
    else:
        pose = np.eye(4)
        pose[:3, 3] = _xyz(scanner, "scanner")
    rows: Rows = pose[:3].tolist()
    return rows


def _xyz(value: Any, name: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(v) for v in value)
    except (TypeError, ValueError) as error:
        what = f"a place is x, y and z in metres, not {value!r}"
        raise UsageError.of(what, name, str(error)) from error
    return x, y, z
