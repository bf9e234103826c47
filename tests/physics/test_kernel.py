"""The force laws as MuJoCo's callbacks have them: compiled, from the same source."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from numba.core.errors import TypingError

import interpreted
from helisim.physics import rotor
from helisim.physics import rotor as rotors
from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import Velocities

pytestmark = pytest.mark.skipif(
    interpreted.wanted(), reason="the force laws are interpreted here: nothing is compiled"
)

speed, rate, stick = st.floats(-8.0, 8.0), st.floats(-2.0, 2.0), st.floats(-0.5, 0.5)
main_rotor = njit(rotors.main_rotor)


@given(u=speed, v=speed, w=speed, p=rate, q=rate, collective=stick)
def test_compiled_laws_give_what_python_gives(jr700, u, v, w, p, q, collective):
    par = jr700.model.actuator_user[jr700.model.actuator("rotor").id]
    given_ = (par, Velocities(u, v, w, p, q, 0.0), 1.0, collective, (0.03, 0.06), (0.02, 0.0))
    # LLVM may turn x**2 and the like into other operations: some units in the last place
    assert main_rotor(*given_) == pytest.approx(rotors.main_rotor(*given_), rel=1e-12, abs=1e-12)


def test_compiled_code_knows_the_index_of_each_name():
    @njit
    def places():
        return PARAM.magic, PARAM.dropout_r, STATE.flap_b, STATE.flap_b - STATE.flap_a

    assert places() == (0, len(PARAM) - 1, STATE.flap_b, 1)


def test_a_name_that_does_not_exist_is_not_compiled():
    @njit
    def wrong(numbers):
        return numbers[PARAM.main_raduis]  # pyright: ignore[reportAttributeAccessIssue]

    with pytest.raises(TypingError, match="main_raduis"):
        wrong(np.zeros(4))


def test_compiled_division_by_zero_is_infinite():
    """As in C: the flight then counts as diverged, and no exception gets lost in a callback."""

    @kernel()
    def divided(x, y):
        return x / y

    @njit
    def called(x, y):
        return divided(x, y)

    assert called(1.0, 0.0) == math.inf
    assert njit(rotor.soft_limit)(math.inf, 1.0, 0.7) == pytest.approx(1.0)
