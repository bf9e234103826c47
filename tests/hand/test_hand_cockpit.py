"""A cockpit without a window: scripted keys and axes fly, record, crash and leave."""

from contextlib import nullcontext

import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError, StorageError
from helisim.hand import HandFlight, Inputs, JoystickMap, JoystickSticks, KeyboardSticks
from helisim.hand.sticks import Joystick, choose, joysticks, read_axes
from helisim.hand.window import CAMERAS, Cockpit, Logbook, fly_in
from helisim.records.storage import read_record


class Window:
    """A window whose pilot presses keys by a script: (from s, to s, key)."""

    def __init__(self, flight, clock, script=(), *, axes=None, closes=1e9):
        self.user_scn = mujoco.MjvScene(flight.model, maxgeom=10)
        self.clock, self.script, self.axes, self.closes = clock, script, axes, closes
        self.panel, self.camera_kind = None, ""
        self.panels = []
        self.down = frozenset()

    def is_running(self):
        return self.clock() < self.closes

    def lock(self):
        return nullcontext()

    def read(self):
        now = self.clock()
        held = frozenset(key for start, end, key in self.script if start <= now < end)
        pressed, self.down = tuple(sorted(held - self.down)), held
        axes = self.axes(now) if self.axes else None
        return Inputs(held, pressed, axes)

    def sync(self):
        self.panels.append((self.clock(), self.panel, self.camera_kind))


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

    def flown(script=(), *, device=None, seconds=1e9, assist="hover", out=None, **window):
        flight.reset()
        flight.assist = assist
        clock = Clock()
        seat = Cockpit(
            flight, device or KeyboardSticks(), Logbook(out or tmp_path / "hand.parquet")
        )
        seen = Window(flight, clock, script, **window)
        fly_in(seen, seat, duration=seconds, clock=clock, sleep=clock.sleep)
        return seat, seen

    return flown


def tap(at, key):
    return (at, at + 0.05, key)


def test_keys_fly_and_record(fly, tmp_path):
    """Forward for two seconds, with R before and after: the record has the stick and the way."""
    seat, seen = fly(
        [tap(0.5, "r"), (1.0, 3.0, "up"), tap(4.0, "r"), tap(5.0, "escape")], seconds=20.0
    )
    assert seat.closed
    assert seat.logbook.written == [tmp_path / "hand.parquet"]
    record = read_record(tmp_path / "hand.parquet")
    assert record.duration == pytest.approx(3.5, abs=0.1)
    assert record["north"][-1] > 1.0
    assert record["LON"].min() < -0.005
    assert record.provenance["by_hand"]["with"] == "keyboard"
    assert seen.panels[-1][0] < 6.0
    shown = [panel for at, panel, _ in seen.panels if 1.5 < at < 2.5]
    assert all(dict(panel.readout)["lon"] == "-100 %" for panel in shown)
    assert all(float(dict(panel.readout)["REC"].split()[0]) > 0.9 for panel in shown)
    said = {panel.message for _, panel, _ in seen.panels}
    assert any("written" in text and "hand.parquet" in text for text in said)


def test_a_second_of_the_clock_is_a_second_of_flight(fly, flight):
    """Paused, time stands still, and is not made up for."""
    fly([tap(1.0, "p"), tap(3.0, "p")], seconds=5.0)
    assert flight.time == pytest.approx(3.0, abs=0.1)


def test_every_recording_has_a_file(fly, tmp_path):
    """None is written over, whatever is there before."""
    fly([tap(0.1 + k, "r") for k in range(4)], seconds=5.0)
    fly([tap(0.1, "r"), tap(1.0, "r")], seconds=2.0)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["hand.parquet", "hand_2.parquet", "hand_3.parquet"]


def test_a_recording_survives_the_window(fly, tmp_path):
    """Closed, interrupted, or over: what was recorded is written."""
    seat, _ = fly([tap(0.1, "r")], closes=1.5)
    assert read_record(seat.logbook.written[0]).duration > 1.0

    def interrupted(now):
        if now > 1.0:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly([tap(0.1, "r")], axes=interrupted)
    assert read_record(tmp_path / "hand_2.parquet").duration > 0.7


def test_a_crash_is_told_and_recorded_and_a_key_starts_again(fly, flight):
    """The collective all the way down: the message says why; Backspace hovers again."""
    seat, seen = fly(
        [tap(0.1, "r"), (0.2, 3.0, "s"), tap(4.0, "backspace")], assist="level", seconds=6.0
    )
    crashed = [panel.message for at, panel, _ in seen.panels if 3.0 < at < 3.9]
    assert all("hit the ground at" in text and "Backspace" in text for text in crashed)
    record = read_record(seat.logbook.written[0])
    assert record.ended
    assert not flight.crashed
    assert flight.time == pytest.approx(2.0, abs=0.1)
    assert flight.clearance > 1.0


def test_a_reset_writes_what_was_recorded(fly):
    seat, _ = fly([tap(0.1, "r"), tap(1.0, "backspace")], seconds=2.0)
    assert read_record(seat.logbook.written[0]).duration == pytest.approx(0.9, abs=0.1)


def test_keys_switch_assist_gyro_camera_and_legend(fly, flight):
    """Each once; the panel says so."""
    _seat, seen = fly(
        [tap(0.1, "h"), tap(0.2, "g"), tap(0.3, "g"), tap(0.4, "c"), tap(0.5, "f1")], seconds=0.7
    )
    assert flight.assist == "level"
    assert flight.gyro
    off = [dict(panel.readout)["gyro"] for at, panel, _ in seen.panels if 0.22 < at < 0.28]
    assert set(off) == {"off"}
    assert seen.camera_kind == CAMERAS[1]
    assert seen.panels[0][1].legend[0] == ("W S", "lift")
    assert ("P", "pause") in seen.panels[0][1].legend
    assert seen.panel.legend == (("F1", "keys"),)


