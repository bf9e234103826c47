"""Closed loops at their ticks: closed forms, python-control, and what is not known."""

import csv
import math
from pathlib import Path
from types import SimpleNamespace

import control
import control as ct
import numpy as np
import pytest

import helisim as hs
from command import parm_file
from helisim import ident
from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw, Terms
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins
from helisim.handling.loop import GRID, Curve, NoResponse
from ident_data import found as fitted
from tabled import tabled

PERIOD, GAIN = 0.01, 20.0


INTEGRAL = LinearSystem([[1.0]], [[PERIOD]], [[1.0]], [[0.0]], PERIOD, ("lat",), ("phi",))
NONE = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0))
HOLD = LinearSystem(*NONE, [[-GAIN, GAIN]], PERIOD, ("phi", "LAT"), ("lat",))
"""It commands a rate of GAIN times what is left to the stick."""


def test_an_integral_that_is_held_goes_as_a_power():
    """Each tick leaves 1 - k T of what was left: y = 1 - (1 - k T)^n, one pole."""
    loop = ClosedLoop(INTEGRAL, HOLD)
    np.testing.assert_allclose(loop.poles, [np.log(1.0 - GAIN * PERIOD) / PERIOD], rtol=1e-12)
    history = loop.step("roll", size=0.3, duration=0.5)
    left = (1.0 - GAIN * PERIOD) ** np.arange(51)
    np.testing.assert_allclose(history.time, np.arange(51) * PERIOD)
    np.testing.assert_allclose(history.signals["phi"], 0.3 * (1.0 - left), atol=1e-14)
    np.testing.assert_allclose(history.signals["lat"], 0.3 * GAIN * left, atol=1e-13)
    assert set(history.signals) == {"LAT", "lat", "phi"}


def test_every_response_of_a_rate_that_is_commanded_is_its_closed_form():
    """Of phi = P u and p = u, P = T / (z - 1), behind u = K (s - phi) - R p: L = K P + R."""
    rate, rows = 0.3, ([[1.0], [0.0]], [[0.0], [1.0]])
    rated = LinearSystem([[1.0]], [[PERIOD]], *rows, PERIOD, ("lat",), ("phi", "p"))
    none = np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((1, 0))
    law = LinearSystem(*none, [[-GAIN, -rate, GAIN]], PERIOD, ("phi", "p", "LAT"), ("lat",))
    loop = ClosedLoop(rated, law)
    plant = PERIOD / (np.exp(1j * loop.frequency * PERIOD) - 1.0)
    open_ = GAIN * plant + rate
    to = {"lat": 1.0 / (1.0 + open_), "phi": plant / (1.0 + open_), "p": 1.0 / (1.0 + open_)}
    back = GAIN + 1j * loop.frequency * rate  # of an angle that is added, its derivative on p
    for found, wanted in (
        (loop.broken("lat"), open_),
        (loop.broken("lat", "sensors"), 1.0 / (1.0 - back * to["phi"]) - 1.0),
        (loop.disturbance("lat"), 1.0 - back * to["phi"]),
        (loop.command("lat"), GAIN * to["phi"]),
        (loop.command("lat", "p"), GAIN * to["p"]),
        (loop.turned("lat", "lat"), to["phi"]),
        (loop.actuator("lat"), GAIN * to["lat"]),
        (loop.actuator("lat", "disturbance"), -back * to["lat"]),
        *((one, to[name]) for name, one in loop.reached("actuators", "lat").items()),
        *((one, -back * to[name]) for name, one in loop.reached("sensors", "lat").items()),
    ):
        np.testing.assert_allclose(found.response, wanted, rtol=1e-9)
    assert set(loop.reached("sticks", "lat")) == {"lat", "phi", "p"}


def test_a_stick_that_is_seen_late_moves_all_that_much_later():
    """By 2.5 ticks, seen at the third; its response by 25 ms, whatever a tick is."""
    late = SimpleNamespace(
        inputs=INTEGRAL.inputs,
        outputs=INTEGRAL.outputs,
        response=INTEGRAL.response,
        sampled=INTEGRAL,
        stick_latency={"LAT": 2.5 * PERIOD},
    )
    loop, soon = ClosedLoop(late, HOLD), ClosedLoop(INTEGRAL, HOLD)
    then, now = (one.step("lat", size=1.0, duration=0.2).signals["phi"] for one in (loop, soon))
    np.testing.assert_allclose(then[3:], now[:-3], atol=1e-15)
    assert not then[:3].any()
    ratio = loop.command("lat").response / soon.command("lat").response
    np.testing.assert_allclose(ratio, np.exp(-0.025j * loop.frequency), rtol=1e-12)
    np.testing.assert_allclose(loop.broken("lat").response, soon.broken("lat").response)


