"""Missions are flown as their scripts say, the same each time, also scripts of one's own."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import DivergedError, InputError, ModelError
from helisim.base.settings import from_plain
from helisim.sim import simulate
from helisim.sim.ground import outline
from helisim.sim.missions import MISSIONS, Autopilot, Mission, missions_by_name
from helisim.sim.missions.autopilot import Glide, Lift, Ramp, Sight
from helisim.sim.missions.mission import Reached
from helisim.vehicle.trim import addresses, collective_stick, rotation_matrix

CALM = hs.Pilot(remnant=0.0)


@dataclass(frozen=True, kw_only=True)
class Triangle(Mission):
    """Fly to two places and back: a mission of a user's own."""

    duration: float = 40.0
    side: float = 5.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Go round."""
        for north, east in ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0)):
            pilot.say(f"to {north:g}, {east:g}")
            yield from pilot.go(self.side * north, self.side * east)


@dataclass(frozen=True, kw_only=True)
class Stumbling(Mission):
    """Raise an error half a second into the flight."""

    duration: float = 3.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Divide by zero."""
        yield from pilot.hold(0.5)
        print(1.0 / (pilot.wanted.turning * 0.0))


@dataclass(frozen=True, kw_only=True)
class Lost(Mission):
    """Ask for a place that is none, half a second into the flight."""

    duration: float = 3.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Want it."""
        yield from pilot.hold(0.5)
        pilot.wanted.north = math.nan
        yield


@dataclass(frozen=True, kw_only=True)
class Silent(Mission):
    """Return nothing that can be asked at each tick."""

    duration: float = 3.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Do nothing."""
        return None  # pyright: ignore[reportReturnType]


@dataclass(frozen=True, kw_only=True)
class Wishless(Mission):
    """Say nothing of what is flown."""

    duration: float = 3.0


@dataclass(frozen=True, kw_only=True)
class Backwards(Mission):
    """Start in a flight that no trim is looked for in."""

    duration: float = 3.0
    start: ClassVar[hs.missions.Start] = hs.missions.Start(speed=-3.0)

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly on."""
        yield from pilot.hold(1.0)


def flown(vehicle, mission, **settings):
    """Return what a flight of a mission reached, and its trajectory."""
    plan = hs.FlightPlan(mission=mission, **{"pilot": CALM, **settings})
    (trajectory,) = simulate(vehicle, plan, seed=1, jobs=1)
    return Reached.of(vehicle, trajectory), trajectory


def test_a_script_that_wants_no_number_ends_its_flight(jr700):
    """Which, is said; the sticks are not moved by it."""
    with pytest.raises(DivergedError, match=r"mission 'lost' wants north = nan at 0\.5"):
        hs.fly(jr700, Lost(), seed=1)


def test_forward_flight_goes_out_and_back(jr700):
    """It reaches its speed, keeps its course and height, and comes back to where it began.

    Bounds: drag, which the pilot doesn't know, has to be found by integrals of 0.2 and 0.5 rad/s:
    at 2 m/s^2 some tenths of a metre behind and above the reference; twice what is found.
    """
    reached, flight = flown(jr700, hs.missions.Forward(speed=8.0, cruise=2.0))
    assert reached.finished
    assert reached.top_speed == pytest.approx(8.0, abs=0.4)
    assert reached.place_error < 1.0
    assert reached.height_error < 0.8
    assert reached.heading_error < math.radians(4.0)
    assert np.hypot(*flight.positions[-1, :2]) < 0.6
    phases = [text for _, text in reached.phases]
    assert phases[:2] == ["hover", "out: faster"]
    assert "back: slower" in phases


def test_take_off_hover_and_landing(jr700):
    """It leaves the ground from its skids, hovers and lands where it was, softly.

    Bounds: it leaves the ground level and has to roll by 0.07 rad for the tail rotor's thrust, over
    0.3 s, and is blown aside meanwhile; gear stands 2.5 m/s.
    """
    reached, flight = flown(jr700, hs.missions.TakeOffHoverLand(height=2.0, hover=1.0))
    assert reached.finished
    assert reached.place_error < 1.2
    assert reached.height_error < 0.5
    assert reached.touch_down.sink < 0.8
    assert reached.touch_down.ground_speed < 0.3
    assert np.any(flight.contact[-1] != 0.0)
    assert flight.ground == hs.Ground(parked=True)
    assert -flight.positions[:, 2].min() == pytest.approx(2.1, abs=0.3)


def test_take_off_waits_for_a_rotor_that_a_motor_spins_up():
    """It stays on the ground until the rotor has its speed, and then flies as ever."""
    vehicle = hs.load("jr700", parameters={"drive.governor": "motor"})
    mission = hs.missions.TakeOffHoverLand(height=1.0, hover=0.5)
    reached, flight = flown(vehicle, mission, ground=hs.Ground(parked=True, rotor=0.0))
    times = {text: time for time, text in reached.phases}
    lifted = float(flight.time[np.argmin(flight.contact.any(axis=1))])
    assert reached.finished
    assert reached.rotor_speed[0] == 0.0
    assert times["spool-up"] < times["take-off"] < lifted < times["hover"]
    assert flight.rotor[flight.time > times["take-off"], 4].min() > 0.9
    assert reached.touch_down.at > times["landing"]


def test_an_ideal_governor_spins_no_rotor_up(jr700):
    """It has no speed of its own, so a rotor at rest is refused with what to change."""
    with pytest.raises(InputError, match=r"needs a motor .* drive\.governor = motor, not ideal"):
        flown(jr700, hs.missions.TakeOffHoverLand(), ground=hs.Ground(parked=True, rotor=0.0))


def test_a_pirouette_keeps_its_place(jr700):
    """It turns once to the right about where it stands.

    Bounds: the gyro's coupling of turn to tilt is 4 % of the yaw rate, held at 3 rad/s; thrice
    what is found.
    """
    reached, flight = flown(jr700, hs.missions.Pirouette(turns=1.0, rate=1.5))
    assert reached.finished
    assert reached.place_error < 0.3
    assert reached.height_error < 0.2
    turned = flight.attitudes[-1, 2] - flight.attitudes[0, 2]
    assert turned == pytest.approx(2.0 * math.pi, abs=0.05)


@pytest.fixture(scope="module")
def blade360():
    """Return a vehicle a third as large."""
    return hs.load("blade360")


def test_another_vehicle_flies_them_too(blade360):
    """Gains come from the vehicle's own gyro and collective: nothing is of the JR700."""
    reached, _ = flown(blade360, hs.missions.Forward(speed=6.0, cruise=1.0))
    assert reached.finished
    assert reached.place_error < 1.0
    assert reached.height_error < 0.8


