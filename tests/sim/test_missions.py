"""Missions are flown as their scripts say, the same each time, also scripts of one's own."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from scipy.signal import chirp

import helisim as hs
from helisim import Multisine, Pulse, Sequence, Step, Sweep, ThreeTwoOneOne, Together
from helisim.base.errors import DivergedError
from helisim.base.settings import from_plain
from helisim.physics.layout import PARAM, SWEEP
from helisim.sim import Chirp, Doublet, simulate
from helisim.sim.excitation import step_times
from helisim.sim.ground import outline
from helisim.sim.missions import Autopilot, Mission
from helisim.sim.missions.autopilot import Sight, Wanted
from helisim.sim.missions.mission import Reached
from helisim.vehicle.trim import rotation_matrix
from tabled import tabled

CALM = hs.Pilot(remnant=0.0)


@dataclass(frozen=True, kw_only=True)
class Triangle(Mission):
    """Fly to two places and back: a mission of a user's own."""

    duration: float = 40.0
    side: float = 5.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        for north, east in ((1.0, 0.0), (0.0, 1.0), (0.0, 0.0)):
            pilot.say(f"to {north:g}, {east:g}")
            yield from pilot.go(self.side * north, self.side * east)


@dataclass(frozen=True, kw_only=True)
class Stumbling(Mission):
    duration: float = 3.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        yield from pilot.hold(0.5)
        print(1.0 / (pilot.wanted.turning * 0.0))


@dataclass(frozen=True, kw_only=True)
class Lost(Mission):
    duration: float = 3.0

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        yield from pilot.hold(0.5)
        pilot.wanted.north = math.nan
        yield


@dataclass(frozen=True, kw_only=True)
class Wishless(Mission):
    duration: float = 3.0


@dataclass(frozen=True, kw_only=True)
class Backwards(Mission):
    """Start in a flight that no trim is looked for in."""

    duration: float = 3.0
    start: ClassVar[hs.missions.Start] = hs.missions.Start(speed=-3.0)

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        yield from pilot.hold(1.0)


def flown(vehicle, mission, **settings):
    plan = hs.FlightPlan(mission=mission, **{"pilot": CALM, **settings})
    (trajectory,) = simulate(vehicle, plan, seed=1, jobs=1)
    return Reached.of(vehicle, trajectory), trajectory


def grounded(seconds):
    """Return a pilot who wants, and whom no vehicle follows."""
    pilot = Autopilot.__new__(Autopilot)
    pilot.seconds, pilot.wanted, pilot.phases = seconds, Wanted(), []
    pilot.seen = SimpleNamespace(time=0.0, motion=SimpleNamespace(psi=0.0))
    pilot.rng = np.random.default_rng(5)
    return pilot


@pytest.mark.parametrize(("angle", "rate"), [(2.0, 1.0), (-3.0, 0.5)])
def test_a_turn_has_its_rate_and_twice_that_a_second(angle, rate):
    """From rest to rest: the angle, its rate, and at most 2 rate / s, which half sines reach.

    A half sine of acceleration reaches the rate in pi / 4 s, in which half of it is turned.
    """
    pilot = grounded(0.002)
    pilot.wanted.heading = 0.3
    seen = [(pilot.wanted.heading, pilot.wanted.turning) for _ in pilot.turn(angle, rate=rate)]
    heading, turning = np.array(seen).T
    assert (heading[-1], turning[-1]) == pytest.approx((0.3 + angle, 0.0))
    assert np.abs(turning).max() == pytest.approx(rate)
    assert np.abs(np.diff(turning)).max() / 0.002 == pytest.approx(2.0 * rate, rel=1e-4)
    assert len(seen) == math.ceil((abs(angle) / rate + 0.25 * math.pi) / 0.002)


