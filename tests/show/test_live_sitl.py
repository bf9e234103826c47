"""A window that follows an autopilot's flight shows where it is, and changes nothing."""

import os
import shutil
import socket
import subprocess
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from PIL import Image

from helisim.show.viewer import Watched, seen
from helisim.sitl import Aircraft
from helisim.sitl.link import Frame
from script import SCRIPTS

IDLE = (1500, 1500, 1500, 1500, 0, 0, 0, 1000)
SPUN_UP = (*IDLE[:7], 1700)


class Window:
    """A window that keeps what it is shown."""

    def __init__(self, data) -> None:
        self.pictures, self.is_open, self.data = [], True, data

    def is_running(self):
        return self.is_open

    def sync(self):
        self.pictures.append((self.data.qpos.copy(), self.data.geom("blade_1").xpos.copy()))

    def lock(self):
        return nullcontext()


@pytest.fixture(scope="module")
def flown(jr700):
    """An aircraft, and all of it that is seen."""
    aircraft = Aircraft(jr700)
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
    aircraft, window, shown, clock = watched
    assert not fly(aircraft, shown, clock, IDLE, 500)
    assert len(window.pictures) == 1 + 500 // 17
    np.testing.assert_allclose(window.pictures[-1][0], aircraft.data.qpos, atol=1e-3)


@pytest.mark.slow
def test_a_rotor_turns_as_it_spins_up(watched):
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
    aircraft, window, shown, clock = watched
    assert not shown.on_wait()
    window.is_open = False
    assert shown.on_wait()
    assert fly(aircraft, shown, clock, IDLE, 20)


SEEN = """
import os, sys, threading
from PIL import ImageGrab
from helisim.cli import main
from played_autopilot import PlayedAutopilot

def fly():
    autopilot = PlayedAutopilot(int(sys.argv[1]), resend=0.2)
    drawn = False
    while not drawn and autopilot.count < 100_000:  # a renderer without a graphics card is slow
        for _ in range(400):
            autopilot.frame((1500,) * 7 + (1700,), patience=100.0)
        picture = ImageGrab.grab(xdisplay=os.environ["DISPLAY"])
        drawn = len(picture.convert("RGB").getcolors(10**6)) > 1000
    picture.save("seen.png")

threading.Thread(target=fly).start()
sys.exit(main(["sitl", "--view", "--port", sys.argv[1], "--wait", "5"]))
"""


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="no virtual display: apt install xvfb")
def test_a_real_window_shows_it(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    paths = os.pathsep.join([*sys.path, str(SCRIPTS / "proof")])
    done = subprocess.run(
        ["xvfb-run", "-a", "-s", "-screen 0 640x480x24", sys.executable, "-c", SEEN, str(port)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "00 frames" in done.stdout
    red, green, blue = np.moveaxis(
        np.asarray(Image.open(tmp_path / "seen.png").convert("RGB"), dtype=float), -1, 0
    )
    orange = (red > 130.0) & (green < 0.7 * red) & (blue < 0.5 * red)
    assert orange.sum() > 100  # its canopy's stripe, and the tips of its blades