def test_responses_alone_have_no_poles():
    def seen(inputs, outputs):
        def response(frequency):
            return np.ones((1, 1, frequency.size), dtype=complex)

        return SimpleNamespace(inputs=inputs, outputs=outputs, response=response)

    with pytest.raises(NoResponse, match="the plant is known by its responses alone"):
        _ = ClosedLoop(seen(("lat",), ("phi",)), HOLD).poles
    with pytest.raises(NoResponse, match="the law is known by its responses alone"):
        ClosedLoop(INTEGRAL, seen(("phi",), ("lat",))).step("lat", size=1.0, duration=1.0)


@tabled("ask", "error", "says")
def test_what_a_loop_has_not_is_refused(ask, error, says):
    with pytest.raises(error, match=says):
        ask()


OMEGA = np.geomspace(0.5, 100.0, 30)


@pytest.fixture(scope="module")
def loop():
    yaw = fitted(ident.structures.yaw_base, N_r=-0.8, N_ped=48.0, tau_r_base=0.014)
    heave = fitted(ident.structures.heave, Z_w=-0.9, Z_col=-40.0, tau_col=0.0107)
    plant = hs.Plant((yaw, heave), latency=0.004)
    rng = np.random.default_rng(1)
    shapes = {"b": (3, 4), "c": (4, 3), "d": (4, 4)}
    law = hs.StateSpaceLaw(
        period=0.002,
        inputs=("r", "az", "PED", "COL"),
        a=np.diag([0.9, 0.5, 0.99]),
        **{name: 0.02 * rng.standard_normal(shape) for name, shape in shapes.items()},
    )
    return ClosedLoop(plant, law.linear(0.002), OMEGA)


@pytest.mark.filterwarnings("ignore:Unused output")
def test_closed_loop_is_what_python_control_connects(loop):
    """`interconnect` of the two exported systems by their names: poles and responses."""
    plant, law = loop.plant.sampled.system, loop.law.sampled.system
    system = loop.system()
    own = control.interconnect(
        [plant, law], inputs=["PED", "COL"], outputs=["r", "az", "psi", "ped"]
    )
    assert np.poly(system.A) == pytest.approx(np.poly(own.A), abs=1e-9)
    for z in np.exp(1j * OMEGA * 0.002):
        found = system(z)[[system.output_labels.index(name) for name in own.output_labels]]
        # each a sum of hundreds of terms
        assert found == pytest.approx(own(z), rel=1e-8, abs=1e-12)


def test_a_cut_loop_has_the_response_of_the_frame(loop):
    """As `broken`, found frequency by frequency from the models' own responses."""
    cut, wanted = loop.system(cut="yaw"), loop.broken("ped").response
    row, column = cut.output_labels.index("ped"), cut.input_labels.index("ped")
    broken = -np.array([cut(z)[row, column] for z in np.exp(1j * OMEGA * 0.002)])
    # az answers as fast at any frequency, so the ticks fold its fast part onto the slow: 3e-3
    assert np.all(np.abs(broken - wanted) < 5e-3 * np.abs(wanted).max())
    with pytest.raises(NoResponse, match="no command 'lat'"):
        loop.system(cut="lat")


# Margins and crossover of broken loops, against python-control.

S = ct.tf("s")
LOOPS = {
    "third order": 4.0 / (S * (S / 2.0 + 1.0) * (S / 20.0 + 1.0)),
    "integral, lead": 12.0 * (S + 2.0) * (S + 1.0) / (S**2 * (S / 30.0 + 1.0) ** 2),
    "resonance": 4.0 / S * 100.0 / (S**2 + 3.0 * S + 100.0),
    "unstable": 60.0 / (S * (S / 2.0 + 1.0) * (S / 20.0 + 1.0)),
}
INTERPOLATION = 2e-4
"""Straight lines of dB and of phase over log frequency between points 1.7 % apart; a resonance with
damping 0.15 is bent most, by 0.01 dB and 0.1 deg."""


def curve(loop, frequency=GRID):
    return Curve(frequency, loop(1j * frequency))


