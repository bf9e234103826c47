"""What a pilot can set on the gyro, and that each setting does what it says by as much."""

import dataclasses

import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.physics.native import installed
from helisim.sim import Doublet
from helisim.sim.flight import fly
from helisim.sim.plan import FlightPlan, Pilot
from helisim.vehicle import GyroSettings, load

OMEGA = np.geomspace(0.5, 60.0, 40)
ROUNDING = 1e-9
"""Relative, of a response: central differences with steps of 1e-5 of laws that are linear."""


def from_sticks(vehicle):
    """Return the vehicle's response from sticks to motion, (n_out, n_in, n_freq), and names."""
    system = vehicle.linearize("IN2").system
    return system(np.exp(1j * OMEGA * system.dt)), system.output_labels, system.input_labels


def test_the_default_settings_are_the_papers(jr700):
    """Section 2: Flt. Mode=3, Pit.Rate=0.4, Ele.Rate=0.6 and Ail.Rate=0.6, heading locked."""
    papers = GyroSettings(
        flight_mode=3, pitch_rate=0.4, elevator_rate=0.6, aileron_rate=0.6, heading_lock=True
    )
    assert jr700.settings == GyroSettings() == papers
    assert jr700.with_settings(papers).settings == papers
    same = jr700.with_settings(papers).model.actuator_user
    assert np.array_equal(same, jr700.model.actuator_user)


@pytest.mark.parametrize(
    ("setting", "stick", "others"),
    [
        ("aileron_rate", "LAT", ("COL", "LON", "PED")),
        ("elevator_rate", "LON", ("COL", "LAT", "PED")),
        ("pitch_rate", "COL", ("LON", "LAT", "PED")),
    ],
)
def test_a_rate_is_the_travel_of_its_stick(jr700, setting, stick, others):
    """At half the rate a stick does half at every frequency; the other sticks do what they did."""
    half = dataclasses.replace(GyroSettings(), **{setting: getattr(GyroSettings(), setting) / 2.0})
    before, _, inputs = from_sticks(jr700)
    after, _, _ = from_sticks(jr700.with_settings(half))
    scale = np.abs(before).max()
    k = inputs.index(stick)
    assert after[:, k] == pytest.approx(0.5 * before[:, k], abs=ROUNDING * scale)
    assert np.abs(before[:, k]).max() > 0.0
    for name in others:
        k = inputs.index(name)
        assert after[:, k] == pytest.approx(before[:, k], abs=ROUNDING * scale)


def test_rates_leave_the_loops_as_they_are(jr700):
    """A rate is outside the gyro's loops: what comes back at a servo command is the same."""
    slow = jr700.with_settings(GyroSettings(aileron_rate=0.2, elevator_rate=0.3, pitch_rate=0.1))
    for axis in ("lon", "lat", "ped"):
        one, other = jr700.loop(axis), slow.loop(axis)
        at = np.exp(1j * OMEGA * one.dt)
        assert other(at) == pytest.approx(one(at), rel=1e-6)  # central differences


def test_a_flight_mode_is_a_share_of_the_cyclic_integral(jr700):
    """From rates to cyclic, mode 2 (sports) is half way between 3 (3D) and 1 (F3C)."""
    by_mode = []
    for mode in (1, 2, 3):
        law = jr700.with_settings(GyroSettings(flight_mode=mode)).gyro.system
        by_mode.append(law(np.exp(1j * OMEGA * law.dt)))
    f3c, sports, three_d = by_mode
    assert sports == pytest.approx(0.5 * (f3c + three_d), abs=1e-6)  # central differences
    # what mode 3 adds is the integral turned by the swashplate's phase: lat/p, ki cos(phase)/s
    at = jr700.parameters
    lat, p = law.output_labels.index("lat"), law.input_labels.index("p")
    integral = -at["gyro.ki_lat"] * np.cos(at["gyro.phase"]) / (1j * OMEGA)
    filtered = integral / (1.0 + 1j * OMEGA * at["gyro.filter"])
    slow = OMEGA < 5.0
    # the sampled integral is half a period late, and so is the filter: 2 ms x 5 rad/s = 1 %
    assert (three_d - f3c)[lat, p, slow] == pytest.approx(filtered[slow], rel=0.01)
    assert three_d[lat, p, slow] != pytest.approx(f3c[lat, p, slow], rel=0.5)


