"""Overrides of the model: whatever a parameter is set to, a vehicle loads or one line says why."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helisim.base.errors import HelisimError, ModelError, TrimError
from helisim.cli import main
from helisim.vehicle import load

NAMES = sorted(load().parameters)
VALUES = st.one_of(
    st.floats(allow_nan=False),
    st.floats(-10.0, 10.0),
    st.sampled_from([0.0, 5e-324, 1e-12, 1e9, -1e300, 1e300, float("inf")]),
)


@given(changes=st.dictionaries(st.sampled_from(NAMES), VALUES, min_size=1, max_size=3))
@settings(max_examples=40)
def test_any_override_loads_or_is_one_clear_error(changes):
    """No other exception, no warning, no linearisation with NaN, and one line of text."""
    message = ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            system = load(parameters=changes).linearize().system
        except HelisimError as error:
            message = str(error)
        else:
            assert np.all(np.isfinite(np.asarray(system.A)))
    assert len(message.splitlines()) <= 1


@pytest.mark.parametrize(
    ("name", "value", "error", "says"),
    [
        ("gyro.period", -1e300, ModelError, "must be positive"),
        ("gyro.latency", 1e9, ModelError, r"gyro\.latency is 1e\+09 s, at most 10 s"),
        ("gyro.ped_latency", 1e9, ModelError, r"gyro\.ped_latency is 1e\+09 s, at most 10 s"),
        ("main_rotor.speed", 1e300, ModelError, "out of all proportion"),
        ("tail_rotor.arm_x", -1e300, TrimError, "no hover found"),
        ("servo.swash_frequency", 1e300, ModelError, "linearisation isn't finite"),
        ("airframe.ixx", 1e9, ModelError, "airframe.ixx, airframe.iyy or airframe.izz"),
    ],
)
def test_what_fuzzing_found_is_refused_by_name(name, value, error, says):
    """Numbers that ended in MuJoCo's, scipy's or numpy's own exceptions, or in NaN."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(error, match=says) as raised:
            load(parameters={name: value}).linearize()
    assert len(str(raised.value).splitlines()) == 1


@given(text=st.one_of(st.text(max_size=12), st.sampled_from(["air.density=", "=1", "a=b=c"])))
@settings(max_examples=30)
def test_any_text_after_set_is_one_line_and_status_2(text):
    """--set takes NAME=VALUE, and everything else is said in one line."""
    assert main(["linearize", f"--set={text}"]) == 2
