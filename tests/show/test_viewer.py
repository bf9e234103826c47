from contextlib import nullcontext

import mujoco
import numpy as np
import pytest

from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.show.viewer import SLOWED, TILT_GAIN, aim, prepare_live, watch
from helisim.sim import Doublet
from helisim.vehicle import load
from helisim.vehicle.trim import addresses


class Window:
    """A window that is closed after some pictures."""

    def __init__(self, pictures: int) -> None:
        self.left = pictures
        self.shown = 0

    def is_running(self) -> bool:
        return self.left > 0

    def sync(self) -> None:
        self.left -= 1
        self.shown += 1

    def lock(self):
        return nullcontext()


class Clock:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def test_a_hover_is_flown_in_real_time(jr700):
    flight, clock = prepare_live(jr700), Clock()
    start = flight.data.qpos[:3].copy()
    window = Window(61)
    flown = watch(flight, window, clock=clock, sleep=clock.sleep)
    assert flown > 0.9
    assert flown == pytest.approx(clock.now - 100.0, abs=0.02)  # a picture
    assert np.linalg.norm(flight.data.qpos[:3] - start) < 0.1


def test_a_slow_computer_does_not_hurry_after_the_clock(jr700):
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
    """The view begins with all of the helicopter in it, its shadow, and the middle of the pad."""
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
    """The disc leans by the flapping states, the blade has turned clockwise with the time."""
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