def test_a_mission_is_the_same_for_any_threads(jr700):
    """Same seed, same bytes, with a human's remnant and turbulence, in any order."""
    plan = hs.FlightPlan(
        mission=hs.missions.Pirouette(turns=0.1), weather=hs.Weather(turbulence="light")
    )
    one, two = hs.fly(jr700, plan, count=2, seed=3, jobs=1)
    again = hs.fly(jr700, plan, count=2, seed=3, jobs=2)
    assert [one, two] == again
    assert not np.array_equal(one.values, two.values)


def test_a_record_says_what_was_flown_and_reached(jr700):
    """Its provenance has the mission, from which it is flown again, and what it reached."""
    mission = Triangle(side=2.0)
    (record,) = hs.fly(jr700, hs.FlightPlan(mission=mission, pilot=CALM), seed=1)
    assert record.provenance["mission"] == {"kind": "Triangle", "duration": 40.0, "side": 2.0}
    plan = hs.FlightPlan.of_record(record)
    assert plan.mission == mission
    assert plan.excitation is None
    assert hs.fly(jr700, plan, seed=1) == [record]
    reached = from_plain(Reached, record.provenance["reached"], "reached")
    assert reached.finished
    assert reached.place_error < 1.0  # short hops: attitude is 0.3 s behind
    assert [text for _, text in reached.phases] == ["to 1, 0", "to 0, 1", "to 0, 0"]
    assert "place within" in str(reached)
    assert reached.touch_down is None


def test_a_plan_file_takes_a_mission(jr700, tmp_path):
    """What is written is read as an equal plan, of the same digest."""
    plan = hs.FlightPlan(mission=hs.missions.Forward(speed=5.0)).on(jr700)
    hs.write_plan(plan, tmp_path / "plan.toml")
    again = hs.read_plan(tmp_path / "plan.toml")
    assert again == plan
    assert again.digest == plan.digest
    assert "mission     Forward(speed=5.0)" in str(plan)
    text = (tmp_path / "plan.toml").read_text().replace('"Forward"', '"Elsewhere"')
    (tmp_path / "own.toml").write_text(text)
    with pytest.raises(InputError, match=r"'Elsewhere'; .* one of your own has to be imported"):
        hs.read_plan(tmp_path / "own.toml")


