"""Tables of tests as text beside them: the rows of test_a.py's tests are in test_a.txt.

A section [test_name] has that test's rows, each as Python writes it, with the names of the test's
file, of helisim's errors, and np, math and hs; lines that begin with # are remarks.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helisim
from helisim.base import errors

NAMES = {**vars(errors), "math": math, "np": np, "hs": helisim}
"""What rows know besides the names of their test's file."""


def tabled(*arguments: str) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that gives a test the rows of its section."""

    def given(test: Callable[..., Any]) -> Any:
        names = test.__globals__
        text = Path(names["__file__"]).with_suffix(".txt").read_text(encoding="utf-8")
        rows = text.partition(f"[{test.__name__}]\n")[2].partition("\n[")[0].splitlines()
        each = [eval(row, names, NAMES) for row in rows if row and row[0] != "#"]
        return pytest.mark.parametrize(",".join(arguments), each)(test)

    return given
