"""Tables of tests as text beside them: the rows of test_a.py's tests are in test_a.txt.

A section [test_name] has that test's rows, each as Python writes it, with the names of the test's
file and of helisim's errors.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from helisim.base import errors


def tabled(*arguments: str) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that gives a test the rows of its section."""

    def given(test: Callable[..., Any]) -> Any:
        names = test.__globals__
        text = Path(names["__file__"]).with_suffix(".txt").read_text(encoding="utf-8")
        rows = text.partition(f"[{test.__name__}]\n")[2].partition("\n[")[0].splitlines()
        each = [eval(row, names, vars(errors)) for row in rows if row]
        return pytest.mark.parametrize(arguments, each)(test)

    return given
