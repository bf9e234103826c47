import shutil
import socket
import sys
from contextlib import nullcontext
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image

from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.show.viewer import LEGEND, SLOWED, TILT_GAIN, Watched, aim, prepare_live, seen, watch
from helisim.sim import Doublet
from helisim.sitl import Aircraft
from helisim.sitl.link import Frame
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from off_screen import Clock, on_display
from tabled import section


class Window:
    """A window that is closed after some pictures."""

    def __init__(self, pictures: int) -> None:
        self.left = pictures

    def is_running(self) -> bool:
        return self.left > 0

    def sync(self) -> None:
        self.left -= 1

    def lock(self):
        return nullcontext()


def test_a_hover_is_flown_in_real_time_and_a_slow_computer_does_not_hurry(jr700):
    flight, clock = prepare_live(jr700), Clock()
    start = flight.data.qpos[:3].copy()
    window = Window(61)
    flown = watch(flight, window, clock=clock, sleep=clock.sleep)
    assert flown > 0.9
    assert flown == pytest.approx(clock.now, abs=0.02)  # a picture
    assert np.linalg.norm(flight.data.qpos[:3] - start) < 0.1
    flight, clock = prepare_live(jr700), Clock()

    def stalling(_seconds: float) -> None:
        clock.now += 10.0

    flown = watch(flight, Window(3), clock=clock, sleep=stalling)
    assert flown <= 1.5


def seen_at(model, data, points, *, name):
    """Where points (n, 3) are in the picture of the aimed camera, (n, 2): 1 is its border.

    Across, of a window as high as it is wide, the narrowest that anyone would keep.
    """
    camera, scene = mujoco.MjvCamera(), mujoco.MjvScene(model, maxgeom=1000)
    aim(camera, model, name)
    category = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, category, scene)
    eye = scene.camera[0]
    away = points - eye.pos
    ahead = away @ eye.forward
    assert np.all(ahead > 0.0)
    right = np.cross(eye.forward, eye.up)
    border = ahead * eye.frustum_top / eye.frustum_near
    return np.stack([away @ right, away @ eye.up], axis=1) / border[:, None]


@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_helicopter_shadow_and_pad_are_seen(name):
    flight = prepare_live(load(name))
    model, data = flight.model, flight.data
    own = model.body_rootid[model.geom_bodyid] == model.body(name).id
    sun = data.light_xdir[model.light("sun").id]
    shadow = data.geom_xpos[own] - sun * data.geom_xpos[own, 2:] / sun[2]
    pad = np.zeros((1, 3))
    for points in (data.geom_xpos[own], shadow, pad):
        assert np.abs(seen_at(model, data, points, name=name)).max() < 1.0
    # The helicopter is not a dot: it takes a sixth of the picture's width at least.
    across = seen_at(model, data, data.geom_xpos[own], name=name)[:, 0]
    assert np.ptp(across) > 2.0 / 6.0


def test_the_disc_tilts_and_the_blades_turn(jr700):
    doublet = Doublet(axis="lat", duration=2.0, trim_time=0.2)
    flight, clock = prepare_live(jr700, doublet), Clock()
    model, data = flight.model, flight.data
    watch(flight, Window(10**6), duration=0.5, clock=clock, sleep=clock.sleep)
    a, b = data.act[addresses(model).state + STATE.flap_a :][:2]
    assert abs(b) > 1e-3  # the doublet has begun
    mast = data.body("jr700").xmat.reshape(3, 3)
    tilted = mast.T @ data.geom("rotor_disc").xmat.reshape(3, 3)[:, 2]
    turn = TILT_GAIN * np.hypot(a, b)
    # rearwards by a, right by b: a rotation's axis, in forward-left-up
    expected = [-a * np.sinc(turn / np.pi), -b * np.sinc(turn / np.pi)]
    np.testing.assert_allclose(tilted[:2], TILT_GAIN * np.array(expected), atol=1e-12)
    assert tilted[2] == pytest.approx(np.cos(turn), abs=1e-12)

    at_rest = mujoco.MjData(model)
    mujoco.mj_kinematics(model, at_rest)
    angle = 178.024 * data.time / SLOWED  # the speed of Table 1, rad/s
    clockwise = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    # the disc's lean moves a unit vector by no more than its angle
    np.testing.assert_allclose(_blade(data)[:2], clockwise @ _blade(at_rest)[:2], atol=turn)