@pytest.mark.parametrize(("axis", "heading"), [("ped", 1.2), ("lat", 0.0)])
def test_after_a_push_of_the_pedals_the_heading_is_kept_that_it_then_has(axis, heading):
    pilot = grounded(0.02)
    pilot.seen.motion.psi = 1.2
    pushes = [max(pilot.wanted.pushed) for _ in pilot.push(axis, 0.1, 0.1)]
    assert pushes == pytest.approx([0.0, 0.025, 0.05, 0.075, 0.1, 0.1, 0.075, 0.05, 0.025])
    assert (pilot.wanted.heading, pilot.wanted.pushed) == (heading, (0.0,) * 4)


def test_a_script_that_wants_no_number_or_raises_ends_its_flight(jr700):
    with pytest.raises(DivergedError, match=r"mission 'lost' wants north = nan at 0\.5"):
        hs.fly(jr700, Lost(), seed=1)
    with pytest.raises(DivergedError, match=r"'stumbling' raised ZeroDiv.* at 0\.5") as caught:
        hs.fly(jr700, Stumbling(), seed=1)
    assert "in fly" in caught.value.__notes__[0]
    assert caught.value.record.duration == pytest.approx(0.5, abs=0.03)


def test_forward_flight_goes_out_and_back(jr700):
    """It reaches its speed, keeps its course and height, and comes back to where it began.

    Bounds: drag, which the pilot doesn't know, has to be found by integrals of 0.2 and 0.5 rad/s:
    at 2 m/s^2 some tenths of a metre behind and above the reference; twice what is found.
    """
    reached, flight = flown(jr700, hs.missions.Forward(speed=8.0, cruise=2.0))
    assert reached.finished
    assert reached.top_speed == pytest.approx(8.0, abs=0.4)
    assert np.abs(flight.positions[:, 1]).max() < 0.6  # the course
    assert np.ptp(flight.positions[:, 2]) < 1.2
    assert np.hypot(*flight.positions[-1, :2]) < 0.6
    assert flight.rotor_speed is None  # which is held
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
    assert np.hypot(*flight.positions[:, :2].T).max() < 1.2
    assert reached.touch_down.sink < 0.8
    assert reached.touch_down.ground_speed < 0.3
    assert np.any(flight.contact[-1] != 0.0)
    assert flight.ground == hs.Ground(parked=True)
    # the IMU stands 0.08 m up; hovering for a second it is still 0.13 m short, twice that
    assert -flight.positions[:, 2].min() == pytest.approx(2.08, abs=0.26)


def test_a_record_says_what_was_flown_and_reached(jr700):
    mission = Triangle(side=2.0)
    (record,) = hs.fly(jr700, hs.FlightPlan(mission=mission, pilot=CALM), seed=1)
    assert record.provenance["mission"] == {"kind": "Triangle", "duration": 40.0, "side": 2.0}
    plan = hs.FlightPlan.of_record(record)
    assert plan.mission == mission
    assert plan.excitation is None
    assert hs.fly(jr700, plan, seed=1) == [record]
    reached = from_plain(Reached, record.provenance["reached"], "reached")
    assert reached.finished
    assert [text for _, text in reached.phases] == ["to 1, 0", "to 0, 1", "to 0, 0"]
    assert "up to" in str(reached)
    assert reached.touch_down is None


def test_a_manoeuvre_is_flown_on_top_of_a_mission(jr700):
    mission = hs.missions.Forward(speed=5.0, cruise=4.0)
    _, plain = flown(jr700, mission)
    doublet = hs.Doublet(axis="lat", duration=16.0, trim_time=4.0, width=1.0, amplitude=0.05)
    _, moved = flown(jr700, mission, excitation=doublet)
    first = np.searchsorted(plain.time, 4.0)
    assert np.array_equal(plain.sticks[:first], moved.sticks[:first])
    added = moved.sticks[first + 5, 2] - plain.sticks[first + 5, 2]
    assert added == pytest.approx(0.05, abs=1e-6)  # in the tick in which it begins, before answers
    assert hs.FlightPlan(mission=mission, excitation=doublet).name == "forward_lat"


