"""Tables of what is refused, as text beside a test: for test_a.py in test_a.txt.

A section [test_name] has that test's rows, each as Python writes them, with the test's own names.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def refused(*arguments: str) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that gives a test the rows of its section."""

    def given(test: Callable[..., Any]) -> Any:
        names = test.__globals__
        text = Path(names["__file__"]).with_suffix(".txt").read_text(encoding="utf-8")
        rows = text.partition(f"[{test.__name__}]\n")[2].partition("\n[")[0].splitlines()
        return pytest.mark.parametrize(arguments, [eval(row, names) for row in rows if row])(test)

    return given
