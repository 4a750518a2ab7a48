"""The compiled module. Import ``stillpoint`` instead."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

def call(
    args: Sequence[str],
    progress: Callable[[str, int, int | None], object] | None = None,
    note: Callable[[str], object] | None = None,
) -> tuple[int, str, list[str], list[str]]:
    """Run a command with the arguments of the command line.

    Returns exit code (0; 1 for the answer no; 3 for success in part), what it prints, warnings and
    notes. Raises :class:`stillpoint.Error`.
    """

def fit(
    scans: Sequence[tuple[str, Sequence[Sequence[float]] | None, NDArray[Any]]],
    models: Sequence[str],
    about: tuple[tuple[float, float, float], float] | None,
    scratch: str | None,
    flags: tuple[str | None, int | None, str | None, Sequence[str]],
    progress: Callable[[str, int, int | None], object] | None = None,
    note: Callable[[str], object] | None = None,
) -> str:
    """Find robots in arrays; returns them as JSON, like ``robots`` of ``result.json``.

    A scan is its name, the first three rows of its pose (world from scan), and its points.
    """

class LabelledTiles:
    """The spatial tiles of a result with labels."""

    def __new__(cls, out: str) -> LabelledTiles: ...
    def __len__(self) -> int: ...
    def tile(
        self, at: int, kinds: Sequence[int] | None, robot: int | None
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.int16], NDArray[np.int16]]:
        """Coordinates (N x 3, world, metres), kinds, robots and links of points of one tile."""
