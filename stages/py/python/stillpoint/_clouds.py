"""LAS files that the program writes, as records mapped read-only."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import BadInputError

#: Length of a header of LAS 1.4, bytes.
HEADER = 375
#: Length of a record of point formats 6 and 7, without extra bytes.
RECORD = {6: 30, 7: 36}


@dataclass(frozen=True, eq=False)
class Cloud:
    """A cloud on disk. Nothing is read until points are asked for.

    Records are packed, so that the columns of ``records`` are views without alignment: NumPy reads
    them right, but copy a column (``numpy.ascontiguousarray``) before it goes to code that is not
    NumPy's.
    """

    path: Path
    #: One record a point, read-only: ``X``, ``Y``, ``Z`` in steps, ``intensity``, ``class`` (2 floor,
    #: 64 fixed, 65 link, 66 attachment, 69 uncertain), ``source_id``, ``robot`` and ``link`` (from 1;
    #: 0 for none), and ``gps_time``; with ``red``, ``green``, ``blue`` where the inputs have colour.
    records: NDArray[np.void]
    #: Length of one step on each axis, metres.
    scale: NDArray[np.float64]
    #: Coordinate of step zero on each axis, metres.
    offset: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.records)

    def xyz(self, start: int = 0, stop: int | None = None) -> NDArray[np.float64]:
        """World coordinates of some points, float64, N x 3, metres: a copy."""
        part = self.records[start:stop]
        out = np.empty((len(part), 3))
        for axis, name in enumerate("XYZ"):
            out[:, axis] = part[name] * self.scale[axis] + self.offset[axis]
        return out

    def chunks(self, n: int = 1 << 20) -> Iterator[NDArray[np.float64]]:
        """World coordinates of all points, ``n`` at a time."""
        for start in range(0, len(self), n):
            yield self.xyz(start, start + n)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Cloud:
        """Map a cloud of a result.

        Raises
        ------
        BadInputError
            The file is missing, compressed, cut short, or not one of this program.
        """
        place = Path(path)

        def bad(what: str, hint: str, cause: Exception | None = None) -> BadInputError:
            why = None if cause is None else str(cause)
            return BadInputError.of(what, str(place), why, hint)

        again = "run the same job again"
        try:
            with place.open("rb") as file:
                head = file.read(HEADER)
                length = os.fstat(file.fileno()).st_size
        except OSError as error:
            hint = "runs with lean or compressed clouds have none: Result.iter_points reads the tiles"
            raise bad("it cannot be opened", hint, error) from error
        if len(head) < HEADER or head[:4] != b"LASF" or head[24:26] != b"\x01\x04":
            raise bad("this is not LAS 1.4", again)
        (at,) = struct.unpack_from("<I", head, 96)
        kind = head[104]
        (record,) = struct.unpack_from("<H", head, 105)
        (n,) = struct.unpack_from("<Q", head, 247)
        if kind not in RECORD or record < RECORD[kind] + 4:
            raise bad("its records are not those of a result", again)
        if at + n * record > length:
            raise bad(f"it has {length} bytes, and states {n} points of {record}", again)
        numbers = np.frombuffer(head, "<f8", 6, 131)
        layout = _layout(kind, record)
        records: Any = np.empty(0, layout)
        if n > 0:
            records = np.memmap(place, layout, "r", at, (n,))
        records.flags.writeable = False
        return cls(place, records, numbers[:3].copy(), numbers[3:].copy())


def _layout(kind: int, record: int) -> np.dtype[np.void]:
    fields = {
        "X": ("<i4", 0), "Y": ("<i4", 4), "Z": ("<i4", 8), "intensity": ("<u2", 12),
        "class": ("u1", 16), "source_id": ("<u2", 20), "gps_time": ("<f8", 22),
    }  # fmt: skip
    if kind == 7:
        fields |= {"red": ("<u2", 30), "green": ("<u2", 32), "blue": ("<u2", 34)}
    fields |= {"robot": ("<u2", RECORD[kind]), "link": ("<u2", RECORD[kind] + 2)}
    return np.dtype(
        {
            "names": list(fields),
            "formats": [of for of, _ in fields.values()],
            "offsets": [at for _, at in fields.values()],
            "itemsize": record,
        }
    )
