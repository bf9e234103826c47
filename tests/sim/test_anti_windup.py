"""In flight: an integral that is held while its servo command is saturated, and one that isn't."""

import mujoco
import numpy as np
import pytest

from helisim.physics.native import installed
from helisim.vehicle import GyroSettings
from helisim.vehicle.motion import addresses
from plates import H3_120

START = 0.1
"""s, at which the stick goes to its stop."""


def flown(jr700, stick, hold, *, anti_windup):
    """Hold one stick at its stop, let go, fly on for 1 s; return time, rates and cyclic, pedal."""
    # the whole travel of the cyclic sticks commands more than full cyclic can give
    settings = GyroSettings(aileron_rate=1.0, elevator_rate=1.0).as_parameters()
    vehicle = jr700.with_settings({**settings, "gyro.anti_windup": float(anti_windup)})
    data, control = vehicle.hovering(), addresses(vehicle.model).control
    rows = []
    with installed():
        for _ in range(round((START + hold + 1.0) / vehicle.model.opt.timestep)):
            data.ctrl[control + stick] = 0.5 if START <= data.time < START + hold else 0.0
            mujoco.mj_step(vehicle.model, data)
            commands = data.sensor("servo_command").data
            swash = H3_120.unmix(*commands[:3])
            rates = data.sensor("imu_gyro").data * [1.0, -1.0, -1.0]
            rows.append([*data.sensor("clock").data, *rates, swash[2], swash[1], commands[3]])
    time, p, q, r, lat, lon, ped = np.array(rows).T
    return time, {"p": p, "q": q, "r": r}, {"lat": lat, "lon": lon, "ped": ped}


def test_a_held_pedal_overshoots_little_with_anti_windup(jr700):
    """Full pedal saturates the tail servo; what the integral gathers meanwhile is overshoot."""
    asked = 0.5 * jr700.parameters["gyro.k_delta"] / jr700.parameters["gyro.k_a"]
    over, under = {}, {}
    for anti_windup in (True, False):
        time, rates, commands = flown(jr700, 3, 0.3, anti_windup=anti_windup)
        assert np.count_nonzero(commands["ped"] >= 0.5) > 20  # 40 ms at the stop
        assert np.abs(commands["ped"]).max() <= 0.5
        let_go = time > START + 0.3
        over[anti_windup] = rates["r"][~let_go].max() - asked
        under[anti_windup] = -rates["r"][let_go].min()
    # the loop's own overshoot of a step that stays within the limits is a quarter (see below)
    assert over[True] < 0.25 * asked < over[False]
    assert under[True] < 0.25 * asked < under[False]


def test_the_overshoot_within_the_limits(jr700):
    """A pedal step that never saturates overshoots by a quarter, with anti-windup or without."""
    peaks = []
    for anti_windup in (1.0, 0.0):
        vehicle = jr700.with_settings({"gyro.anti_windup": anti_windup})
        data, control = vehicle.hovering(), addresses(vehicle.model).control
        rates = []
        with installed():
            for _ in range(250):
                data.ctrl[control + 3] = 0.02
                mujoco.mj_step(vehicle.model, data)
                rates.append(-data.sensor("imu_gyro").data[2])
        peaks.append(max(rates) / (0.02 * vehicle.parameters["gyro.k_delta"]))
    assert peaks[0] == peaks[1]
    assert peaks[0] * jr700.parameters["gyro.k_a"] == pytest.approx(1.25, abs=0.03)


@pytest.mark.parametrize(("stick", "rate", "command"), [(2, "p", "lat"), (1, "q", "lon")])
def test_recovery_does_not_depend_on_how_long_the_cyclic_was_saturated(jr700, stick, rate, command):
    """Once let go, the angle still swept is the same after 0.2 and 0.5 s; without, it grows."""
    swept = {}
    for anti_windup in (True, False):
        for hold in (0.2, 0.5):
            time, rates, commands = flown(jr700, stick, hold, anti_windup=anti_windup)
            assert np.count_nonzero(commands[command] >= 0.5 - 1e-9) > 20
            after = (time > START + hold) & (time < START + hold + 0.5)
            swept[anti_windup, hold] = np.sum(rates[rate][after]) * 0.002
    # the attitude meanwhile differs by more than a radian, and with it gravity: 5 %
    assert swept[True, 0.5] == pytest.approx(swept[True, 0.2], rel=0.05)
    assert swept[False, 0.5] > 1.3 * swept[False, 0.2]
    # and after the longer time it is still less than without after the shorter
    assert swept[True, 0.5] < swept[False, 0.2]