def _blade(data):
    arm = data.geom("blade_1").xpos - data.site("hub").xpos
    return data.body("jr700").xmat.reshape(3, 3).T @ arm / np.linalg.norm(arm)


def test_what_is_drawn_changes_no_flight(jr700):
    doublet, clock = Doublet(axis="lat", duration=2.0, trim_time=0.2), Clock()
    watched, alone = prepare_live(jr700, doublet), prepare_live(jr700, doublet)
    window = Window(10**6)
    watch(watched, window, duration=0.5, clock=clock, sleep=clock.sleep)
    with installed():
        while alone.data.time < watched.data.time:
            mujoco.mj_step(alone.model, alone.data)
    for name in ("qpos", "qvel", "act", "time"):
        np.testing.assert_array_equal(getattr(watched.data, name), getattr(alone.data, name))


IDLE = (1500, 1500, 1500, 1500, 0, 0, 0, 1000)


class SitlWindow:
    """A window that keeps what it is shown."""

    def __init__(self, data) -> None:
        self.pictures, self.is_open, self.data = [], True, data

    def is_running(self):
        return self.is_open

    def sync(self):
        self.pictures.append((self.data.qpos.copy(), self.data.geom("blade_1").xpos.copy()))

    def lock(self):
        return nullcontext()

    def set_texts(self, texts):
        self.texts = texts


@pytest.fixture(scope="module")
def flown(jr700):
    aircraft = Aircraft(jr700)
    return aircraft, seen(aircraft)


@pytest.fixture
def watched(flown):
    """An aircraft on the ground, its window, and a clock that only the test moves."""
    aircraft, flight = flown
    aircraft.reset()
    window, clock = SitlWindow(flight.data), [0.0]
    own = {"told": lambda: {"mode": "land", "roll": "+0.10"}, "clock": lambda: clock[0]}
    return aircraft, window, Watched(aircraft, flight, window, **own), clock


def fly(aircraft, shown, clock, pulses, frames):
    over = False
    for number in range(frames):
        clock[0] += 1e-3
        over = shown.on_frame(Frame(1000, number, pulses), aircraft.step(pulses))
    return over


def test_pictures_come_sixty_times_a_second_until_the_window_is_closed(watched):
    aircraft, window, shown, clock = watched
    assert not fly(aircraft, shown, clock, IDLE, 500)
    assert len(window.pictures) == 1 + 500 // 17
    np.testing.assert_allclose(window.pictures[-1][0], aircraft.data.qpos, atol=1e-3)
    assert window.texts[0][2] == LEGEND
    assert window.texts[1][2:] == ("height\nmode\nroll", "0.0 m\nland\n+0.10")
    assert not shown.on_wait()
    window.is_open = False
    assert shown.on_wait()
    assert fly(aircraft, shown, clock, IDLE, 20)


HERE = str(Path(__file__).parents[1])
SEEN = section(globals(), "SEEN")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("xvfb-run") is None, reason="no virtual display: apt install xvfb")
def test_a_real_window_shows_it(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    done = on_display(tmp_path, sys.executable, "-c", SEEN, str(port), more=[HERE])
    assert done.returncode == 0, done.stderr
    assert "00 frames" in done.stdout
    picture = np.asarray(Image.open(tmp_path / "seen.png").convert("RGB"), dtype=float)
    red, green, blue = np.moveaxis(picture, -1, 0)
    orange = (red > 130.0) & (green < 0.7 * red) & (blue < 0.5 * red)
    assert orange.sum() > 100  # its canopy's stripe, and the tips of its blades
