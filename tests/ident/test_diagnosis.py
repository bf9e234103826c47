"""Fits that are not to be believed say so: degenerate, doubtful, at fault by units or columns."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from helisim.ident import (
    Fit,
    FittedParameter,
    Parameter,
    Structure,
    identify,
    structures,
    suspicions,
)
from helisim.ident.fitted import SUPPORT
from ident_data import data
from tabled import tabled

WIDE = np.geomspace(0.1, 10.0, 80)
GAIN = ((2.0,), (1.0,))
LAG = ((2.0,), (1.0, 0.7))
INTEGRATOR = ((2.0,), (1.0, 0.0))
MODE = ((3.0,), (1.0, 1.2, 4.0))


def measured(num, den, noise=0.01):
    s = 1j * WIDE
    return data(np.polyval(num, s) / np.polyval(den, s) * np.exp(-0.1 * s), WIDE, noise=noise)


def order(zeros, poles):
    return structures.transfer_function(zeros=zeros, poles=poles, input="u", output="y")


@tabled("plant", "noise", "fitted", "advised")
def test_a_transfer_function_of_too_high_order_is_reduced(plant, noise, fitted, advised):
    """A pole far away, on a zero, a coefficient not seen: the true order is advised."""
    fit = identify(measured(*plant, noise), order(*fitted))
    assert f"fit {advised} instead" in fit.degenerate[0]
    assert fit.degenerate[0] in str(fit)
    assert (fit.verdict.word, fit.verdict.reasons[0].text) == ("wrong", fit.degenerate[0])
    assert {one.support for one in fit.parameters.values()} <= {"degenerate", "not seen"}
    assert Fit.from_dict(json.loads(json.dumps(fit.to_dict()))).degenerate == fit.degenerate


@pytest.mark.parametrize(("plant", "fitted"), [(INTEGRATOR, (0, 1)), (MODE, (0, 2))])
def test_the_right_order_and_too_low_a_one_are_not_degenerate(plant, fitted):
    """An integrator's pole is not known to its own size, yet needed; so is all of too low one."""
    fit = identify(measured(*plant), order(*fitted))
    assert fit.degenerate == ()
    assert fit["tau"].support != "degenerate"


