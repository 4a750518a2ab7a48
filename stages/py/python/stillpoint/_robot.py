"""Robots as a result describes them: frozen dataclasses made of ``result.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

#: A pose: 4 x 4, float64; maps points of the frame to the world, metres. It cannot be written to.
Pose = NDArray[np.float64]
Verdict = Literal["trusted", "doubtful", "refused"]
Certainty = Literal["determined", "coarse", "undetermined"]


def pose(entry: Mapping[str, Any]) -> Pose:
    """The matrix of a position (metres) and a unit quaternion (w, x, y, z)."""
    w, x, y, z = np.asarray(entry["quat_wxyz"], float) / np.linalg.norm(entry["quat_wxyz"])
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = entry["xyz"]
    out.flags.writeable = False
    return out


@dataclass(frozen=True)
class BaseSigma:
    """Standard deviations of a base; None where the points do not tell."""

    #: Of the position, along world axes, metres.
    xyz: tuple[float | None, ...]
    #: Of the rotation, about world axes, radians.
    rotation: tuple[float | None, ...]


@dataclass(frozen=True)
class LinkEvidence:
    """What the scans say of a link. Shares are None where no beam could judge it."""

    link: str
    #: Share of its surface that at least one beam could judge.
    seen: float | None
    #: Share of the judged surface on which a beam ends.
    matched: float | None
    #: Share of the judged surface that a beam passed through.
    violated: float | None
    #: Number of points within the gate.
    n_points: int
    #: RMS distance of these points from the surface, metres.
    rms: float | None


@dataclass(frozen=True)
class RunnerUp:
    """The best other explanation of the points."""

    model: str
    score: float | None
    #: Whether it is the same model in another posture.
    same_model: bool
    #: About 0 for equally good explanations, 1 for a clear preference of the robot.
    margin: float | None


@dataclass(frozen=True)
class Tool:
    """A tool on a robot's flange."""

    model: str
    #: The robot's link that it is bolted to.
    link: str
    #: Rotation about the axis of the robot's last joint, radians.
    mount: float


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A robot that was found. Values of joints are radians, or metres for those in ``slides``."""

    #: ``R1``, ``R2`` ...
    id: str
    #: Index in ``result.json``: the number of its points in masks.
    index: int
    #: Name of the model in the library.
    model: str
    #: ``trusted``, ``doubtful`` or ``refused``.
    verdict: Verdict
    #: Reasons for the verdict, in words.
    reasons: tuple[str, ...]
    #: Link whose pose is ``base_pose``.
    base_link: str
    #: Pose of the base link in the world, 4 x 4, metres.
    base_pose: Pose
    base_sigma: BaseSigma
    #: Values of the free joints, in the order of the model.
    joints: Mapping[str, float]
    #: Standard deviation of each of them, same unit; pi / sqrt(3) if the points do not determine it.
    sigma: Mapping[str, float]
    #: How well the points determine each of them.
    certainty: Mapping[str, Certainty]
    #: Values of the joints that follow the free ones by a rule or in a closed loop.
    passive: Mapping[str, float]
    #: Names of the joints whose values are metres.
    slides: tuple[str, ...]
    #: Names of the links; their indices are those of masks.
    links: tuple[str, ...]
    #: Pose of each link in the world, 4 x 4, metres.
    link_poses: Mapping[str, Pose]
    #: Share of the surface that is explained less the share that is contradicted.
    score: float | None
    #: RMS distance of its points from its surface, metres.
    rms: float | None
    #: Standard deviation of the tip's position in the base frame, metres.
    tip_sigma: float | None
    runner_up: RunnerUp | None
    tool: Tool | None
    #: Names of other models that explain the points as well.
    alike: tuple[str, ...]
    evidence: tuple[LinkEvidence, ...]
    #: Numbers of the scans in which it has this posture, if it moved between scans; else empty.
    stands_in: tuple[int, ...]
    #: Its postures in other scans.
    stays: tuple[Robot, ...]
    #: The whole entry of ``result.json``, with what has no field here.
    entry: Mapping[str, Any]

    def __repr__(self) -> str:
        x, y, z = self.base_pose[:3, 3]
        at = f"({x:.3f}, {y:.3f}, {z:.3f})"
        return f"Robot({self.id!r}, {self.model!r}, {self.verdict} at {at} m)"

    @property
    def is_trusted(self) -> bool:
        """Whether the verdict is ``trusted``."""
        return self.verdict == "trusted"

    @classmethod
    def of(cls, entry: Mapping[str, Any], index: int) -> Robot:
        """The robot of an entry of ``result.json``."""
        runner_up, tool = entry.get("runner_up"), entry.get("tool")
        poses = {name: pose(at) for name, at in entry.get("link_poses", {}).items()}
        sigma = entry["base_sigma"]
        return cls(
            id=entry["id"],
            index=index,
            model=entry["model"],
            verdict=entry["verdict"],
            reasons=tuple(entry.get("reasons", ())),
            base_link=entry["base_link"],
            base_pose=pose(entry["base_pose"]),
            base_sigma=BaseSigma(tuple(sigma["xyz"]), tuple(sigma["rotation"])),
            joints=dict(entry["joints"]),
            sigma=dict(entry["sigma"]),
            certainty=dict(entry.get("certainty", {})),
            passive=dict(entry.get("passive", {})),
            slides=tuple(entry.get("slides", ())),
            links=tuple(entry["links"]),
            link_poses=poses,
            score=entry.get("score"),
            rms=entry.get("rms"),
            tip_sigma=entry.get("tip_sigma"),
            runner_up=None if runner_up is None else _made(RunnerUp, runner_up),
            tool=None if tool is None else _made(Tool, tool),
            alike=tuple(entry.get("alike", ())),
            evidence=tuple(_made(LinkEvidence, one) for one in entry.get("evidence", ())),
            stands_in=tuple(entry.get("stands_in", ())),
            stays=tuple(cls.of(stay, index) for stay in entry.get("stays", ())),
            entry=entry,
        )


def _made(kind: Any, entry: Mapping[str, Any]) -> Any:
    """A dataclass of those fields of an entry that it knows: entries grow by fields."""
    return kind(**{name: entry.get(name) for name in kind.__dataclass_fields__})
