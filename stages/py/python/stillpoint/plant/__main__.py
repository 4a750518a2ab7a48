"""``python -m stillpoint.plant``: a job as tasks of a Ray cluster, with progress on the terminal."""

import argparse
import json
import sys

from . import JobFailed, run
from ._driver import drive
from ._job import Job
from ._progress import Terminal


def _parser():
    parser = argparse.ArgumentParser(
        prog="python -m stillpoint.plant",
        description="Finds the robots of a plant on the machines of a Ray cluster that share a disk.",
        epilog="Options of `stillpoint run` follow after --, for example: -- --set fit.beam=150 --lean",
    )
    parser.add_argument("inputs", nargs="+", metavar="INPUT", help="scan files, on the shared disk")
    parser.add_argument("--robots", required=True, metavar="DIR", help="robot library, on the shared disk")
    parser.add_argument("--out", required=True, metavar="DIR", help="output folder, on the shared disk")
    parser.add_argument("--address", metavar="HOST:PORT", help="head of the Ray cluster (default: this machine alone)")
    parser.add_argument("--program", metavar="FILE", default="stillpoint", help="the program, on every machine")
    parser.add_argument("--attempts", type=int, default=4, metavar="N", help="most starts of a shard that fails (default: 4)")
    parser.add_argument("--patience", type=float, default=600, metavar="SECONDS",
                        help="how long a cluster that is lost is waited for (default: 600)")
    parser.add_argument("--keep-going", action="store_true", help="go on without files and robots that fail, and exit with code 3")
    parser.add_argument("--events", action="store_true", help="print events as lines of JSON in place of progress")
    return parser


def main(argv=None):
    argv = list(sys.argv[1:] if argv is None else argv)
    if argv[:1] == ["--drive"]:
        return drive(Job.from_json(argv[1]))
    own, more = (argv[: argv.index("--")], argv[argv.index("--") + 1 :]) if "--" in argv else (argv, [])
    args = _parser().parse_args(own)
    show = (lambda event: print(json.dumps(event), flush=True)) if args.events else Terminal()
    try:
        done = run(
            args.inputs, args.robots, args.out, address=args.address, program=args.program, flags=more,
            attempts=args.attempts, patience=args.patience, keep_going=args.keep_going, on_event=show,
        )
    except JobFailed as error:
        print(f"error: {error}", file=sys.stderr)
        return error.code
    except KeyboardInterrupt:
        print("error: interrupted; what was made is kept, and the next start goes on from it", file=sys.stderr)
        return 130
    if not args.events:
        print(done.summary)
    return 3 if done.partial else 0


if __name__ == "__main__":
    sys.exit(main())