def test_a_lag_beyond_the_band_is_degenerate_in_any_structure():
    """T without any effect is named, and the delay that stands in for it is no longer good."""
    lagging = Structure(
        name="lagging",
        parameters=(
            Parameter("K", "1", 1.0),
            Parameter("a", "1/s", 1.0),
            Parameter("T", "s", 0.1, (1e-9, 10.0)),
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
    fit = identify(measured(*LAG), lagging)
    assert fit["T"].value < 0.02  # 5 times the band's top
    assert "fix T" in fit.degenerate[0]
    assert fit["T"].support == fit["tau"].support == "degenerate"
    assert fit["a"].support == "good"
    given = identify(measured(*LAG), lagging.with_fixed({"T": 1e-3}))
    assert given.degenerate == ()
    assert given["tau"].support == "good"


OMEGA = np.geomspace(1.0, 30.0, 60)
S = 1j * OMEGA
FLAPPING = 5200.0 / (S**2 + 27.0 * S + 572.0) * np.exp(-0.012 * S)


def test_an_unstable_pole_that_stands_for_a_lag_is_told():
    """One pole takes the place of two, beyond the right edge, with ten times the delay.

    A slow unstable mode, as a hover's phugoid, is the vehicle's own and no reason to doubt.
    """
    wrong, right = (identify(data(FLAPPING, OMEGA), order(0, poles)) for poles in (1, 2))
    assert wrong.excellent
    assert wrong.modes.poles[0].real > 10.0
    assert any("an unstable pole at" in one and "more states" in one for one in wrong.remarks)
    assert not any("unstable pole" in one for one in right.remarks)
    slow = 90.0 * S / (S**2 - 0.8 * S + 4.0) * np.exp(-0.1 * S)
    own = identify(data(slow, OMEGA), order(1, 2))
    assert own.modes.poles[0].real > 0.3
    assert not any("unstable" in one for one in own.remarks)


BAND = np.geomspace(1.0, 20.0, 60)


def roll(gains=None):
    """Return the structure of rate and angle over one control: the angle is the rate's integral."""
    return Structure(
        name="roll",
        meaning="roll rate and angle over lateral control",
        parameters=(
            Parameter("L_p", "1/s", -3.0, (-100.0, -0.01), "damping"),
            Parameter("L_lat", "1/s^2", 50.0, gains, "effectiveness"),
            Parameter("tau", "s", 0.02, (0.0, 0.3), "delay"),
        ),
        states=("p", "phi"),
        inputs=("lat",),
        outputs=("p", "phi"),
        F=(("L_p", 0), (1, 0)),
        G=(("L_lat",), (0,)),
        input_delays={"lat": "tau"},
    )


def rolled(p=1.0, phi=1.0, delay=0.04, swapped=False):
    """Return the roll's exact response in closed form, each output times a factor."""
    rate = 90.0 * np.exp(-1j * BAND * delay) / (1j * BAND + 6.0)
    rows = [p * rate, phi * rate / (1j * BAND)]
    names = {"inputs": ("lat",), "outputs": ("p", "phi"), "output_units": ("rad/s", "rad")}
    return data(rows[::-1] if swapped else rows, BAND, **names)


def causes(frf, structure):
    """Return kind and options of what is suspected of a fit that must fail."""
    fit = identify(frf, structure)
    assert not fit.acceptable
    found = suspicions(fit)
    return [(one.kind, *(f"{x.name} {x.value}" for x in one.remedy)) for one in found], found


def test_an_acceptable_fit_is_not_suspected():
    """Nor is one whose factor a free gain takes up."""
    for frf in (rolled(), rolled(p=57.3, phi=57.3)):
        fit = identify(frf, roll())
        assert fit.acceptable
        assert suspicions(fit) == fit.shapes == ()
        assert not any(note.remedy for note in fit.notes)


UNIT, P, PHI = "unit", "channel p=COLUMN", "channel phi=COLUMN"


@pytest.mark.parametrize(
    ("frf", "structure", "expected", "said"),
    [
        (rolled(p=180.0 / np.pi), roll(), {(UNIT, f"{P}:deg/s"), (UNIT, f"{PHI}:rad")}, ""),
        (rolled(phi=-1.0), roll(), {("sign", f"{PHI}:UNIT:sign=-1")}, ""),
        pytest.param(
            rolled(p=-1.0, phi=-1.0),
            roll((1.0, 1e4)),
            {("sign", "channel lat=COLUMN:UNIT:sign=-1")},
            "",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            rolled(swapped=True),
            roll(),
            {("columns", f"{P}_OF_phi", f"{PHI}_OF_p")},
            "the columns of p and phi swapped: J would be",
            marks=pytest.mark.slow,
        ),
        (
            rolled(delay=0.22),
            roll().with_fixed({"tau": 0.02}),
            {("delay", "fix tau=0.22")},
            "longer by about 0.2 s",
        ),
        pytest.param(
            rolled(delay=0.2),
            replace(roll(), parameters=roll().parameters[:2], input_delays={}),
            {("delay",)},
            "longer by about 0.2 s; the structure has none there",
            marks=pytest.mark.slow,
        ),
    ],
    ids=["degrees", "sign", "control's sign", "columns", "fixed delay", "no delay"],
)
def test_what_is_wrong_with_data_is_told(frf, structure, expected, said):
    """Either unit would make them fit, so both are told; a sign first, with the options' kind."""
    found, notes = causes(frf, structure)
    assert expected <= set(found)
    assert {kind for kind, *_ in found} == {kind for kind, *_ in expected}
    assert said in notes[0].text


@pytest.mark.parametrize(
    ("value", "bound", "insensitivity", "decided", "word"),
    [
        (2.0, 0.4, 0.2, {}, "good"),  # 20 % and 10 % of 2: the guidelines themselves are met
        (2.0, 0.41, 0.2, {}, "poor"),
        (2.0, 0.4, 0.21, {}, "poor"),
        (2.0, 1e9, 1e9, {}, "poor"),
        (2.0, math.inf, 0.1, {}, "degenerate"),
        (2.0, math.inf, math.inf, {}, "not seen"),
        (0.0, 1e-9, 1e-9, {}, "poor"),  # no bound is small beside a zero
        (0.0, 0.0, 0.0, {}, "good"),
        (2.0, 0.1, 0.1, {"at_bound": True}, "at bound"),
        (2.0, 0.1, 0.1, {"degenerate": True}, "degenerate"),
        (2.0, math.inf, math.inf, {"at_bound": True}, "not seen"),
        (2.0, 0.0, 0.0, {"fixed": True}, "fixed"),
    ],
)
def test_support_is_by_the_guidelines_of_the_value(value, bound, insensitivity, decided, word):
    """CR up to 20 % and I up to 10 % of the value (Tischler and Remple), whatever its sign.

    What the search or the user decided comes before the figures.
    """
    known = Parameter("K", "1", 1.0, fixed=decided.pop("fixed", False))
    for sign in (1.0, -1.0):
        one = FittedParameter(known, sign * value, bound, insensitivity, 0.0, False)
        assert replace(one, **decided).support == word
    assert word in SUPPORT
