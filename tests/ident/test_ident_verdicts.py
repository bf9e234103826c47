"""The words for what the data say of a parameter."""

import math

import pytest

from helisim.ident import FittedParameter, Parameter
from helisim.ident.fitted import SUPPORT


def support(value, bound, insensitivity, *, fixed=False, at_bound=False, degenerate=False):
    known = Parameter("K", "1", 1.0, fixed=fixed)
    return FittedParameter(known, value, bound, insensitivity, 0.0, at_bound, degenerate).support


@pytest.mark.parametrize(
    ("bound", "insensitivity", "word"),
    [
        (0.4, 0.2, "good"),  # 20 % and 10 % of 2: the guidelines themselves are met
        (0.41, 0.2, "poor"),
        (0.4, 0.21, "poor"),
        (1e9, 1e9, "poor"),
        (math.inf, 0.1, "degenerate"),
        (math.inf, math.inf, "not seen"),
    ],
)
@pytest.mark.parametrize("value", [2.0, -2.0])
def test_support_is_by_the_guidelines_of_the_value(value, bound, insensitivity, word):
    """CR up to 20 % and I up to 10 % of the value (Tischler and Remple), whatever its sign."""
    assert support(value, bound, insensitivity) == word
    assert word in SUPPORT


def test_a_zero_is_supported_only_by_an_exact_one():
    """No bound is small beside a zero."""
    assert support(0.0, 1e-9, 1e-9) == "poor"
    assert support(0.0, 0.0, 0.0) == "good"


def test_what_the_search_or_the_user_decided_comes_before_the_figures():
    """A given value has no support to judge; a limit's value is the limit's, not the data's."""
    assert support(2.0, 0.0, 0.0, fixed=True) == "fixed"
    assert support(2.0, 0.1, 0.1, at_bound=True) == "at bound"
    assert support(2.0, 0.1, 0.1, degenerate=True) == "degenerate"
    assert support(2.0, math.inf, math.inf, at_bound=True) == "not seen"