@pytest.mark.parametrize("name", LOOPS)
def test_all_crossings_are_those_of_python_control(name):
    gains, phases, _, turns, ones, _ = ct.stability_margins(LOOPS[name], returnall=True)
    inside = (turns > GRID[0]) & (turns < GRID[-1])
    found = margins(curve(LOOPS[name]))
    own = np.array(found.gain).reshape(-1, 2)
    order = np.argsort(turns[inside])
    np.testing.assert_allclose(own[:, 0], turns[inside][order], rtol=INTERPOLATION)
    expected = 20.0 * np.log10(gains[inside][order])
    np.testing.assert_allclose(own[:, 1], expected, atol=0.01)
    other = np.array(found.phase)
    order = np.argsort(ones)
    np.testing.assert_allclose(other[:, 0], ones[order], rtol=INTERPOLATION)
    wrapped = (phases[order] + 180.0) % 360.0 - 180.0
    np.testing.assert_allclose(np.degrees(other[:, 1]), wrapped, atol=0.1)


@pytest.mark.parametrize("name", LOOPS)
def test_the_sign_says_whether_the_closed_loop_is_stable(name):
    poles = ct.feedback(LOOPS[name], 1).poles()
    found = margins(curve(LOOPS[name]))
    assert found.stable == bool(np.all(poles.real < 0.0))
    assert (found.least_gain > 0.0) == found.stable
    assert (found.least_phase > 0.0) == found.stable


def test_a_curve_between_its_points_is_a_power_and_a_turn():
    """Straight lines of log size and of phase over log frequency: (s / 3)^-1.7, which is both."""
    found = Curve(GRID[::9], (1j * GRID[::9] / 3.0) ** -1.7)
    wanted = np.array([0.2, 0.33, 3.0, 47.0])
    np.testing.assert_allclose(found.at(wanted), (1j * wanted / 3.0) ** -1.7, rtol=1e-12)
    late = Curve(GRID, np.exp(-0.1j * GRID))
    np.testing.assert_allclose(late.phase, -0.1 * GRID, rtol=1e-12)
    for beyond in (0.19, 151.0):
        with pytest.raises(NoResponse, match=r"known from 0\.2 to 150 rad/s, not at"):
            late.at([1.0, beyond])


def test_what_is_no_curve_is_refused():
    one, two = np.array([1.0]), np.array([1.0, 2.0])
    for frequency, response in ((two, np.ones(3)), (two[None], two[None]), (one, one)):
        with pytest.raises(InputError, match="a curve has two points or more, as many responses"):
            Curve(frequency, response)
    for frequency in (two - 1.0, two[::-1], one[[0, 0]]):
        with pytest.raises(InputError, match="positive and increasing"):
            Curve(frequency, two)


@pytest.mark.parametrize("gain", [1e-3, 0.1, 0.5, 30.0, 1e4])
def test_a_crossover_beyond_the_band_is_continued(gain):
    """K/s has its crossover at K, inside of the band and outside."""
    found = margins(curve(gain / S))
    assert found.crossover == pytest.approx(gain, rel=1e-9)
    assert found.least_gain == 60.0  # dB, the most that is told
    # beyond the band's end a gain that falls below one may do so at the phase there; one that is
    # below leaves its share of a half turn
    wide = np.pi * (1.0 - 0.5 * gain / GRID[0]) if gain < GRID[0] else 0.5 * np.pi
    assert found.open_phase == pytest.approx(np.pi if gain == 30.0 or gain == 0.5 else wide)


def test_a_phase_margin_is_within_a_half_turn_to_either_side():
    """Between two points beside the positive axis, 0.3 deg from it at a gain of one."""
    found = margins(Curve([1.0, 2.0], [1.1 * np.exp(0.01j), np.exp(-0.02j) / 1.1]))
    assert found.phase == (pytest.approx((2.0**0.5, np.pi - 0.005)),)


@pytest.mark.parametrize("delay", [0.004, 0.008, 0.0104, 0.0106, 0.013])
def test_a_gain_margin_beyond_the_band_is_extended(delay):
    """K exp(-s T) / s has -180 deg at pi / (2 T), where its gain is 2 K T / pi."""
    loop = Curve(GRID, 20.0 * np.exp(-1j * GRID * delay) / (1j * GRID))
    expected = -20.0 * np.log10(20.0 * delay * 2.0 / np.pi)
    assert margins(loop).least_gain == pytest.approx(expected, abs=1e-3)