def test_a_manoeuvre_is_flown_on_top_of_a_mission(jr700):
    """A doublet of the sticks comes on top of what the pilot does at speed."""
    mission = hs.missions.Forward(speed=5.0, cruise=10.0)
    _, plain = flown(jr700, mission)
    doublet = hs.Doublet(axis="lat", duration=32.0, trim_time=8.0, width=1.0, amplitude=0.05)
    _, moved = flown(jr700, mission, excitation=doublet)
    first = np.searchsorted(plain.time, 8.0)
    assert np.array_equal(plain.sticks[:first], moved.sticks[:first])
    added = moved.sticks[first + 5, 2] - plain.sticks[first + 5, 2]
    assert added == pytest.approx(0.05, abs=1e-6)  # in the tick in which it begins, before answers
    assert hs.FlightPlan(mission=mission, excitation=doublet).name == "forward_lat"


def test_a_flight_that_leaves_its_envelope_ends(jr700):
    """Missions are watched by the limits of every flight."""
    plan = hs.FlightPlan(
        mission=hs.missions.Forward(speed=10.0), envelope=hs.FlightEnvelope(advance=0.05)
    )
    with pytest.raises(
        DivergedError, match=r"advance ratio of 0\.05 .*; give the mission other settings"
    ) as caught:
        hs.fly(jr700, plan, seed=1)
    record = caught.value.record
    assert record.ended
    assert not record.provenance["reached"]["finished"]
    assert len(record.provenance["ended"]["state"]) > 13


def test_what_is_reached_is_reached_within_the_flight(jr700):
    """Neither places nor phases count that the script wanted after a limit ended the flight."""
    mission = hs.missions.Forward(speed=8.0, cruise=2.0)
    whole, _ = flown(jr700, mission)
    envelope = hs.FlightEnvelope(advance=0.04)  # 6 m/s, on the way out
    (early,) = simulate(
        jr700,
        hs.FlightPlan(mission=mission, pilot=CALM, envelope=envelope),
        seed=1,
        jobs=1,
        keep_ended=True,
    )
    reached = Reached.of(jr700, early)
    assert not reached.finished
    assert reached.place_error <= whole.place_error
    assert reached.phases == whole.phases[: len(reached.phases)]
    assert reached.phases[-1][1] == "out: faster"


def test_a_script_that_raises_ends_its_flight(jr700):
    """What it raised is told with its lines, and the record goes as far as the flight did."""
    with pytest.raises(
        DivergedError, match=r"mission 'stumbling' raised ZeroDiv.* at 0\.5"
    ) as caught:
        hs.fly(jr700, Stumbling(), seed=1)
    assert "in fly" in caught.value.__notes__[0]
    assert caught.value.record.duration == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: hs.FlightPlan(mission=Wishless()), "Wishless doesn't say what it flies"),
        (lambda: hs.FlightPlan(mission=Triangle(duration=0.1)), "at least 1 s, got 0.1"),
        (lambda: hs.FlightPlan(mission="forward"), "got 'forward'"),
        (lambda: hs.FlightPlan(mission=Triangle(side=math.nan)), "side must be a finite number"),
        (
            lambda: hs.missions.Forward(speed=-1.0),
            "speed must be a number above 0 m/s, got -1",
        ),
        (
            lambda: hs.missions.Forward(speed=math.inf),
            "speed must be a finite number.* got inf",
        ),
        (
            lambda: hs.missions.Autorotation(speed=-5.0),
            "speed must be a number 0 or more m/s",
        ),
        (lambda: hs.missions.Autorotation(reaction=-1.0), "reaction must be a number 0 or more"),
        (lambda: hs.FlightPlan(mission=Backwards()), "must start at 0 m/s or more, got -3"),
        (lambda: hs.missions.Forward(speed="fast"), "Forward.speed must be a number .*got 'fast'"),
    ],
)
def test_a_mission_that_can_not_be_is_refused(make, says):
    """In a line that says what was received."""
    with pytest.raises(InputError, match=says):
        make()


