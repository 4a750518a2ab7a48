"""Exceptions of the package: what went wrong, where, why, and what to do about it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Self


class Error(Exception):
    """Any failure of stillpoint.

    ``str(error)`` is the whole message, as on the command line.

    Attributes
    ----------
    place : str | None
        Where it happened: a file with a place in it, a flag, or an argument.
    cause : str | None
        What another library or the system said.
    way_out : str | None
        What to do about it.
    """

    def __init__(
        self,
        message: str,
        place: str | None = None,
        cause: str | None = None,
        way_out: str | None = None,
    ) -> None:
        # All parts are arguments, so that the exception passes between processes.
        super().__init__(message, place, cause, way_out)
        self.place = place
        self.cause = cause
        self.way_out = way_out

    @classmethod
    def of(
        cls,
        what: str,
        place: str | None = None,
        cause: str | None = None,
        way_out: str | None = None,
    ) -> Self:
        """An error with the message that its parts make, as on the command line."""
        message = what if place is None else f"{place}: {what}"
        message += "" if cause is None else f" ({cause})"
        message += "" if way_out is None else f"; {way_out}"
        return cls(message, place, cause, way_out)

    def __str__(self) -> str:
        return str(self.args[0])

    @property
    def file(self) -> Path | None:
        """The file that the place names, if it names one."""
        head = (self.place or "").split(": ")[0]
        is_file = os.sep in head or os.path.splitext(head)[1] != "" or os.path.exists(head)
        return Path(head) if head and is_file else None


class UsageError(Error, ValueError):
    """Arguments or settings that cannot be, or that contradict one another (exit code 2)."""


class BadInputError(Error):
    """A file that is missing, broken or contradicts itself (exit code 4)."""


class UnsupportedError(BadInputError):
    """A file that may be valid, but is of a kind that is not read (exit code 4)."""


class LimitError(Error):
    """More memory or disk is needed than is allowed or there (exit code 5)."""


class AccessError(Error):
    """The system refused: a disk, a permission, a network share (exit code 1)."""


class Interrupted(Error, KeyboardInterrupt):
    """Ctrl-C was pressed (exit code 130). The same call goes on from what was done.

    It is a :class:`KeyboardInterrupt` as well, so that ``except KeyboardInterrupt`` catches it.
    """


class BugError(Error):
    """A fault of stillpoint itself, to be reported (exit code 1)."""
