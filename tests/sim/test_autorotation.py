"""Without its engine the helicopter comes down on the wind in its rotor, and lands."""

import math

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import ModelError
from helisim.sim import simulate
from helisim.sim.missions.autopilot import Lift
from helisim.sim.missions.mission import Reached
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import collective_stick

GEAR_STANDS = 2.0
"""m/s, of sinking: what is asked of a touch-down; the gear itself stands 2.5 (14 CFR 27.725)."""


def flown(vehicle, **settings):
    """Return what an autorotation reached, and its trajectory, with a human's remnant."""
    mission = hs.missions.Autorotation(**settings)
    (trajectory,) = simulate(vehicle, mission, seed=1, jobs=1)
    return Reached.of(vehicle, trajectory), trajectory


@pytest.mark.parametrize(
    ("height", "speed"), [(30.0, 0.0), (60.0, 10.0), (100.0, 0.0), (30.0, 15.0)]
)
def test_it_lands_without_an_engine(jr700, height, speed):
    """It touches down softly, nearly level, and slides out its last speed on its skids.

    Within the envelope of every flight: no rotor strikes, no gear breaks, no limit is passed.
    """
    reached, flight = flown(jr700, height=height, speed=speed)
    assert reached.finished
    landed = reached.touch_down
    assert landed.sink < GEAR_STANDS
    assert landed.ground_speed < 6.0  # a run; skids slide
    assert max(abs(landed.phi), abs(landed.theta)) < 0.12  # at 0.1 rad the tail would strike first
    assert [text for _, text in reached.phases][-4:] == [
        "collective down",
        "glide",
        "flare",
        "on the ground",
    ]
    cut = next(time for time, text in reached.phases if text == "engine fails")
    after = flight.time > cut + 0.2
    assert flight.power[after, 0].max() <= 0.0  # W: nothing drives; friction takes
    assert flight.power[~after, 0].max() > 500.0


def test_a_vehicle_without_a_motor_has_none_to_lose():
    """It is refused in a line that says what is missing, not flown on a motor of zeros."""
    with pytest.raises(ModelError, match=r"mission autorotation .* a positive drive\.inertia"):
        flown(hs.load("lynx"))


def test_the_wind_drives_the_rotor(jr700):
    """In the glide the rotor takes power from the air, where in level flight it gives power to it.

    A steady descent: what gravity gives is what the rotors and the drag take.
    """
    reached, flight = flown(jr700, height=100.0, speed=10.0)
    glide = (flight.time > 6.0) & (flight.time < 8.0)
    assert np.ptp(flight.rotor[glide, 4]) < 0.05  # the speed is kept
    assert abs(flight.power[glide, 1].mean()) < 0.1 * flight.power[0, 1]
    assert reached.rotor_speed[0] < 0.9 < reached.rotor_speed[1]


def test_too_low_and_too_slow_it_does_not_land(jr700):
    """From 12 m in the hover there is neither height to gain speed nor speed to flare."""
    mission = hs.missions.Autorotation(height=12.0)
    (record,) = hs.fly(jr700, mission, seed=1, keep_ended=True)
    assert "the ground" in record.ended
    assert not record.provenance["reached"]["finished"]
    assert record["w"][-1] > 2.5


def test_who_reacts_late_has_a_slower_rotor(jr700):
    """Between 0.2 and 0.8 s of reaction the rotor loses speed as its torque and inertia say.

    I dOmega/dt = -Q, Q falling with the square of the speed: 1/x grows by Q t / (I Omega).
    """
    lowest = []
    for reaction in (0.2, 0.8):
        _, flight = flown(jr700, height=60.0, reaction=reaction)
        k = np.searchsorted(flight.time, 1.02 + reaction)
        lowest.append(flight.rotor[k, 4])
    own = jr700.parameters
    torque = jr700.power / own["main_rotor.speed"]
    decay = torque / (own["drive.inertia"] * own["main_rotor.speed"])
    expected = 1.0 / lowest[0] + 0.6 * decay
    # as it sinks, the inflow falls and with it the torque: a tenth less than in the hover
    assert 1.0 / lowest[1] == pytest.approx(expected, rel=0.12)


def test_collective_for_a_thrust_is_the_hovers_in_the_hover(jr700):
    """And less where the wind comes from below, more where the rotor is slow."""
    where = addresses(jr700.model)
    lift = Lift(jr700, jr700.model, where.rotor)
    hover = lift.collective(0.0, 1.0, 0.0, 0.0)
    assert hover == pytest.approx(collective_stick(jr700.model, jr700.trim), abs=1e-9)
    assert lift.induced == pytest.approx(4.16, abs=0.02)  # sqrt(78.5 / (2 1.225 1.848))
    assert lift.collective(0.0, 1.0, 8.0, 10.0) < hover - 0.3
    assert lift.collective(0.0, 0.8, 0.0, 0.0) > hover + 0.1
    assert math.isfinite(lift.collective(-20.0, 0.5, 15.0, 0.0))
