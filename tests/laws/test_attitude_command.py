"""The attitude command law: read, written, linearised and flown."""

from dataclasses import replace

import numpy as np
import pytest
from small_laws import FULL, HOLDS, LAT

import helisim as hs
from helisim.base.errors import InputError, UnknownNameError
from helisim.design.laws.law import law_of, read_law
from helisim.vehicle.law import linearize_law

OMEGA = np.geomspace(0.2, 150.0, 60)


def test_linear_form_is_the_compiled_law_differentiated(jr700):
    """Closed form in z against central differences of what flies: 1e-9 of steps of 1e-5."""
    flying = jr700.with_controller(FULL)
    system = linearize_law(flying.controller, flying.model, flying.trim)
    linear = FULL.linear(jr700.parameters["gyro.period"])
    assert tuple(system.input_labels) == linear.inputs
    a, b, c, d = (np.asarray(getattr(system, name)) for name in "ABCD")
    z = np.exp(1j * OMEGA * system.dt)[:, None, None]
    flown = np.moveaxis(c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d, 0, -1)
    size = np.abs(flown).max(axis=-1, keepdims=True)
    assert np.all(np.abs(linear.response(OMEGA) - flown) <= 1e-9 * np.maximum(size, 1.0))
    # the matrices are the law's own, without its constant states: only rounding is left
    np.testing.assert_allclose(linear.sampled.response(OMEGA), linear.response(OMEGA), atol=1e-11)


def test_holds_the_hover(jr700):
    """A stick's step without a pilot: the attitude that it asks for, to the remnant's 0.005."""
    held = ("k_attitude", "k_velocity", "k_position", "k_heave", "k_height", "k_heading")
    hands_off = {f"pilot.{name}": 0.0 for name in held}
    vehicle = hs.load("jr700", parameters=hands_off)
    (record,) = hs.fly(vehicle, hs.Step(axis="lat", amplitude=0.2, duration=6.0), controller=HOLDS)
    asked = jr700.trim.phi + 0.6 * 0.2
    assert record["phi"][record.time > 4.0].mean() == pytest.approx(asked, abs=0.01)


def test_its_file_says_all_of_it(tmp_path):
    made = {"by": "hand", "specifications": [{"axis": "lat", "least": 45.0}], "of": {"seed": 3}}
    law = replace(FULL, provenance=made)
    law.write(tmp_path / "law.toml")
    assert read_law(tmp_path / "law.toml") == law != FULL


def test_replace_changes_what_is_tuned():
    names = FULL.parameters()
    moved = FULL.replace({name: 1.01 * value for name, value in names.items()})
    assert moved.parameters() == {name: 1.01 * value for name, value in names.items()}
    with pytest.raises(UnknownNameError, match=r"'lat\.k_rat'.*did you mean lat\.k_rate"):
        FULL.replace({"lat.k_rat": 1.0})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "attitude"}, "unknown kind of law 'attitude'; available: attitude_command"),
        ({"version": 2}, "version 2: this helisim reads version = 1"),
        ({"roll": {}}, "unknown name in the law 'roll'.*called by its servo command: lat"),
        ({"ped": None}, "attitude_command needs ped"),
        ({"lat": {"stick": 1.0}}, "lat needs frequency and k_angle and k_rate"),
        (
            {"lat": {"k_rte": 1.0}},
            ".lat 'k_rte'.*did you mean k_rate",
        ),
        ({"lat": {**LAT, "k_rate": "x"}}, "lat.k_rate must be a number .*, got 'x'"),
        (
            {"lat": {**LAT, "frequency": -1.0}},
            r"frequency must be a number 1e-09 or more .*, got -1\.0",
        ),
        (
            {"lat": {**LAT, "stick": 10**400}},
            r"stick must be a finite number .* at most 1e\+09",
        ),
        (
            {"lat": {**LAT, "ff_delay": -0.1}},
            r"ff_delay must be a number 0 or more .*, got -0\.1",
        ),
        (
            {"lat": {**LAT, "filters": [{"kind": ["lead"]}]}},
            r"filters\[0\] \['lead'\]; available",
        ),
        (
            {"lat": {**LAT, "filters": [{"kind": "led"}]}},
            r"filters\[0\] 'led'; available: lead, lo",
        ),
        ({"lat": {**LAT, "filters": [{"kind": "lead", "zero": 1.0}]}}, r"filters\[0\] needs pole"),
    ],
)
def test_what_is_no_law_says_what_is_wrong(change, message):
    data = {**HOLDS.to_dict(), **change}
    with pytest.raises(InputError, match=message):
        law_of({name: value for name, value in data.items() if value is not None})


def test_a_law_that_waits_too_long_is_refused(jr700):
    slow = replace(HOLDS, delay=1.0)
    with pytest.raises(InputError, match=r"keeps 20\d\d numbers at ticks of 0.002 s"):
        slow.on(jr700)