@dataclass(frozen=True, kw_only=True)
class Looking(Mission):
    """Keep what is seen in a turning climb."""

    duration: float = 3.0
    kept: ClassVar[list[Sight]] = []

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Climb and turn, off level."""
        for _ in pilot.climb(25.0):
            pilot.wanted.turning, pilot.wanted.east_rate = 1.0, 3.0
            self.kept.append(pilot.seen)
            yield


@pytest.mark.parametrize("ground", [None, hs.Ground(slope=0.2, uphill=1.0)])
def test_a_script_sees_the_truth(jr700, ground):
    """Motion, velocity and clearance are those of the trajectory at the tick."""
    Looking.kept.clear()
    _, flight = flown(jr700, Looking(), ground=ground)
    seen = Looking.kept[60]
    k = np.searchsorted(flight.time, seen.time - 1e-9)
    now, arm = seen.motion, flight.imu_offset
    turn = rotation_matrix(now.phi, now.theta, now.psi)
    assert flight.attitudes[k] == pytest.approx([now.phi, now.theta, now.psi], abs=1e-9)
    assert flight.rates[k] == pytest.approx([now.p, now.q, now.r], abs=1e-9)
    velocity = np.array([now.u, now.v, now.w])
    assert flight.velocities[k] == pytest.approx(
        velocity + np.cross(flight.rates[k], arm), abs=1e-6
    )
    rates = [seen.north_rate, seen.east_rate, seen.down_rate]
    assert turn @ velocity == pytest.approx(rates, abs=1e-9)
    place = np.array([now.north, now.east, now.down])
    assert flight.positions[k] == pytest.approx(place + turn @ arm, abs=1e-9)
    shape = outline(jr700)
    points = flight.positions[k] + shape.points @ turn.T
    above = (ground or hs.Ground()).heights(flight.time[[k]], points[None])[0]
    assert seen.clearance == pytest.approx(float((above - shape.radii).min()), abs=1e-9)


def test_a_script_must_yield(jr700):
    """A method that isn't a generator is told so before anything is flown."""
    with pytest.raises(InputError, match=r"Silent\.fly must yield"):
        hs.fly(jr700, Silent(), seed=1)


def test_a_mission_of_ones_own_has_a_name():
    """By which the command line, records and plans know it."""
    assert missions_by_name()["triangle"] is Triangle is MISSIONS["Triangle"]
    assert Triangle().name == "triangle"
    assert replace(Triangle(), side=3.0) == Triangle(side=3.0)
    with pytest.raises(InputError, match="there is a mission 'Forward'"):
        type("Forward", (Mission,), {"__module__": "elsewhere"})


@pytest.mark.slow
def test_forward_flight_at_twenty_metres_a_second(jr700):
    """The full mission: 20 m/s out and back.

    Bounds: as for the short one; twice what is found.
    """
    reached, _ = flown(jr700, hs.missions.Forward(speed=20.0), weather=hs.Weather(height=30.0))
    assert reached.finished
    assert reached.top_speed == pytest.approx(20.0, abs=0.5)
    assert reached.place_error < 2.0
    assert reached.height_error < 2.0


# Without its engine the helicopter comes down on the wind in its rotor, and lands


GEAR_STANDS = 2.0
"""m/s, of sinking: what is asked of a touch-down; the gear itself stands 2.5 (14 CFR 27.725)."""


def autorotated(vehicle, **settings):
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
    reached, flight = autorotated(jr700, height=height, speed=speed)
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
        autorotated(hs.load("lynx"))


def test_the_wind_drives_the_rotor(jr700):
    """In the glide the rotor takes power from the air, where in level flight it gives power to it.

    A steady descent: what gravity gives is what the rotors and the drag take.
    """
    reached, flight = autorotated(jr700, height=100.0, speed=10.0)
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
        _, flight = autorotated(jr700, height=60.0, reaction=reaction)
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


# Ways from rest to rest and from speed to speed: what a mission's pilot follows


@pytest.mark.parametrize("way", [Ramp(2.0, 7.0, 1.5), Glide(30.0, 4.0, 1.5), Glide(1.0, 4.0, 1.5)])
def test_references_are_smooth(way):
    """Distance is the integral of speed, this of the acceleration, which keeps its limit."""
    time = np.linspace(0.0, way.lasts, 20_001)
    distance, speed, acceleration = np.array([way.at(one) for one in time]).T
    step = time[1]
    summed = step * np.cumsum(0.5 * (speed[1:] + speed[:-1]))
    assert np.allclose(distance[1:], summed, atol=1e-6)
    assert np.allclose(
        np.diff(speed), 0.5 * step * (acceleration[1:] + acceleration[:-1]), atol=1e-6
    )
    assert np.abs(acceleration).max() <= way.acceleration * (1.0 + 1e-9)


def test_a_glide_ends_at_rest_where_it_was_to_end():
    """Neither a long way nor a short one is overshot."""
    for way in (Glide(30.0, 4.0, 1.5), Glide(0.3, 4.0, 1.5), Glide(0.0, 4.0, 1.5)):
        assert way.at(way.lasts) == pytest.approx((way.distance, 0.0, 0.0), abs=1e-9)
        assert way.top <= 4.0
