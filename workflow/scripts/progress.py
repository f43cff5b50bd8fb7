"""How far a sweep is: a bar on a terminal, lines in the log."""

import logging
import sys
import time

_SECONDS_BETWEEN_LINES = 10


class Progress:
    """Told how many cases are finished, shows it with rate and time left."""

    def __init__(self, name):
        self.name = name
        self.start = self.shown = None
        self.first = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if sys.stderr.isatty() and self.start is not None:
            sys.stderr.write("\n")

    def __call__(self, done, total):
        """Show how far it is, the log at most every ten seconds."""
        now = time.monotonic()
        if self.start is None:
            self.start, self.first = now, done
        seconds = now - self.start
        rate = (done - self.first) / seconds if seconds else 0.0
        left = f"{(total - done) / rate:.0f} s left" if rate else "time left unknown"
        text = f"{self.name}: {done} of {total} cases, {rate:.1f} cases/s, {left}"
        if sys.stderr.isatty():
            full = round(30 * done / total) if total else 30
            sys.stderr.write(f"\r[{'#' * full}{'.' * (30 - full)}] {text}\033[K")
            sys.stderr.flush()
        if self.shown is None or now - self.shown >= _SECONDS_BETWEEN_LINES or done == total:
            logging.info(text)
            self.shown = now
