"""A result on disk: robots, masks, points. Masks and clouds are mapped, not read."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _stillpoint
from ._clouds import Cloud
from ._errors import BadInputError, UsageError
from ._kinematics import Urdf
from ._robot import Robot

#: Numbers of kinds of points in masks.
KINDS: Mapping[str, int] = {
    "fixed": 0,
    "link": 1,
    "attachment": 2,
    "floor": 3,
    "uncertain": 255,
}
SCHEMA = "stillpoint.result/1"


@dataclass(frozen=True)
class Scan:
    """The points that share one mask: a scan of an E57 or PTX file, or a whole LAS or LAZ file."""

    index: int
    name: str
    #: The input file, as the run was given it.
    input: Path
    #: Number of entries of the mask.
    n_points: int


@dataclass(frozen=True, eq=False)
class Labels:
    """The mask of one scan, one entry for each point in the order of the input file.

    The arrays are mapped read-only from the result: opening them reads nothing.
    """

    #: uint8: 0 fixed, 1 link of a robot, 2 attachment, 3 floor, 255 uncertain, which counts as fixed.
    kind: NDArray[np.uint8]
    #: int16: index of the robot, -1 for none.
    robot: NDArray[np.int16]
    #: int16: index of the link among the robot's, -1 for none.
    link: NDArray[np.int16]
    #: uint64, ascending: places in the mask of points that a later scan replaced or showed to be
    #: gone; they are no longer part of the plant.
    superseded: NDArray[np.uint64]

    def moving(self) -> NDArray[np.bool_]:
        """Which points move with a robot: links and what hangs on them."""
        moves: NDArray[np.bool_] = self.kind == KINDS["link"]
        moves |= self.kind == KINDS["attachment"]
        return moves


@dataclass(frozen=True, eq=False)
class Points:
    """Labelled points; all arrays have one entry for each."""

    #: float64, N x 3: world coordinates, metres.
    xyz: NDArray[np.float64]
    kind: NDArray[np.uint8]
    robot: NDArray[np.int16]
    link: NDArray[np.int16]

    def __len__(self) -> int:
        return len(self.kind)


class Result:
    """A result of :func:`stillpoint.run` or :func:`stillpoint.rescan`.

    Parameters
    ----------
    path
        The output folder.
    partial
        Whether the run skipped something, where that is known.

    Raises
    ------
    BadInputError
        The folder holds no result, or one that this version does not read.
    """

    def __init__(self, path: str | os.PathLike[str], *, partial: bool | None = None) -> None:
        self.path = Path(path)
        #: Whether inputs, models or regions were left out; None for a result that was opened.
        self.partial = partial
        place = self.path / "result.json"
        try:
            self.entry: Mapping[str, Any] = json.loads(place.read_text(encoding="utf-8"))
        except OSError as error:
            hint = "give the output folder of a run that has ended"
            raise BadInputError.of("it is not there", str(place), str(error), hint) from error
        except ValueError as error:
            hint = "run the same job again"
            raise BadInputError.of("this is not JSON", str(place), str(error), hint) from error
        if not isinstance(self.entry, dict) or self.entry.get("schema") != SCHEMA:
            hint = f"this package reads {SCHEMA}"
            raise BadInputError.of("the schema is another", str(place), None, hint)
        #: The robots; their order is that of the numbers in masks.
        self.robots: tuple[Robot, ...] = tuple(
            Robot.of(entry, index) for index, entry in enumerate(self.entry["robots"])
        )
        inputs = [Path(entry["path"]) for entry in self.entry["inputs"]]
        #: The masks, in the order of the inputs.
        self.scans: tuple[Scan, ...] = tuple(
            Scan(index, entry["scan"], inputs[entry["input"]], entry["n_points"])
            for index, entry in enumerate(self.entry["labels"]["scans"])
        )
        #: Warnings of the run.
        self.warnings: tuple[str, ...] = tuple(self.entry["warnings"])

    def __repr__(self) -> str:
        n = len(self.robots)
        return f"Result({str(self.path)!r}: {n} robots, {len(self.scans)} scans)"

    def robot(self, of: str | int | Robot) -> Robot:
        """The robot with an id or an index.

        Raises
        ------
        UsageError
            There is no such robot.
        """
        if isinstance(of, Robot):
            return of
        for robot in self.robots:
            if of in (robot.id, robot.index):
                return robot
        ids = ", ".join(robot.id for robot in self.robots) or "none"
        raise UsageError.of(f"the result has no robot {of!r}", None, None, f"it has {ids}")

    def scan(self, of: str | int | Scan) -> Scan:
        """The scan with a name or an index.

        Raises
        ------
        UsageError
            There is no such scan, or several have the name.
        """
        if isinstance(of, Scan):
            return of
        found = [scan for scan in self.scans if of in (scan.name, scan.index)]
        if len(found) == 1:
            return found[0]
        many = "several scans" if found else "no scan"
        raise UsageError.of(f"the result has {many} named {of!r}", None, None, "give its index")

    def labels(self, scan: str | int | Scan = 0) -> Labels:
        """The mask of a scan, mapped read-only.

        Raises
        ------
        BadInputError
            A file that is missing or is not as long as ``result.json`` says.
        """
        known = self.scan(scan)
        entry = self.entry["labels"]["scans"][known.index]
        places = entry.get("superseded")
        return Labels(
            kind=self._array(entry["kind"], np.uint8, known.n_points),
            robot=self._array(entry["robot"], np.int16, known.n_points),
            link=self._array(entry["link"], np.int16, known.n_points),
            superseded=np.empty(0, np.uint64) if places is None else self._array(places, np.uint64),
        )

    def points(
        self,
        kind: str | int | Iterable[str | int] | None = None,
        robot: str | int | Robot | None = None,
    ) -> Points:
        """Points of some kinds, or of one robot, in memory.

        The tiles of the result are read, several at a time, each compared with the list of files.
        For more points than fit into memory there is :meth:`iter_points`.

        Parameters
        ----------
        kind
            ``"fixed"``, ``"link"``, ``"attachment"``, ``"floor"``, ``"uncertain"``, their numbers,
            or several of them; all without it.
        robot
            Id or index of a robot: only its links and what hangs on it.

        Returns
        -------
        Points
            World coordinates in metres (float64, N x 3) with kind, robot and link of each. The order
            is that of the tiles, not of the inputs.

        Raises
        ------
        UsageError
            A kind or a robot that is none.
        BadInputError
            The result has no tiles, or a tile that was changed.
        """
        tiles = _stillpoint.LabelledTiles(os.fspath(self.path))
        kinds, number = _kinds(kind), self._number(robot)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            parts = list(pool.map(lambda at: tiles.tile(at, kinds, number), range(len(tiles))))
        if not parts:
            none = np.empty(0, np.int16)
            return Points(np.empty((0, 3)), np.empty(0, np.uint8), none, none)
        xyz, kinds_of, robots, links = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Points(xyz, kinds_of, robots, links)

    def iter_points(
        self,
        kind: str | int | Iterable[str | int] | None = None,
        robot: str | int | Robot | None = None,
    ) -> Iterator[Points]:
        """As :meth:`points`, tile by tile: memory holds one tile at a time."""
        tiles = _stillpoint.LabelledTiles(os.fspath(self.path))
        kinds, number = _kinds(kind), self._number(robot)
        for at in range(len(tiles)):
            part = Points(*tiles.tile(at, kinds, number))
            if len(part):
                yield part

    def fixed_world(self) -> Cloud:
        """All points that do not move, as records mapped read-only from ``clouds/fixed.las``.

        Raises
        ------
        BadInputError
            The result has no such file (``lean``), or a compressed one: :meth:`iter_points` reads
            the same points then.
        """
        return Cloud.open(self.path / "clouds" / "fixed.las")

    def urdf(self, robot: str | int | Robot) -> Urdf:
        """The URDF that the run wrote for a robot, with its posture.

        Raises
        ------
        BadInputError
            The result has none: a robot that was refused.
        """
        known = self.robot(robot)
        place = self.path / "robots" / known.id / "robot.urdf"
        if not place.is_file():
            what = f"there is no URDF of {known.id}, which is {known.verdict}"
            raise BadInputError.of(what, str(place))
        return Urdf(place, known.base_pose, {**known.joints, **known.passive})

    @property
    def changes(self) -> Mapping[str, Any] | None:
        """What a rescan found changed, as ``changes.json``; None after a run."""
        if self.entry.get("rescan") is None:
            return None
        place = self.path / "changes.json"
        changes: Mapping[str, Any] = json.loads(place.read_text(encoding="utf-8"))
        return changes

    def _number(self, robot: str | int | Robot | None) -> int | None:
        return None if robot is None else self.robot(robot).index

    def _array(self, name: str, kind: type[np.generic], n: int | None = None) -> NDArray[Any]:
        place = self.path / name
        hint = "`stillpoint verify` names all files that are wrong; run the same job again"
        try:
            # An empty array cannot be mapped.
            array = np.load(place, mmap_mode=None if n == 0 else "r", allow_pickle=False)
        except (OSError, ValueError, EOFError) as error:
            raise BadInputError.of("it cannot be read", str(place), str(error), hint) from error
        wanted = np.dtype(kind).newbyteorder("<")
        if array.dtype != wanted or array.ndim != 1 or n not in (None, len(array)):
            what = "it is not the array that result.json states"
            raise BadInputError.of(what, str(place), None, hint)
        array.flags.writeable = False
        return array  # type: ignore[no-any-return]


def _kinds(kind: str | int | Iterable[str | int] | None) -> Sequence[int] | None:
    if kind is None:
        return None
    wanted = [kind] if isinstance(kind, (str, int)) else list(kind)
    numbers = [KINDS.get(one, -1) if isinstance(one, str) else int(one) for one in wanted]
    for one, number in zip(wanted, numbers, strict=True):
        if number not in KINDS.values():
            known = ", ".join(KINDS)
            raise UsageError.of(f"there is no kind {one!r} of points", None, None, f"give {known}")
    return numbers