def test_a_gain_that_rises_is_not_extended():
    """Of 0.02 sqrt(s) exp(-s / 60) the phase is -180 deg beyond the band: the end's gain counts."""
    loop = Curve(GRID, 0.02 * np.sqrt(1j * GRID) * np.exp(-1j * GRID / 60.0))
    assert margins(loop).least_gain == pytest.approx(-loop.decibel[-1], rel=1e-9)


# ArduCopter's law repeats, tick by tick, what an unmodified ArduCopter logged of its own.

# ArduCopter-heli 4.7.0-dev (90700977c5) flying its own built-in helicopter under SystemID's axes
# 10 to 12: 45 ticks of each, its RATE, PIDR, PIDP, PIDY, ANG and SIDD messages as logged: degrees,
# of PIDs radians. Its gains then were these.
TICKS = Path(__file__).with_name("ticks.csv")
PARAMETERS = parm_file(TICKS.with_suffix(".parm"))
ANGLE = {word: PARAMETERS[f"ATC_ANG_{word}_P"] for word in ("RLL", "PIT", "YAW")}
SINGLE = 2e-7
"""Rounding of a log's numbers, of single precision, in a sum of several."""


def ticks(axis):
    """Return what was logged of an axis, name -> (n_tick,), SI."""
    with TICKS.open() as file:
        rows = [row for row in csv.DictReader(file) if row["axis"] == axis]
    found = {
        name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name != "axis"
    }
    attitudes = ("roll", "pitch", "yaw")
    angles = ["wanted", "rate", *(f"{one}{w}" for one in ("aim_", "") for w in attitudes)]
    return found | {name: np.radians(found[name]) for name in angles}


@pytest.mark.parametrize("axis", COMMANDS)
def test_the_rates_terms_are_those_of_the_log(axis):
    """From the first tick's terms, wanted rate and gyro alone, all 44 that follow."""
    own, log = ArduCopterLaw.of(PARAMETERS).rates[axis], ticks(axis)
    now = Terms(log["Tar"][0], log["Err"][0], log["D"][0] / own.d, log["I"][0], 0.0)
    for k, period in enumerate(1e-6 * np.diff(log["time_us"])):
        now = own.tick(now, log["wanted"][k], log["rate"][k + 1], period)
        logged = sum(log[name][k + 1] for name in ("P", "I", "D", "FF"))
        assert now.target == pytest.approx(log["Tar"][k + 1], abs=SINGLE)
        assert now.error == pytest.approx(log["Err"][k + 1], abs=SINGLE)
        assert now.integral == pytest.approx(log["I"][k + 1], abs=SINGLE)
        assert now.command == pytest.approx(logged, abs=SINGLE)
        # what SystemID added at the tick before is in the output, and not in the terms
        assert log["out"][k + 1] - logged == pytest.approx(log["added"][k], abs=SINGLE)


@pytest.mark.parametrize("axis", COMMANDS)
def test_the_linear_law_follows_attitude_and_gyro_of_the_log(axis):
    """Its matrices, driven by attitude and gyro, give wanted rates and commands.

    Attitudes turn as quaternions there: products of errors of 1 deg, 2e-4 of a radian, are left.
    """
    log, row = ticks(axis), COMMANDS.index(axis)
    lean = float(np.mean(log["roll"])), float(np.mean(log["pitch"]))
    law = ArduCopterLaw.of(PARAMETERS, lean=lean)
    own, matrices = law.rates[axis], law.ticked
    state = np.zeros(21)
    first = log["wanted"], log["Tar"], log["Err"], log["D"] / own.d, log["I"]
    for place, one in enumerate(first):
        state[3 * place + row] = one[0]
    aim, attitude = (
        np.column_stack([log[f"{one}{name}"] for name in ("roll", "pitch", "yaw")])
        for one in ("aim_", "")
    )
    off = (attitude - aim + np.pi) % (2.0 * np.pi) - np.pi
    wanted, commands = [], []
    for rate, turned in zip(log["rate"][1:], off[1:]):
        seen = np.zeros(12)
        seen[row], seen[3:6] = rate, turned
        commands.append((matrices.c @ state + matrices.d @ seen)[row])
        state = matrices.a @ state + matrices.b @ seen
        wanted.append(state[row])
    logged = sum(log[name] for name in ("P", "I", "D", "FF"))
    assert np.array(wanted) == pytest.approx(log["wanted"][1:], abs=2e-4)  # rad/s
    assert np.array(commands) == pytest.approx(logged[1:], abs=2e-5)
    assert np.ptp(logged) > 0.01


