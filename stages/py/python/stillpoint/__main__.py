"""``python -m stillpoint``: the command line, for machines where only the package is installed."""

import sys

from . import _stillpoint
from ._errors import (
    BadInputError,
    Error,
    Interrupted,
    LimitError,
    UsageError,
)

#: Exit codes of the command line; 1 for all other errors.
CODES: list[tuple[type[Error], int]] = [
    (UsageError, 2),
    (BadInputError, 4),
    (LimitError, 5),
    (Interrupted, 130),
]


def main() -> int:
    """Run the command line with the arguments of the process; returns its exit code."""

    def say(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    def progress(stage: str, done: int, total: int | None) -> None:
        say(f"{stage}: {done}" if total is None else f"{stage}: {done} of {total}")

    try:
        code, text, warnings, notes = _stillpoint.call(sys.argv[1:], progress, say)
    except Error as error:
        say(f"error: {error}")
        return next((code for kind, code in CODES if isinstance(error, kind)), 1)
    for line in [*(f"warning: {text}" for text in warnings), *notes]:
        say(line)
    print(text.rstrip())
    return code


if __name__ == "__main__":
    sys.exit(main())
