"""A cockpit without a window: scripted keys and axes fly, record, crash and leave."""

import numpy as np
import pytest

from helisim.hand import HandFlight, Sticks
from helisim.hand.sticks import Joystick
from helisim.hand.window import Cockpit, Inputs, fly_in
from helisim.records.storage import read_record


class Window:
    """A window whose pilot presses keys by a script: (from s, to s, key)."""

    def __init__(self, flight, clock, script=(), *, axes=None, closes=1e9):
        self.clock, self.script, self.axes, self.closes = clock, script, axes, closes
        self.panels = []

    def is_running(self):
        return self.clock() < self.closes

    def read(self):
        now = self.clock()
        held = frozenset(key for start, end, key in self.script if start <= now < end)
        return Inputs(held, self.axes(now) if self.axes else None)

    def show(self, legend, readout, message):
        self.panels.append((self.clock(), legend, dict(readout), message))

    def messages(self, start=0.0, end=1e9):
        return [one[3] for one in self.panels if start < one[0] < end]


class Clock:
    """A clock that only sleeping moves."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += max(seconds, 1e-3)


@pytest.fixture(scope="module")
def flight(jr700):
    return HandFlight(jr700, flown_with="keyboard")


@pytest.fixture
def fly(flight, tmp_path):
    """Fly a script and return the cockpit and the window."""

    def flown(script=(), *, sticks=None, seconds=1e9, assist="hover", **window):
        flight.reset()
        flight.assist = assist
        clock = Clock()
        seat = Cockpit(flight, sticks or Sticks(), tmp_path / "hand.parquet")
        seen = Window(flight, clock, script, **window)
        fly_in(seen, seat, duration=seconds, clock=clock, sleep=clock.sleep)
        return seat, seen

    return flown


def tap(at, key):
    return (at, at + 0.05, key)


@pytest.mark.slow
def test_keys_fly_and_record(fly, tmp_path):
    """Forward for two seconds, with R before and after: the record has the stick and the way."""
    seat, seen = fly(
        [tap(0.5, "r"), (1.0, 3.0, "up"), tap(4.0, "r"), tap(5.0, "escape")], seconds=20.0
    )
    assert seat.closed
    assert seat.written == [tmp_path / "hand.parquet"]
    record = read_record(tmp_path / "hand.parquet")
    assert record.duration == pytest.approx(3.5, abs=0.1)
    assert record["north"][-1] > 1.0
    assert record["LON"].min() < -0.005
    assert record.provenance["by_hand"]["with"] == "keyboard"
    assert seen.panels[-1][0] < 6.0
    shown = [readout for at, _, readout, _ in seen.panels if 1.5 < at < 2.5]
    assert all(readout["lon"] == "-35 %" for readout in shown)
    assert all(float(readout["recorded"].split()[0]) > 0.9 for readout in shown)
    assert any("written" in text and "hand.parquet" in text for text in seen.messages())


@pytest.mark.slow
def test_a_second_of_the_clock_is_a_second_of_flight(fly, flight, jr700):
    """Paused, time stands still; drawn or stepped alone, the state is the same to the bit."""
    fly([tap(0.5, "p"), tap(1.5, "p")], seconds=2.0)
    assert flight.time == pytest.approx(1.0, abs=0.1)
    alone = HandFlight(jr700)
    alone.fly(flight.time)
    np.testing.assert_array_equal(alone.data.qpos, flight.data.qpos)


@pytest.mark.slow
def test_every_recording_has_a_file(fly, tmp_path):
    """None is written over, whatever is there before; a reset, and the end, write what runs."""
    fly([tap(0.1, "r"), tap(0.4, "r"), tap(0.6, "r")], closes=1.0)
    seat, _ = fly([tap(0.1, "r"), tap(1.0, "backspace")], seconds=1.2)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["hand.parquet", "hand_2.parquet", "hand_3.parquet"]
    assert read_record(seat.written[0]).duration == pytest.approx(0.9, abs=0.1)

    def interrupted(now):
        if now > 1.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly([tap(0.1, "r")], axes=interrupted)
    assert read_record(tmp_path / "hand_4.parquet").duration > 0.7


def test_a_crash_is_told_and_recorded_and_a_key_starts_again(fly, flight):
    """The collective all the way down: the message says why; Backspace hovers again."""
    seat, seen = fly(
        [tap(0.1, "r"), (0.2, 6.0, "s"), tap(7.0, "backspace")], assist="level", seconds=8.0
    )
    crashed = seen.messages(6.0, 6.9)
    assert all("hit the ground at" in text and "Backspace" in text for text in crashed)
    assert read_record(seat.written[0]).ended
    assert not flight.crashed
    assert flight.time == pytest.approx(1.0, abs=0.1)
    assert flight.clearance > 1.0


def test_a_key_switches_the_assist_and_too_short_a_recording_says_so(fly, flight, tmp_path):
    _, seen = fly([tap(0.1, "h"), (0.2, 0.22, "r"), (0.25, 0.27, "r")], seconds=0.5)
    assert flight.assist == "level"
    assert any("assist level" in text for text in seen.messages())
    assert "no record" in seen.messages()[-1]
    assert seen.panels[0][1][:2] == (("A D", "yaw"), ("W S", "lift"))
    assert not list(tmp_path.iterdir())


def test_a_joystick_flies_and_may_be_lost(fly, flight):
    """Throttle up for two seconds; without it the flight waits, and goes on with P."""
    sticks = Sticks(Joystick(0, "radio"))

    def axes(now):
        return None if 2.0 < now < 3.0 else (0.0, 0.0, 0.5 if now < 2.0 else 0.0, 0.0)

    _, seen = fly([tap(4.0, "p")], sticks=sticks, axes=axes, seconds=5.0)
    assert flight.time == pytest.approx(3.0, abs=0.2)
    assert set(seen.messages(2.2, 2.8)) == {"radio is gone: plug it in, then press P"}
    assert flight.clearance > 1.8
