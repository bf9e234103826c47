"""How far a command is: a bar on a terminal, a line now and then in a log file."""

import sys
import time
from collections.abc import Callable

from tqdm import tqdm

_SILENT = 3.0
"""s, before the first line in a log file: most commands are done by then."""
_INTERVAL = 10.0
"""s between two lines of a log file."""


class Progress:
    """Show how many steps of a command are done, on standard error, unless it shall be quiet.

    Args:
        steps: in all; None if that is not known.
        quiet: True shows nothing.
        unit: what a step is called.
    """

    def __init__(self, steps: int | None, quiet: bool, unit: str = "step") -> None:
        self._steps, self._unit, self._done = steps, unit, 0
        self._bar = tqdm(total=steps, disable=quiet or None, unit=unit, leave=False)
        self._writes_lines = not quiet and not sys.stderr.isatty()
        self._start = time.monotonic()
        self._next = self._start + _SILENT

    def __enter__(self) -> Callable[[str], None]:
        return self._advance

    def _advance(self, label: str) -> None:
        self._done += 1
        self._bar.set_description(label)
        self._bar.update()
        now = time.monotonic()
        if self._writes_lines and now >= self._next:
            self._next = now + _INTERVAL
            of_all = "" if self._steps is None else f" of {self._steps}"
            print(
                f"{label}: {self._unit} {self._done}{of_all}, {now - self._start:.0f} s",
                file=sys.stderr,
                flush=True,
            )

    def __exit__(self, *_: object) -> None:
        self._bar.close()