def test_a_tap_too_short_to_record_says_so(fly, tmp_path):
    _, seen = fly([(0.1, 0.12, "r"), (0.15, 0.17, "r")], seconds=0.5)
    assert "no record" in seen.panel.message
    assert not list(tmp_path.iterdir())


def test_a_joystick_flies_and_may_be_lost(fly, flight):
    """Throttle up for two seconds; without it the flight waits, and goes on with P."""
    device = JoystickSticks(JoystickMap.transmitter(), name="radio")

    def axes(now):
        return None if 2.0 < now < 3.0 else (0.0, 0.0, 0.5 if now < 2.0 else 0.0, 0.0)

    _, seen = fly([tap(4.0, "p")], device=device, axes=axes, seconds=6.0)
    assert flight.time == pytest.approx(4.0, abs=0.2)
    lost = [panel.message for at, panel, _ in seen.panels if 2.2 < at < 2.8]
    assert set(lost) == {"radio is gone: plug it in, then press P"}
    assert flight.clearance > 1.8


def test_a_record_that_can_not_be_written_is_kept(fly, flight, tmp_path, monkeypatch):
    """The message says why; it is written as soon as that can be, or the end says it is not."""
    seat, _ = fly(seconds=0.2)
    flight.start_recording()
    flight.fly(0.5)
    tried = []

    def full(record, path):
        tried.append(path)
        raise StorageError(f"{path}: can't write it: No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("helisim.hand.window.write_record", full)
        seat.turn(Inputs(pressed=("r",)), 0.01)
        assert "No space left" in seat.panel.message
        with pytest.raises(StorageError, match="1 record not written yet"):
            seat.leave()
    assert len(tried) == 2
    seat.leave()
    assert read_record(tmp_path / "hand.parquet").duration == pytest.approx(0.49, abs=0.02)


def test_a_place_where_nothing_can_be_written_is_refused_at_once(tmp_path):
    with pytest.raises(StorageError, match="unknown suffix"):
        Logbook(tmp_path / "hand.txt")


def test_a_slow_computer_flies_slower_and_still_flies(flight, tmp_path):
    """A picture takes two seconds: half a second of flight each."""
    flight.reset()
    clock = Clock()
    seat = Cockpit(flight, KeyboardSticks(), Logbook(tmp_path / "hand.parquet"))
    window = Window(flight, clock)
    shown = window.sync

    def slow():
        shown()
        clock.now += 2.0

    window.sync = slow
    fly_in(window, seat, duration=9.0, clock=clock, sleep=clock.sleep)
    assert flight.time == pytest.approx(2.0, abs=0.6)


RADIO, PAD = Joystick(0, "OpenTX Radio"), Joystick(2, "Pad", is_gamepad=True)


@pytest.mark.parametrize(
    ("wanted", "there", "found"),
    [("", [PAD], PAD), ("2", [RADIO, PAD], PAD), ("opentx", [RADIO, PAD], RADIO)],
)
def test_joysticks_are_found_by_number_or_name(wanted, there, found):
    assert choose(wanted, there) == found


@pytest.mark.parametrize(
    ("wanted", "there", "said"),
    [
        ("", [], "no joystick: looked for any.*plug one in.*keys"),
        ("1", [RADIO, PAD], "no joystick '1': there are 0 'OpenTX Radio', 2 'Pad'"),
        ("", [RADIO, PAD], "several joysticks: there are 0 .*say which"),
    ],
)
def test_what_joysticks_there_are_is_said(wanted, there, said):
    with pytest.raises(InputError, match=said):
        choose(wanted, there)


class Glfw:
    """GLFW with two joysticks: number 0 a transmitter, number 1 a gamepad; 2 is gone."""

    JOYSTICK_1, JOYSTICK_LAST = 0, 15

    def joystick_present(self, number):
        return number < 2

    def get_joystick_name(self, number):
        return [b"Radio", "Pad"][number]

    def joystick_is_gamepad(self, number):
        return number == 1

    def get_gamepad_state(self, number):
        if number != 1:
            return None
        return type("State", (), {"axes": (0.1, 0.2, 0.3, 0.4, -1.0, -1.0)})()

    def get_joystick_axes(self, number):
        return ([0.5, -0.5, 9.0], 2) if number == 0 else ([], 0)


def test_axes_are_read_as_glfw_gives_them():
    """A gamepad's triggers are no sticks; one that is gone reads None."""
    glfw = Glfw()
    radio, pad = joysticks(glfw)
    assert (radio.name, pad.name) == ("Radio", "Pad")
    assert read_axes(glfw, radio) == (0.5, -0.5)
    assert read_axes(glfw, pad) == (0.1, 0.2, 0.3, 0.4)
    assert read_axes(glfw, Joystick(2, "gone")) is None
    assert read_axes(glfw, Joystick(3, "gone", is_gamepad=True)) is None


def test_what_is_drawn_by_hand_changes_no_flight(fly, flight, jr700):
    """Flown in a cockpit or stepped alone by the same sticks, the state is the same to the bit."""
    fly(seconds=1.0)
    alone = HandFlight(jr700)
    alone.fly(flight.time)
    assert alone.time == flight.time
    np.testing.assert_array_equal(alone.data.qpos, flight.data.qpos)
