"""Progress of a long run, on standard error."""

import sys
import time

_BEGAN = time.monotonic()


def report(message: str) -> None:
    """Print a line with the time since the start."""
    print(f"fit: {(time.monotonic() - _BEGAN) / 60:5.1f} min: {message}", file=sys.stderr, flush=True)