@tabled("make", "error", "says")
def test_a_mission_that_can_not_be_is_refused(make, error, says):
    with pytest.raises(error, match=says):
        make()


@dataclass(frozen=True, kw_only=True)
class Looking(Mission):
    """Keep what is seen in a turning climb."""

    duration: float = 3.0
    kept: ClassVar[list[Sight]] = []

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        for _ in pilot.climb(25.0):
            pilot.wanted.turning, pilot.wanted.east_rate = 1.0, 3.0
            self.kept.append(pilot.seen)
            yield


@pytest.mark.parametrize("ground", [None, hs.Ground(slope=0.2, uphill=1.0)])
def test_a_script_sees_the_truth(jr700, ground):
    Looking.kept.clear()
    _, flight = flown(jr700, Looking(), ground=ground)
    seen = Looking.kept[60]
    k = np.searchsorted(flight.time, seen.time - 1e-9)
    now, arm = seen.motion, flight.imu_offset
    turn = rotation_matrix(now.phi, now.theta, now.psi)
    assert flight.attitudes[k] == pytest.approx([now.phi, now.theta, now.psi], abs=1e-9)
    assert flight.rates[k] == pytest.approx([now.p, now.q, now.r], abs=1e-9)
    velocity = np.array([now.u, now.v, now.w])
    there = velocity + np.cross(flight.rates[k], arm)
    assert flight.velocities[k] == pytest.approx(there, abs=1e-6)
    rates = [seen.north_rate, seen.east_rate, seen.down_rate]
    assert turn @ velocity == pytest.approx(rates, abs=1e-9)
    place = np.array([now.north, now.east, now.down])
    assert flight.positions[k] == pytest.approx(place + turn @ arm, abs=1e-9)
    shape = outline(jr700)
    points = flight.positions[k] + shape.points @ turn.T
    above = (ground or hs.Ground()).heights(flight.time[[k]], points[None])[0]
    assert seen.clearance == pytest.approx(float((above - shape.radii).min()), abs=1e-9)


# Without its engine the helicopter comes down on the wind in its rotor, and lands

GEAR_STANDS = 2.0
"""m/s, of sinking: what is asked of a touch-down; the gear itself stands 2.5 (14 CFR 27.725)."""


def autorotated(vehicle, **settings):
    mission = hs.missions.Autorotation(**settings)
    (trajectory,) = simulate(vehicle, mission, seed=1, jobs=1)
    return Reached.of(vehicle, trajectory), trajectory


BETWEEN = [pytest.param(*one, marks=pytest.mark.slow) for one in ((30.0, 0.0), (60.0, 10.0))]


@pytest.mark.parametrize(("height", "speed"), [(100.0, 0.0), (30.0, 15.0), *BETWEEN])
def test_it_lands_without_an_engine(jr700, height, speed):
    """It touches down softly, nearly level, and slides out its last speed on its skids.

    Within the envelope of every flight: no rotor strikes, no gear breaks, no limit is passed.
    """
    reached, flight = autorotated(jr700, height=height, speed=speed)
    assert reached.finished
    landed = reached.touch_down
    assert landed.sink < GEAR_STANDS
    assert landed.ground_speed < 6.0  # a run; skids slide
    down = int(np.searchsorted(flight.time, landed.at))
    assert np.abs(flight.attitudes[down, :2]).max() < 0.12  # at 0.1 rad the tail would strike first
    phases = [text for _, text in reached.phases]
    assert phases[-4:] == ["collective down", "glide", "flare", "on the ground"]
    cut = next(time for time, text in reached.phases if text == "engine fails")
    after = flight.time > cut + 0.2
    assert flight.power[after, 0].max() <= 0.0  # W: nothing drives; friction takes
    assert flight.power[~after, 0].max() > 500.0
    nominal = jr700.parameters["main_rotor.speed"]
    assert flight.rotor_speed[:, 0] == pytest.approx(nominal * flight.rotor[:, 4], rel=1e-12)