def test_a_response_is_the_z_transform_of_the_difference_equations():
    """PID of ArduPilot's yaw, FLTE 0: P + I T / (1 - 1/z) + D (1 - 1/z) / T of what is sensed."""
    law = ArduCopterLaw.of(PARAMETERS)
    frequency = np.array([0.5, 5.0, 50.0])
    back = np.exp(-1j * frequency * law.period)
    pid = 0.24685 + 0.0245 * law.period / (1.0 - back) + 0.0039 * (1.0 - back) / law.period
    found = law.response(frequency)[2, 2]
    assert found == pytest.approx(-pid * law.gyro(frequency), rel=1e-9)
    # upright, each angle's error is a rate of its own axis
    assert law.wanted(np.eye(3), np.zeros((3, 3))) == pytest.approx(np.diag([*ANGLE.values()]))


@pytest.mark.parametrize("shaped", [0.0, 1.0])
@pytest.mark.parametrize("late", [0.0, 0.001, 0.3])
def test_a_stick_acts_as_the_attitude_that_it_asks_for(shaped, late):
    """A stick over the attitude, -(z A + z M / P), with the target A and its derivative M.

    Shaped, of roll and pitch: (z - 1) A = T M, z M = (1 - z A) / 0.2; of yaw, a rate asked for:
    z M = M + (1 - M) T / late. Unshaped the target is what is asked for, of yaw summed.
    """
    law = ArduCopterLaw.of(PARAMETERS | {"ATC_RATE_FF_ENAB": shaped, "PILOT_Y_RATE_TC": late})
    frequency = np.array([0.5, 5.0, 50.0])
    found, tick = law.response(frequency), 0.0025
    z = np.exp(1j * frequency * tick)
    target = 1.0 / (z + shaped * z * (z - 1.0) * 0.2 / tick)
    along = min(1.0, tick / max(late, 0.01)) if late else 1.0
    turning = along / (z - 1.0 + along) if shaped else np.ones(3)
    moves = [shaped * (z - 1.0) / tick * target] * 2 + [shaped * turning]
    targets = [target, target, tick * (turning if shaped else 1.0 / z * z) / (z - 1.0)]
    for k, word in enumerate(("RLL", "PIT", "YAW")):
        wanted = -z * (targets[k] + moves[k] / ANGLE[word])
        np.testing.assert_allclose(found[k, 6 + k] / found[k, 3 + k], wanted, rtol=1e-9)


def test_the_gyros_filter_is_a_butterworth_of_second_order():
    """-3.01 dB and 90 deg late at its corner, which the bilinear transform keeps in its place."""
    law = ArduCopterLaw.of(PARAMETERS)
    (corner,) = law.gyro(np.array([2.0 * math.pi * 20.0]))
    assert corner == pytest.approx(-1j / math.sqrt(2.0), rel=1e-6)


def test_the_targets_derivative_is_fed_forward():
    """AC_PID: DFF is D_FF times the difference of filtered targets over the tick."""
    ahead = ArduCopterLaw.of(PARAMETERS | {"ATC_RAT_YAW_D_FF": 0.02, "ATC_RAT_YAW_FLTT": 0.0})
    kept = ArduCopterLaw.of(PARAMETERS | {"ATC_RAT_YAW_FLTT": 0.0})
    now, then = (
        one.rates["ped"].tick(Terms(0.1, 0.0, 0.0, 0.0, 0.0), 0.3, 0.0, 0.0025).command
        for one in (kept, ahead)
    )
    assert then - now == pytest.approx(0.02 * (0.3 - 0.1) / 0.0025)


def test_an_integral_beyond_its_least_leak_leaks():
    """Of roll, 2 % a tick: steady gain I T / 0.02 + P instead of an integrator."""
    frequency = np.array([1e-3])
    kept, leaks = (
        ArduCopterLaw.of(PARAMETERS, steady={"lat": steady}).response(frequency)[0, 0, 0]
        for steady in (0.0, 0.2)
    )
    assert abs(kept) > 50.0
    assert leaks.real == pytest.approx(-(0.06 + 0.105 * 0.0025 / 0.02), rel=1e-2)


def test_what_the_law_leaves_out_is_said():
    notch = {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_REF": 1.0}  # it follows a sensor
    said = ArduCopterLaw.of(PARAMETERS | {"ATC_RAT_RLL_SMAX": 20.0} | notch)
    assert len(said.remarks) == 2
    assert "slew limiter of roll" in said.remarks[0]
    assert not ArduCopterLaw.of(PARAMETERS).remarks
