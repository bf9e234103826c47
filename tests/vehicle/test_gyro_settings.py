"""What a pilot can set on the gyro, and that each setting does what it says by as much."""

import numpy as np
import pytest

from helisim.base.errors import InputError, ModelError, UnknownNameError
from helisim.vehicle import load

OMEGA = np.geomspace(0.5, 60.0, 40)
ROUNDING = 1e-9
"""Relative, of a response: central differences with steps of 1e-5 of laws that are linear."""


def at_ticks(system):
    return system(np.exp(1j * OMEGA * system.dt))


@pytest.mark.parametrize(
    ("setting", "stick"), [("aileron_rate", "LAT"), ("elevator_rate", "LON"), ("pitch_rate", "COL")]
)
def test_a_rate_is_the_travel_of_its_stick(jr700, setting, stick):
    """At half the rate a stick does half at every frequency; the other sticks do what they did."""
    name = f"gyro.{setting}"
    half = jr700.with_settings({name: jr700.parameters[name] / 2.0})
    before, after = (at_ticks(one.linearize("IN2").system) for one in (jr700, half))
    share = np.ones(4)
    share[jr700.linearize("IN2").inputs.index(stick)] = 0.5
    scale = np.abs(before).max()
    assert after == pytest.approx(share[:, None] * before, abs=ROUNDING * scale)
    for axis in ("lon", "lat", "ped"):  # a rate is outside the loops
        assert at_ticks(half.loop(axis)) == pytest.approx(at_ticks(jr700.loop(axis)), rel=1e-6)


def test_a_flight_mode_is_a_share_of_the_cyclic_integral(jr700):
    """From rates to cyclic, mode 2 (sports) is half way between 3 (3D) and 1 (F3C)."""
    laws = [jr700.with_settings({"gyro.flight_mode": mode}).gyro.system for mode in (1, 2, 3)]
    f3c, sports, three_d = map(at_ticks, laws)
    assert sports == pytest.approx(0.5 * (f3c + three_d), abs=1e-6)  # central differences
    # what mode 3 adds is the integral turned by the swashplate's phase: lat/p, ki cos(phase)/s
    at, law = jr700.parameters, laws[0]
    lat, p = law.output_labels.index("lat"), law.input_labels.index("p")
    integral = -at["gyro.ki_lat"] * np.cos(at["gyro.phase"]) / (1j * OMEGA)
    filtered = integral / (1.0 + 1j * OMEGA * at["gyro.filter"])
    slow = OMEGA < 5.0
    # the sampled integral is half a period late, and so is the filter: 2 ms x 5 rad/s = 1 %
    assert (three_d - f3c)[lat, p, slow] == pytest.approx(filtered[slow], rel=0.01)


def test_the_collectives_rate_moves_the_stick_not_the_hover():
    """Where the hover needs collective, a smaller rate needs more stick for the same."""
    rigged = {"main_rotor.pitch_trim": 0.07}
    full, half = load(parameters=rigged), load(parameters={**rigged, "gyro.pitch_rate": 0.2})
    assert half.trim.col == pytest.approx(full.trim.col, abs=1e-9)
    assert full.trim.col > 0.01
    sticks = [vehicle.hovering().ctrl[0] for vehicle in (full, half)]
    assert sticks == pytest.approx([full.trim.col, 2.0 * full.trim.col], rel=1e-9)


@pytest.mark.parametrize(
    ("setting", "error", "says"),
    [
        ({"gyro.flight_mode": 2.5}, ModelError, "one of 1, 2, 3, got 2.5"),
        ({"gyro.elevator_rate": 1.1}, ModelError, "above 0 and at most 1, got 1.1"),
        ({"gyro.pitch_rate": float("nan")}, InputError, "got nan"),
        ({"main_rotor.lift_slope": 5.0}, InputError, r"load\(parameters"),
        ({"gyro.gain": 1.0}, UnknownNameError, r"gyro\.k_a"),
    ],
)
def test_a_setting_that_the_gyro_lacks_is_refused(jr700, setting, error, says):
    """In one line; the airframe needs another trim, so it is refused here."""
    with pytest.raises(error, match=says):
        jr700.with_settings(setting)