# The shipped manoeuvres as signals: against published figures, SciPy, and what they must add.

TIME = step_times(20.0, 0.002)


def test_a_step_stays_a_pulse_goes_back_and_together_is_the_sum():
    """From the end of the trimmed stretch on; the edges come at the step that they name."""
    step = Step(axis="lat", amplitude=-0.05, trim_time=3.0, duration=20.0).wave(TIME)
    pulse = Pulse(axis="lat", amplitude=0.05, width=0.4, trim_time=3.0).wave(TIME)
    after = np.arange(TIME.size) >= 1500
    assert np.array_equal(step, np.where(after, -0.05, 0.0))
    assert np.array_equal(pulse, np.where(after & (np.arange(TIME.size) < 1700), 0.05, 0.0))
    parts = (
        Step(axis="lat", amplitude=0.05, duration=8.0),
        Pulse(axis="lat", amplitude=0.02, duration=6.0),
        Doublet(axis="col", at="actuators", amplitude=0.1),
    )
    made = Together(parts=parts)
    assert (made.duration, made.axis, made.places) == (8.0, "lat+col", ("sticks", "actuators"))
    time = step_times(8.0, 0.002)
    lat = parts[0].wave(time) + parts[1].wave(time)
    assert np.array_equal(made.added(time)["sticks"][:, 2], lat)
    assert made.added(time)["actuators"][:, 0].any()


@pytest.mark.parametrize("kind", [Doublet, ThreeTwoOneOne])
@pytest.mark.parametrize(("at", "axis", "column"), [("servos", "ped", 3), ("sensors", "q", 1)])
def test_multisteps_are_the_same_elsewhere(kind, at, axis, column):
    """What a doublet or a 3-2-1-1 adds at a servo or a sensor is what it adds at a stick."""
    stick = kind(axis="lon", amplitude=0.05)
    other = kind(axis=axis, amplitude=0.05, at=at)
    added = other.added(TIME)
    assert list(added) == [at]
    assert np.array_equal(added[at][:, column], stick.added(TIME)["sticks"][:, 1])
    assert np.count_nonzero(added[at].any(axis=0)) == 1


def test_a_chirp_is_scipys_and_fades_in_and_out():
    """The phase of scipy.signal.chirp, a quarter of a turn later; half a cosine over the fade."""
    settings = {"amplitude": 0.1, "band": (0.5, 30.0), "trim_time": 2.0, "fade": 0.0}
    made = Chirp(axis="ped", duration=20.0, **settings)
    inside = (TIME >= 2.0) & (TIME <= 18.0)
    since, cycles = TIME[inside] - 2.0, np.array([0.5, 30.0]) / (2.0 * np.pi)
    expected = 0.1 * chirp(since, cycles[0], 16.0, cycles[1], method="logarithmic", phi=-90.0)
    # SciPy's phase of 76 rad is rounded: 1e-13
    assert made.wave(TIME)[inside] == pytest.approx(expected, abs=1e-12)
    assert not made.wave(TIME)[~inside].any()
    settings = {"axis": "lat", "amplitude": 0.1, "band": (5.0, 6.0), "duration": 20.0}
    faded = Chirp(**settings, fade=2.0).wave(TIME)
    plain = Chirp(**settings, fade=0.0).wave(TIME)
    half = np.isclose(TIME, 4.0)
    assert faded[half] == pytest.approx(0.5 * plain[half], abs=1e-12)
    whole = (TIME > 5.0) & (TIME < 15.0)
    assert np.array_equal(faded[whole], plain[whole])
    assert abs(faded[np.isclose(TIME, 17.0)]) < 1e-9


