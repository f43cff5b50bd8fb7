"""How far a sweep is: a bar on a terminal, lines in the log."""

import logging
import sys
import time

_SECONDS_BETWEEN_LINES = 10
_WIDTH = 30


class Progress:
    """Told how many cases are finished, shows it with rate and time left."""

    def __init__(self, name):
        self.name = name
        self.start = self.logged = None
        self.first = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.start is not None and sys.stderr.isatty():
            sys.stderr.write("\n")

    def __call__(self, done, total):
        """Show how far it is; in the log at most every ten seconds."""
        now = time.monotonic()
        if self.start is None:
            self.start, self.first = now, done
        text = f"{self.name}: {self.describe(done, total, now - self.start)}"
        if sys.stderr.isatty():
            full = _WIDTH * done // total
            sys.stderr.write(f"\r[{'#' * full}{'.' * (_WIDTH - full)}] {text}\033[K")
            sys.stderr.flush()
        if self.logged is None or now - self.logged >= _SECONDS_BETWEEN_LINES or done == total:
            logging.info(text)
            self.logged = now

    def describe(self, done, total, seconds):
        """Return how many cases are done and, once one is, their rate and the time left."""
        text = f"{done} of {total} cases"
        if done > self.first and seconds > 0:
            rate = (done - self.first) / seconds
            text += f", {rate:.1f} cases/s, {(total - done) / rate:.0f} s left"
        return text
