"""ArduCopter's law repeats, tick by tick, what an unmodified ArduCopter logged of its own."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw, Terms

# ArduCopter-heli 4.7.0-dev (90700977c5) flying its own built-in helicopter under SystemID's axes
# 10 to 12: 45 ticks of each, its RATE, PIDR, PIDP, PIDY, ANG and SIDD messages as logged: degrees,
# of PIDs radians. Its gains then were these.
TICKS = Path(__file__).with_name("ticks.csv")
GAINS = {
    "RLL": {"P": 0.06, "I": 0.105, "D": 1e-4, "FF": 0.21, "FLTE": 20.0, "ILMI": 0.1, "IMAX": 0.4},
    "PIT": {"P": 0.024, "I": 0.095, "D": 2e-3, "FF": 0.19, "FLTE": 20.0, "ILMI": 0.1, "IMAX": 0.4},
    "YAW": {"P": 0.24685, "I": 0.0245, "D": 0.0039, "FF": 0.0, "FLTE": 0.0, "ILMI": 0.0, "IMAX": 1},
}
ANGLE = {"RLL": 4.0, "PIT": 6.0, "YAW": 5.8}
PARAMETERS = {
    "SCHED_LOOP_RATE": 400.0,
    "INS_GYRO_FILTER": 20.0,
    "ATC_INPUT_TC": 0.2,
    "ATC_RATE_FF_ENAB": 1.0,
    **{f"ATC_ANG_{word}_P": gain for word, gain in ANGLE.items()},
    **{
        f"ATC_RAT_{word}_{name}": value
        for word, gains in GAINS.items()
        for name, value in ({"FLTT": 20.0, "FLTD": 0.0, "D_FF": 0.0} | gains).items()
    },
}
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


def test_missing_parameters_are_named():
    short = {name: value for name, value in PARAMETERS.items() if name != "ATC_RAT_YAW_ILMI"}
    with pytest.raises(InputError, match="lack ATC_RAT_YAW_ILMI"):
        ArduCopterLaw.of(short)


def test_what_the_law_leaves_out_is_said():
    said = ArduCopterLaw.of(PARAMETERS | {"ATC_RAT_RLL_SMAX": 20.0, "INS_HNTCH_ENABLE": 1.0})
    assert len(said.remarks) == 2
    assert "slew limiter of roll" in said.remarks[0]
    assert not ArduCopterLaw.of(PARAMETERS).remarks