def multisine(**settings):
    usual = {"axis": "col+lon+lat+ped", "amplitude": (0.03, 0.07, 0.07, 0.01), "period": 10.0}
    return Multisine(**usual, band=(0.6, 40.0), duration=26.0, **settings)


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_axes_of_a_multisine_are_orthogonal(slope):
    """By the DFT of one period: each harmonic is one axis's alone, with the power asked for."""
    made = multisine(slope=slope)
    time = 3.0 + 0.002 * np.arange(5000)
    columns = made.added(time)["sticks"]
    lines = np.abs(np.fft.rfft(columns, axis=0)) / 2500.0
    found = {axis: np.flatnonzero(one > 1e-9) for axis, one in zip(made.axes, lines.T)}
    for axis, numbers in made.harmonics.items():
        assert np.array_equal(found[axis], numbers)
    every = np.concatenate(list(found.values()))
    assert np.unique(every).size == every.size
    assert np.array_equal(np.sort(every), np.arange(1, 64))  # 0.6 to 40 rad/s of 0.628 rad/s
    inner = columns.T @ columns / 5000.0
    power = np.diag(inner)
    # sums of 5000 products of order 1e-3 that cancel
    assert inner - np.diag(power) == pytest.approx(np.zeros((4, 4)), abs=1e-15)
    for axis, one in zip(made.axes, lines.T):
        k = made.harmonics[axis]
        shape = one[k] / one[k[0]]
        assert shape == pytest.approx((k / k[0]) ** (-0.5 * slope), rel=1e-9)


def test_a_multisine_has_its_peak_and_its_whole_periods():
    made = multisine()
    columns = made.added(step_times(26.0, 0.002))["sticks"]
    peaks = np.abs(columns).max(axis=0)
    # sampled at 500 Hz, a peak between two samples is missed by (40 rad/s 1 ms)^2 / 2 at most
    assert peaks == pytest.approx([0.03, 0.07, 0.07, 0.01], rel=1e-3)
    assert columns[1500:6500] == pytest.approx(columns[6500:11500], abs=1e-9)
    assert not columns[:1500].any()
    assert not columns[11500:].any()
    assert np.abs(columns[1500]).max() < 1e-6
    steepest = np.abs(np.diff(columns[1500:11499], axis=0)).max(axis=0)
    assert (np.abs(columns[11499]) <= 1.01 * steepest).all()
    said = made.relative_peak_factor
    for axis, one in zip(made.axes, columns[1500:6500].T):
        factor = np.ptp(one) / (2.0 * np.sqrt(2.0) * np.std(one))
        assert said[axis] == pytest.approx(factor, rel=2e-3)


def test_bands_and_amplitudes_are_the_vehicles_own(jr700):
    made = Multisine().on(jr700.parameters)
    assert made.amplitude == tuple(jr700.parameters[f"sweep.{a}_amplitude"] for a in made.axes)
    for axis, numbers in made.harmonics.items():
        frequencies = 2.0 * np.pi / made.period * numbers
        low, high = (jr700.parameters[f"sweep.{axis}_{end}"] for end in ("w_min", "w_max"))
        assert low <= frequencies[0] < frequencies[-1] <= high
        assert frequencies[-1] > high - 4.0 * 2.0 * np.pi / made.period


def test_a_sequence_is_its_parts_one_after_the_other():
    first = Step(axis="lat", amplitude=0.05, trim_time=1.0, duration=3.0)
    second = Chirp(axis="r", at="sensors", amplitude=0.2, band=(1.0, 20.0), duration=6.0,
                   trim_time=1.0)  # fmt: skip
    made = Sequence(parts=(first, Sequence(parts=(second, first))), pause=0.7)
    assert (made.duration, made.axis) == (12.7, "lat+r")
    time = step_times(made.duration, 0.002)
    added = made.added(time)
    starts = {0.0: first, 3.7: second, 9.7: first}
    for start, part in starts.items():
        place = part.at
        inside = slice(round(start / 0.002), round((start + part.duration) / 0.002))
        alone = part.added(step_times(part.duration, 0.002)[:-1])[place]
        assert added[place][inside] == pytest.approx(alone, abs=1e-9)
    assert not added["sticks"][1500:4850].any()


