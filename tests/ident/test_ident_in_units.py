"""Results in degrees, feet and percent of control: what a fit of data in those units finds.

Factors: 1 rad = 57.29577951 deg; 1 ft = 0.3048 m, exact (international yard and pound agreement,
1959); percent of an input whose range is 1.
"""

import control
import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.base.units import UserUnits, parts, unit_text
from helisim.ident import FrequencyResponse, Parameter, Structure, identify, structures
from helisim.ident.evaluate import response
from helisim.ident.in_units import dimensions, fit_in
from helisim.records.record import CHANNELS

DEG, FT = 57.29577951308232, 1.0 / 0.3048
ALL = UserUnits.of("deg,ft,percent")
OMEGA = np.geomspace(1.0, 30.0, 40)
VALUES = {
    "heave": {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03},
    "yaw_base": {"N_r": -1.0, "N_ped": 73.0, "tau_r_base": 0.05},
    "rollpitch": {
        "tau_f": 0.06, "L_b": 700.0, "M_a": 400.0, "A_b": -0.2, "B_a": 0.3, "A_lat": 0.02,
        "A_lon": 0.2, "B_lat": 0.2, "B_lon": -0.02, "tau_lat": 0.02, "tau_lon": 0.02,
    },
}  # fmt: skip


def exact(name, scale=1.0, units=True):
    """Return the exact response of a built-in structure, its outputs and inputs scaled."""
    structure = structures.named(name)
    start = structure.with_starts(VALUES[name])
    return FrequencyResponse.exact(
        OMEGA,
        response(start, VALUES[name], OMEGA) * scale,
        inputs=structure.inputs,
        outputs=structure.outputs,
        input_units=[CHANNELS[one].unit for one in structure.inputs] if units else None,
        output_units=[CHANNELS[one].unit for one in structure.outputs] if units else None,
    )


@pytest.mark.parametrize(
    ("name", "scale"), [("heave", FT / 100), ("yaw_base", DEG / 100), ("rollpitch", DEG / 100)]
)
def test_parameters_are_those_of_data_in_the_same_units(name, scale):
    """A fit in SI, shown in other units, is the fit of a response that was recorded in them."""
    structure = structures.named(name).with_starts(VALUES[name])
    shown, notes = fit_in(identify(exact(name), structure, searches=1), ALL)
    recorded = identify(exact(name, scale, units=False), structure, searches=2)
    for one in shown:  # exact data: the searches end within their tolerance
        assert one.value == pytest.approx(recorded[one.name].value, rel=1e-4), one.name
    assert notes == ()


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        ("M_u", "deg/(s ft)", DEG * 0.3048),
        ("X_u", "1/s", 1.0),
        ("L_b", "1/s^2", 1.0),
        ("X_a", "ft/s^2", FT),  # by a radian of flapping: -g stays 32.17
        ("A_lon", "deg/%", DEG / 100),
        ("tau_f", "s", 1.0),
    ],
)
def test_hover_derivatives_have_the_units_of_flight_dynamics(name, unit, factor):
    """Speed derivatives by foot, control derivatives by percent, stiffnesses as they are."""
    structure = structures.hover.with_fixed(
        {one.name: one.start or 0.1 for one in structures.hover.parameters}
    )
    frf = FrequencyResponse.exact(
        OMEGA,
        response(structure, structure.starts, OMEGA),
        inputs=structure.inputs,
        outputs=structure.outputs,
        input_units=("1", "1"),
        output_units=("rad/s", "rad/s", "m/s", "m/s"),
    )
    fit = identify(frf, structure)
    shown, notes = fit_in(fit, ALL)
    (one,) = (parameter for parameter in shown if parameter.name == name)
    assert one.unit == unit
    assert one.value == pytest.approx(fit[name].value * factor, rel=1e-12)
    assert "X_a, Y_b" in notes[0]


@pytest.mark.parametrize("name", sorted(set(structures.BUILT_IN) - {"yaw_gyro", "yaw_sway"}))
def test_stated_units_are_those_of_the_places(name):
    """What a structure states agrees, in metres and seconds, with where its parameters stand."""
    structure = structures.named(name)
    signals = {one: CHANNELS[one].unit for one in (*structure.inputs, *structure.outputs)}
    full = dimensions(structure, signals)
    assert set(full) == set(structure.names)
    for one in structure.parameters:
        stated = parts(one.unit)
        for part in ("m", "s") if stated is not None else ():
            assert stated.get(part, 0) == full[one.name].get(part, 0), one.name


def test_what_a_structure_does_not_tell_stays_and_is_told():
    """A gyro counts in units of its own, and signals without units tell nothing."""
    structure = structures.yaw_base.with_starts(VALUES["yaw_base"])
    frf = FrequencyResponse.exact(
        OMEGA,
        response(structure, VALUES["yaw_base"], OMEGA),
        inputs=("nose",),
        outputs=("turn",),
    )
    fit = identify(frf, structure.renamed({"ped": "nose", "r": "turn"}), searches=1)
    shown, notes = fit_in(fit, ALL)
    by_name = {one.name: one for one in shown}
    assert by_name["N_ped"].value == fit["N_ped"].value
    assert by_name["N_ped"].unit == "1/s^2"
    assert "N_ped" in notes[0]
    assert list(by_name) == list(structure.names)
    bare = fit.data.in_units(ALL)
    assert np.array_equal(bare.response, fit.data.response)
    assert bare.output_units == ("",)


def test_a_root_tells_no_unit():
    """What stands under a root, or beside one, doesn't follow; the rest of the model does."""
    known = Parameter("k", "1", 1.0), Parameter("j", "1", 1.0), Parameter("n", "1/s", -1.0)
    structure = Structure(
        "root", known, ("r",), ("ped",), ("r",), F=(("n",),), G=(("sqrt(k) * j",),)
    )
    assert dimensions(structure, {"ped": "1", "r": "rad/s"}) == {"n": {"s": -1}}


def test_a_response_is_shown_in_units_and_means_the_same():
    """A gain in rad/s by the range is so many deg/s by percent; python-control agrees on both."""
    shown = exact("yaw_base").in_units(ALL)
    assert (shown.input_units, shown.output_units) == (("%",), ("deg/s",))
    plant = control.tf([73.0 * DEG / 100], [1.0, 1.0])
    wanted = plant(1j * OMEGA) * np.exp(-0.05j * OMEGA)
    assert shown.response[0, 0] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "powers"),
    [
        ("rad/(s m)", {"rad": 1, "s": -1, "m": -1}),
        ("1/s^2", {"s": -2}),
        ("m/s^2", {"m": 1, "s": -2}),
        ("s/rad", {"s": 1, "rad": -1}),
        ("N m", {"N": 1, "m": 1}),
        ("1", {}),
    ],
)
def test_units_are_taken_apart_and_put_together(text, powers):
    """The text comes back as it was."""
    assert parts(text) == powers
    assert unit_text(powers) == text


@pytest.mark.parametrize("text", ["", "SI", "rad//s", "?"])
def test_a_unit_that_is_none_is_not_guessed(text):
    """Unknown, or not of powers."""
    assert parts(text) is None


@pytest.mark.parametrize(
    ("text", "says"), [("furlong", "available: rad, deg, m, ft"), ("deg,rad", "second unit")]
)
def test_units_that_results_can_not_have_are_refused(text, says):
    """The message lists what there is."""
    with pytest.raises(InputError, match=says):
        UserUnits.of(text)