def test_a_flight_mode_keeps_attitude_or_damps_rates(jr700):
    """Kicked in roll, the helicopter comes back in 3D and stays tilted in F3C."""
    tilt = {}
    for mode in (1, 3):
        vehicle = jr700.with_settings(GyroSettings(flight_mode=mode))
        data = vehicle.hovering()
        with installed():
            mujoco.mj_step(vehicle.model, data, 100)
            data.qvel[3] += 1.0
            mujoco.mj_step(vehicle.model, data, 400)
        tilt[mode] = 2.0 * data.qpos[4] - vehicle.trim.phi
    assert tilt[1] > 0.02
    assert abs(tilt[3]) < 0.25 * tilt[1]


@pytest.mark.parametrize("mode", [1, 2])
def test_every_flight_mode_flies(jr700, mode):
    """The pilot keeps the hover in each mode, through a doublet."""
    vehicle = jr700.with_settings(GyroSettings(flight_mode=mode))
    record = fly(
        vehicle,
        FlightPlan(excitation=Doublet(axis="lat", duration=20.0), pilot=Pilot(remnant=0.0)),
        jobs=1,
    )[0]
    assert np.abs(record["phi"][record.time > 12.0] - vehicle.trim.phi).max() < 0.1
    assert record.provenance["parameters"]["gyro.flight_mode"] == mode


def test_the_collectives_rate_moves_the_stick_not_the_hover():
    """Where the hover needs collective, a smaller rate needs more stick for the same."""
    rigged = {"main_rotor.pitch_trim": 0.07}
    full, half = load(parameters=rigged), load(parameters={**rigged, "gyro.pitch_rate": 0.2})
    assert half.trim.col == pytest.approx(full.trim.col, abs=1e-9)
    assert full.trim.col > 0.01
    sticks = [vehicle.hovering().ctrl[0] for vehicle in (full, half)]
    assert sticks == pytest.approx([full.trim.col, 2.0 * full.trim.col], rel=1e-9)
    record = fly(
        half, FlightPlan(excitation=Doublet(axis="lat"), pilot=Pilot(remnant=0.0)), jobs=1
    )[0]
    assert record["COL"][50] == pytest.approx(2.0 * full.trim.col, abs=0.001)  # its resolution


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ({"flight_mode": 4}, "one of 1, 2, 3, got 4"),
        ({"flight_mode": 2.5}, "one of 1, 2, 3, got 2.5"),
        ({"aileron_rate": 0.0}, "aileron_rate must be above 0"),
        ({"elevator_rate": 1.1}, "at most 1, the whole travel, got 1.1"),
        ({"pitch_rate": float("nan")}, "got nan"),
        ({"heading_lock": 0.5}, "gyro.heading_lock must be one of 0, 1"),
    ],
)
def test_a_setting_that_the_gyro_lacks_is_refused(jr700, setting, says):
    """In one line, whether it comes as a setting or as a parameter."""
    with pytest.raises(InputError, match=says):
        GyroSettings(**setting)
    by_name = {f"gyro.{name}": value for name, value in setting.items()}
    with pytest.raises(InputError, match=r"gyro\."):
        jr700.with_settings(by_name)


def test_settings_are_of_gyro_and_recorder_only(jr700):
    """The airframe needs another trim, so it is refused here."""
    with pytest.raises(InputError, match=r"load\(parameters"):
        jr700.with_settings({"main_rotor.lift_slope": 5.0})
    with pytest.raises(UnknownNameError, match=r"gyro\.k_a") as caught:
        jr700.with_settings({"gyro.gain": 1.0})
    assert "gyro.k_p" in caught.value.available
