"""A flight under Rotorflight's law as a log of its Blackbox."""

import math

import numpy as np
import pytest

import blackbox_logs
import helisim as hs
import rotorflight_flights as flights
from helisim.logs.blackbox import Blackbox

EVERY = 2


@pytest.fixture(scope="module")
def flown():
    vehicle = hs.load("jr700")
    law = flights.law_for(vehicle)
    flight, loops = flights.fly(vehicle, law, seed=2, duration=10.0, shaking=flights.Shaking())
    assert flight.end is None
    return vehicle, law, flight, flights.columns(vehicle, law, flight, loops, every=EVERY)


def test_it_is_read_as_it_was_written(flown, tmp_path):
    _, law, _, columns = flown
    lines = flights.header(law, 0.002, every=EVERY)
    path = tmp_path / "flight.bbl"
    path.write_bytes(blackbox_logs.encode(columns, lines))
    log = Blackbox(path)
    assert log.firmware == "Rotorflight 4.6.0"
    assert log.header["yawPID"] == "80,120,10,0,0"
    for name, values in columns.items():
        read = 1e6 * log.time() if name == "time" else log.raw(name)
        np.testing.assert_allclose(read, values, rtol=0.0, atol=1e-6)
    assert np.median(np.diff(log.time())) == pytest.approx(EVERY * 0.002)


def test_it_has_what_flew(flown):
    """The servos that the simulator recorded, and motion in the firmware's axes, to a count."""
    vehicle, law, flight, columns = flown
    front, left, right, tail = flight.servo_commands[:-1:EVERY].T
    col, lon, lat = vehicle.swashplate.unmix(front, left, right)
    angles = {
        0: law.roll.range * lat / 12.0,
        1: -law.pitch.range * lon / 12.0,
        2: -(law.yaw.centre + law.yaw.range * tail) / 24.0,
        3: (law.collective.centre + law.collective.range * col) / 12.0,
    }
    for axis, angle in angles.items():
        own = columns[f"mixer[{axis}]"][: angle.size]
        np.testing.assert_allclose(own, 1e3 * np.degrees(angle), rtol=0.0, atol=0.51)
    true = np.degrees(flight.gyro_rates[:-1:EVERY]) * [1.0, -1.0, -1.0]
    for axis, rate in enumerate(true.T):
        off = columns[f"gyroRAW[{axis}]"][: rate.size] - rate
        # noise of 1 deg/s, a sine of 2, and rounding
        assert np.std(off) == pytest.approx(math.sqrt(1.0 + 2.0 + 1.0 / 12.0), rel=0.1)


def test_the_terms_make_the_mixer(flown):
    """Within what rounding six terms and their sum leaves; roll has cross coupling besides."""
    *_, columns = flown
    for axis in (1, 2):
        terms = [columns[f"axis{name}[{axis}]"] for name in "PIDFO"]
        np.testing.assert_allclose(sum(terms), columns[f"mixer[{axis}]"], rtol=0.0, atol=3.0)
    for axis in (0, 1):  # F 100: 2.5 counts for 1 deg/s, which is rounded
        asked, given = columns[f"setpoint[{axis}]"], columns[f"axisF[{axis}]"]
        np.testing.assert_allclose(given, 2.5 * asked, rtol=0.0, atol=0.5 + 2.5 * 0.5)
    stick = columns["rcCommand[2]"]
    np.testing.assert_allclose(columns["setpoint[2]"], -240.0 / 500.0 * stick, rtol=0.0, atol=0.75)
