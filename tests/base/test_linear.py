"""Linear systems with named signals."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem

LAG = LinearSystem([[-2.0]], [[1.0, 3.0]], [[1.0]], [[0.0, 0.0]], None, ("u", "v"), ("y",))


@pytest.mark.parametrize("period", [0.0, -0.1, math.nan, math.inf, "fast"])
def test_a_period_that_is_none_is_refused(period):
    """Before anything is computed with it."""
    with pytest.raises(InputError, match=r"period must be a .*number above 0 s, got"):
        LAG.discretise(period)


def test_one_frequency_is_a_response_of_one():
    """1 / (s + 2) and 3 / (s + 2) at s = 2j."""
    assert LAG.response(2.0)[0, :, 0] == pytest.approx(np.array([1.0, 3.0]) / (2.0 + 2.0j))


def test_delays_of_inputs_that_were_left_out_are_no_states():
    """Those of the others are: two periods are two states."""
    late = replace(LAG.discretise(0.1), delays={"u": 0.3, "v": 0.2})
    found = late.select(["v"]).with_delays_as_states()
    assert found.states == ("x[0]", "v_1_ago", "v_2_ago")
    omega = np.array([0.5, 5.0])
    assert found.response(omega) == pytest.approx(late.select(["v"]).response(omega))
