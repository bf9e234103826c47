"""A window that follows an autopilot's flight shows where it is, and changes nothing."""

from contextlib import nullcontext

import numpy as np
import pytest

from helisim.output.live_sitl import Watched, seen
from helisim.sitl import Aircraft
from helisim.sitl.packet import Frame

IDLE = (1500, 1500, 1500, 1500, 0, 0, 0, 1000)
SPUN_UP = (*IDLE[:7], 1700)


class Window:
    """A window that keeps what it is shown."""

    user_scn = None

    def __init__(self, data) -> None:
        self.pictures, self.is_open, self.data = [], True, data

    def is_running(self):
        return self.is_open

    def sync(self):
        self.pictures.append((self.data.qpos.copy(), self.data.geom("blade_1").xpos.copy()))

    def lock(self):
        return nullcontext()


@pytest.fixture(scope="module")
def flown():
    """An aircraft, and all of it that is seen."""
    aircraft = Aircraft()
    return aircraft, seen(aircraft)


@pytest.fixture
def watched(flown):
    """An aircraft on the ground, its window, and a clock that only the test moves."""
    aircraft, flight = flown
    aircraft.reset()
    window, clock = Window(flight.data), [0.0]
    return aircraft, window, Watched(aircraft, flight, window, clock=lambda: clock[0]), clock


def fly(aircraft, shown, clock, pulses, frames):
    """Fly frames in real time; return whether the window ended it."""
    over = False
    for number in range(frames):
        clock[0] += 1e-3
        over = shown.on_frame(Frame(1000, number, pulses), aircraft.step(pulses))
    return over


def test_pictures_come_sixty_times_a_second(watched):
    """One of the start, then as the clock goes, where the aircraft is."""
    aircraft, window, shown, clock = watched
    assert not fly(aircraft, shown, clock, IDLE, 500)
    assert len(window.pictures) == 1 + 500 // 17
    np.testing.assert_allclose(window.pictures[-1][0], aircraft.data.qpos, atol=1e-3)


def test_a_rotor_turns_as_it_spins_up(watched):
    """Its blades stand still while it is stopped, and turn further in each picture afterwards."""
    aircraft, window, shown, clock = watched
    fly(aircraft, shown, clock, IDLE, 200)
    still = np.array([blade for _, blade in window.pictures])
    assert np.ptp(still, axis=0).max() < 1e-4
    begun = len(window.pictures)
    fly(aircraft, shown, clock, SPUN_UP, 1000)
    turning = np.diff([blade for _, blade in window.pictures[begun:]], axis=0)
    steps = np.linalg.norm(turning, axis=1)
    assert steps[-1] > 2.0 * steps[20] > 0.0


def test_a_window_that_is_closed_ends_the_flight(watched):
    """While it flies, and while nothing comes."""
    aircraft, window, shown, clock = watched
    assert not shown.on_wait()
    window.is_open = False
    assert shown.on_wait()
    assert fly(aircraft, shown, clock, IDLE, 20)


def test_what_is_watched_flies_the_same(watched):
    """To the last bit."""
    aircraft, _, shown, clock = watched
    fly(aircraft, shown, clock, SPUN_UP, 300)
    qpos, act = aircraft.data.qpos.copy(), aircraft.data.act.copy()
    aircraft.reset()
    for _ in range(300):
        aircraft.step(SPUN_UP)
    np.testing.assert_array_equal(aircraft.data.qpos, qpos)
    np.testing.assert_array_equal(aircraft.data.act, act)
