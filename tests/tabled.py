"""Tables and programs of tests as text beside them: those of test_a.py are in test_a.txt.

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


def section(names: dict[str, Any], name: str) -> str:
    """Return the text of a section beside the file with these global names."""
    text = Path(names["__file__"]).with_suffix(".txt").read_text(encoding="utf-8")
    return text.partition(f"[{name}]\n")[2].partition("\n[")[0]


def rows(names: dict[str, Any], name: str) -> list[Any]:
    """Return the rows of a section beside the file with these global names."""
    lines = section(names, name).splitlines()
    return [eval(row, names, NAMES) for row in lines if row and row[0] != "#"]


def tabled(*arguments: str) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that gives a test the rows of its section."""

    def given(test: Callable[..., Any]) -> Any:
        each = rows(test.__globals__, test.__name__)
        return pytest.mark.parametrize(",".join(arguments), each)(test)

    return given