def test_sweep_is_written_as_asked(par):
    Sweep(axis="lon", duration=60.0, amplitude=0.1, band=(1.0, 20.0), leakage=0.05).write(par)
    assert par[PARAM.excitation] == SWEEP
    sticks = par[PARAM.excitation_col : PARAM.excitation_ped + 1]
    assert sticks == pytest.approx([0.005, 0.1, 0.005, 0.005], rel=1e-12)
    assert par[PARAM.excitation_start] == 3.0
    assert par[PARAM.excitation_duration] == 54.0
    assert (par[PARAM.sweep_w_min], par[PARAM.sweep_w_max]) == (1.0, 20.0)


@tabled("period", "trim", "periods")
def test_a_multisine_has_the_whole_periods_that_fit_between_its_trims(period, trim, periods):
    usual = {"axis": "lat", "amplitude": 0.03, "band": (0.1, 20.0), "duration": 26.0}
    wave = Multisine(**usual, period=period, trim_time=trim)
    assert wave.periods == periods
    time = np.arange(2600) / 100.0
    moved = np.flatnonzero(np.any(wave.sticks(time) != 0.0, axis=1)) / 100.0
    assert moved[[0, -1]] == pytest.approx([trim, trim + periods * period], abs=0.03)
    assert min(wave.harmonics["lat"]) == 1  # a mean is no oscillation


def everyday(size, speed):
    """Return the kinds, and pushes, places, speeds and accelerations of four minutes."""
    pilot, rows = grounded(0.02), []
    for _, _ in zip(range(12_000), hs.missions.Everyday(size=size, speed=speed).fly(pilot)):
        aims = [*vars(pilot.wanted).values()]  # north, east, down, their rates, accelerations
        rows.append([*pilot.wanted.pushed, *aims[:2], *aims[3:5], *aims[6:8]])
    pushed, places, rates, forces = np.split(np.array(rows), [4, 6, 8], axis=1)
    begins = np.any(np.diff(pushed, axis=0, prepend=0.0), axis=1) & np.any(pushed, axis=1)
    moved = (np.hypot(*one.T).max() for one in (rates, forces))
    return [text for _, text in pilot.phases], pushed[begins], places, moved


def test_everyday_flying_is_as_large_and_as_fast_as_asked():
    """All kinds come before one comes again, in a field of 12 m and what a stop of 5 m/s takes."""
    kinds, pushed, places, (fastest, hardest) = everyday(1.0, 5.0)
    for k in range(0, len(kinds) - 5, 6):
        assert sorted(kinds[k : k + 6]) == sorted(set(kinds))
    _, larger, _, (again, harder) = everyday(1.5, 5.0)
    few = min(len(pushed), len(larger))
    np.testing.assert_allclose(larger[:few], 1.5 * pushed[:few], rtol=1e-12)
    assert np.all(pushed.max(axis=0) > 0.04)
    assert np.all(pushed.min(axis=0) < -0.04)
    assert 0.9 * 5.0 < min(fastest, again) <= max(fastest, again) <= 5.0
    assert harder == pytest.approx(1.5 * hardest, rel=0.1)  # of so many draws each
    assert 8.0 < np.abs(places).max() < 12.0 + 25.0


@pytest.mark.slow
def test_everyday_flying_ends_in_the_field_and_is_another_one_for_each_seed(jr700):
    plan = hs.FlightPlan(mission=hs.missions.Everyday(duration=40.0), pilot=CALM)
    flight, other = (next(simulate(jr700, plan, seed=seed, jobs=1)) for seed in (1, 11))
    assert flight.script.finished
    assert flight.script.phases != other.script.phases
    assert np.ptp(flight.sticks, axis=0).min() > 0.04
    assert np.abs(flight.positions[-1] - [0.0, 0.0, -20.0]).max() < 30.0
