"""Progress on the terminal."""

import sys
import time


class Terminal:
    """Shows events on standard error: one line that changes on a terminal, lines elsewhere."""

    def __init__(self):
        self.is_terminal = sys.stderr.isatty()
        self.begun = time.monotonic()

    def __call__(self, event):
        kind = event["event"]
        if kind == "shard":
            self._say(f"{event['done']}/{event['shards']} shards, about {event['seconds_left']:.0f} processor seconds left: "
                      f"{event['what']} ({event['seconds']:.1f} s)", lasts=not self.is_terminal)
        elif kind == "failure":
            self._say(f"failed, attempt {event['attempt']}: {event['what']}: {event['why']}")
        elif kind == "lost":
            self._say(f"the cluster cannot be reached: {event['why']}")
        elif kind == "restart":
            self._say("the cluster was lost: another driver starts, and goes on with what is missing")

    def _say(self, text, lasts=True):
        text = f"[{time.monotonic() - self.begun:7.1f} s] {text}"
        if self.is_terminal:
            text = "\r\x1b[K" + text + ("\n" if lasts else "")
        else:
            text += "\n"
        sys.stderr.write(text)
        sys.stderr.flush()
