"""A disturbance of attitude turns what a controller senses: the angle, and the rate with it."""

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.ident import frequency_response
from helisim.sim import (
    Chirp,
    FlightEnvelope,
    FlightPlan,
    Manoeuvre,
    Pilot,
    Recorder,
    Step,
    Together,
    fly,
)
from helisim.vehicle import load

STEADY = {"pilot": Pilot(remnant=0.0), "envelope": FlightEnvelope.off()}
TRUE = Recorder(noise={}, resolution={}, latency={}, antialias_hz=249.0, rate_hz=500.0)


class Blind:
    """Commands the trim whatever it sees, and remembers it."""

    def __init__(self, vehicle):
        trim = vehicle.trim
        self.commands = (*vehicle.swashplate.mix(trim.col, trim.lon, trim.lat), trim.ped)
        self.seen = []

    def __call__(self, seen):
        self.seen.append(seen)
        return self.commands

    def __deepcopy__(self, memo):
        return self


def seen_by_blind(vehicle, excitation):
    law = Blind(vehicle)
    fly(vehicle.with_controller(law), FlightPlan(excitation=excitation, **STEADY), jobs=1)
    return law.seen


def oscillation(axis, amplitude, frequency):
    return Manoeuvre(
        lambda time: amplitude * np.sin(frequency * time), axis=axis, at="sensors", duration=1.0
    )


@pytest.mark.parametrize(("angle", "rate"), [("phi", "p"), ("theta", "q"), ("psi", "r")])
def test_a_law_sees_the_angle_and_its_rate(jr700, angle, rate):
    """Of a law that answers nothing the flight is the same: what differs is what was added."""
    amplitude, frequency = 0.02, 40.0
    moved = seen_by_blind(jr700, oscillation(angle, amplitude, frequency))
    held = seen_by_blind(jr700, oscillation(angle, 1e-12, frequency))
    time = np.array([one.time for one in held])

    def added(name):
        return np.array([getattr(a, name) - getattr(b, name) for a, b in zip(moved, held)])

    assert added(angle) == pytest.approx(amplitude * np.sin(frequency * time), abs=1e-9)
    # the spline's own error in the interior: (0.08)^4 / 180 = 2e-7 of the rate; at the ends more
    wanted = amplitude * frequency * np.cos(frequency * time)
    assert added(rate)[20:-20] == pytest.approx(wanted[20:-20], abs=1e-6 * amplitude * frequency)
    others = {"p", "q", "r", "phi", "theta", "psi"} - {angle, rate}
    assert all(np.array_equal(added(name), np.zeros(time.size)) for name in others)


def test_a_heading_that_a_law_sees_stays_in_its_range(jr700):
    """In (-pi, pi], disturbed or not."""
    seen = seen_by_blind(jr700, oscillation("psi", 3.1, 9.0))
    psi = np.array([one.psi for one in seen])
    assert np.abs(psi).max() <= np.pi
    assert np.ptp(psi) > 6.0


def test_the_record_tells_the_disturbance_and_what_was_sensed(jr700):
    """Beside the angle the rate that comes of it, on top of a disturbance of the rate itself."""
    parts = (oscillation("phi", 0.02, 20.0), oscillation("p", 0.1, 7.0))
    plan = FlightPlan(excitation=Together(parts=parts), recorder=TRUE, **STEADY)
    (record,) = fly(jr700, plan, seed=1)
    time = record.time
    assert record.unit("phi_sum") == "rad"
    # a 2 ms sample is the tick's; the filter's corner is where the samples end
    assert record["phi_disturbance"] == pytest.approx(0.02 * np.sin(20.0 * time), abs=1e-3)
    rate = 0.4 * np.cos(20.0 * time) + 0.1 * np.sin(7.0 * time)
    assert record["p_disturbance"][20:-20] == pytest.approx(rate[20:-20], abs=0.02)
    own = record["phi_sum"] - record["phi_disturbance"]
    assert own == pytest.approx(record["phi"], abs=1e-9)
    (rates,) = fly(jr700, FlightPlan(excitation=parts[1], recorder=TRUE, **STEADY), seed=1)
    assert "phi_sum" not in rates


def test_a_jump_of_attitude_is_refused(jr700):
    """Its rate is beyond any gyro's range; the message says where it comes from."""
    step = Step(axis="phi", at="sensors", amplitude=0.2)
    with pytest.raises(InputError, match="a disturbance of an attitude adds its own rate too"):
        fly(jr700, step, seed=1)
    with pytest.raises(InputError, match=r"amplitude must be in \(0, 3.14159\] rad, got 4"):
        Step(axis="phi", at="sensors", amplitude=4.0)


@pytest.mark.slow
def test_the_rejection_of_a_turn_is_the_gyros_sensitivity():
    """A gyro without attitude feeds back rates alone: psi_sum over psi_disturbance is 1 / (1 - L).

    Of the exact sampled loop. 0.01: the heading turns by r cos(phi) + q sin(phi), phi = 4 deg in
    the trim, which is 0.0035; the rest is what is nonlinear.
    """
    vehicle = load(parameters={"pilot.k_heading": 0.0})
    wave = Chirp(axis="psi", at="sensors", amplitude=0.002, band=(0.8, 60.0), duration=86.0)
    plan = FlightPlan(excitation=wave, pilot=Pilot(remnant=0.0), recorder=TRUE)
    found = frequency_response(
        fly(vehicle, plan, seed=1), inputs="psi_disturbance", outputs="psi_sum", band=(5.0, 45.0)
    )
    loop = vehicle.loop("ped")
    exact = np.array([1.0 / (1.0 - loop(np.exp(1j * w * loop.dt))) for w in found.frequency])
    assert np.abs(found.response[0, 0] - exact).max() < 0.01
    assert np.abs(exact).max() > 1.1
