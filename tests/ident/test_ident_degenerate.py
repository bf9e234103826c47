"""Degenerate fits: more dynamics than the data have are found, named, and the right order advised.

The data are computed here from zeros and poles; whatever is fitted beyond them is too much.
"""

import json

import numpy as np
import pytest

from helisim.ident import Fit, FrequencyResponse, Parameter, Structure, identify, structures

FREQUENCY = np.geomspace(0.1, 10.0, 80)


def measured(num, den, noise=0.01, seed=0):
    s = 1j * FREQUENCY
    wobble = np.random.default_rng(seed).normal(size=(2, s.size))
    response = np.polyval(num, s) / np.polyval(den, s) * np.exp(-0.1 * s)
    noisy = response * (1.0 + noise * (wobble[0] + 1j * wobble[1]))
    return FrequencyResponse.exact(FREQUENCY, noisy[None, None], inputs=["u"], outputs=["y"])


GAIN = ((2.0,), (1.0,))
LAG = ((2.0,), (1.0, 0.7))
INTEGRATOR = ((2.0,), (1.0, 0.0))
MODE = ((3.0,), (1.0, 1.2, 4.0))


def order(zeros, poles):
    return structures.transfer_function(zeros=zeros, poles=poles, input="u", output="y")


@pytest.mark.parametrize(
    ("plant", "noise", "fitted", "advised"),
    [
        (GAIN, 0.01, (0, 1), "tf:0/0"),
        (LAG, 0.0, (0, 2), "tf:0/1"),
        (LAG, 0.05, (0, 2), "tf:0/1"),
        (LAG, 0.01, (1, 2), "tf:0/1"),
        (INTEGRATOR, 0.01, (1, 2), "tf:0/1"),
        (MODE, 0.01, (1, 2), "tf:0/2"),
        (MODE, 0.01, (2, 3), "tf:0/2"),
    ],
)
def test_a_transfer_function_of_too_high_order_is_reduced(plant, noise, fitted, advised):
    """A pole far away, on a zero, a coefficient not seen: the true order is advised."""
    fit = identify(measured(*plant, noise), order(*fitted))
    assert f"fit {advised} instead" in fit.degenerate[0]
    assert fit.degenerate[0] in str(fit)
    assert fit.judged == "degenerate"
    assert not fit.ok
    assert {one.support for one in fit.parameters.values()} <= {"degenerate", "not seen"}
    assert Fit.from_dict(json.loads(json.dumps(fit.to_dict()))).degenerate == fit.degenerate


@pytest.mark.parametrize(
    ("plant", "fitted"),
    [(LAG, (0, 1)), (INTEGRATOR, (0, 1)), (MODE, (0, 2)), (MODE, (0, 1))],
)
def test_the_right_order_and_too_low_a_one_are_not_degenerate(plant, fitted):
    """An integrator's pole is not known to its own size, yet needed; so is all of too low one."""
    fit = identify(measured(*plant), order(*fitted))
    assert fit.degenerate == ()
    assert fit["tau"].support != "degenerate"


def test_the_reason_is_said():
    """Each kind by its own words, with the numbers that show it."""
    far = identify(measured(*GAIN), order(0, 1)).degenerate[0]
    assert "rad/s is far above the band's 10 rad/s" in far
    assert "a zero cancels the pole at 0.2" in identify(measured(*LAG), order(1, 2)).degenerate[0]


def lagging(start, fixed=False):
    """A lag T that the band may not see, before a first-order plant."""
    return Structure(
        name="lagging",
        parameters=(
            Parameter("K", "1", 1.0),
            Parameter("a", "1/s", 1.0),
            Parameter("T", "s", start, (1e-9, 10.0), fixed=fixed),
            Parameter("tau", "s", 0.0, (-0.3, 5.0), scale=0.03),
        ),
        states=("y", "x"),
        inputs=("u",),
        outputs=("y",),
        M=(("1", "0"), ("0", "T")),
        F=(("-a", "K"), ("0", "-1")),
        G=(("0",), ("1",)),
        input_delays={"u": "tau"},
    )


def test_a_lag_beyond_the_band_is_degenerate_in_any_structure():
    """T without any effect is named, and the delay that stands in for it is no longer good."""
    fit = identify(measured(*LAG), lagging(0.1))
    assert fit["T"].value < 0.02  # 5 times the band's top
    assert "fix T" in fit.degenerate[0]
    assert fit["T"].support == fit["tau"].support == "degenerate"
    assert fit["a"].support == "good"
    given = identify(measured(*LAG), lagging(1e-3, fixed=True))
    assert given.degenerate == ()
    assert given["tau"].support == "good"
