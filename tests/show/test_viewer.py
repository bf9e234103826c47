from contextlib import nullcontext

import mujoco
import numpy as np
import pytest

from helisim.base.errors import DisplayError, InputError
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.show.viewer import SLOWED, TILT_GAIN, aim, check_display, prepare_live, watch
from helisim.sim import Doublet, Sweep
from helisim.vehicle import load
from helisim.vehicle.trim import addresses
from mirror import mirrored


class Window:
    """A window that is closed after some pictures."""

    def __init__(self, model: mujoco.MjModel, pictures: int) -> None:
        self.left = pictures
        self.shown = 0
        self.user_scn = mujoco.MjvScene(model, maxgeom=10)

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
    """A second of the clock is a second of flight; the pilot stays within a decimetre."""
    flight, clock = prepare_live(jr700), Clock()
    start = flight.data.qpos[:3].copy()
    window = Window(flight.model, pictures=61)
    flown = watch(flight, window, clock=clock, sleep=clock.sleep)
    assert flown > 0.9
    assert flown == pytest.approx(clock.now - 100.0, abs=0.02)  # a picture
    assert np.linalg.norm(flight.data.qpos[:3] - start) < 0.1
    assert window.user_scn.ngeom == 1  # the thrust
    assert window.user_scn.geoms[0].size[2] > 0.0


def test_a_doublet_ends_by_itself(jr700):
    """The flight ends with its time, and has rolled on the way."""
    doublet = Doublet(axis="lat", duration=2.0, trim_time=0.2)
    flight, clock = prepare_live(jr700, doublet), Clock()
    start = flight.data.qpos[3:7].copy()
    window = Window(flight.model, pictures=10**6)
    flown = watch(flight, window, duration=0.7, clock=clock, sleep=clock.sleep)
    assert flown == pytest.approx(0.7)
    assert np.abs(flight.data.qpos[3:7] - start).max() > 0.01


def test_a_slow_computer_does_not_hurry_after_the_clock(jr700):
    """After a pause of ten seconds, at most half a second is made up at once."""
    flight, clock = prepare_live(jr700), Clock()

    def stalling(_seconds: float) -> None:
        clock.now += 10.0

    flown = watch(flight, Window(flight.model, pictures=3), clock=clock, sleep=stalling)
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


@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_a_watched_sweep_stays_clear_of_the_ground(name):
    """The heave sweep, which sinks most, leaves air under the skids."""
    flight = prepare_live(load(name), Sweep(axis="col"))
    model, data = flight.model, flight.data
    skids = data.geom("skid_left_collision").xpos[2] - data.qpos[2]
    lowest = np.inf
    with installed():
        while data.time < 90.0:
            mujoco.mj_step(model, data, 10)
            lowest = min(lowest, data.qpos[2])
    assert 0.2 < lowest + skids < 1.0


@pytest.mark.parametrize("environment", [{}, {"DISPLAY": ""}])
def test_no_display_is_said(environment):
    """Without a display the message says what to do instead."""
    with pytest.raises(DisplayError, match="`helisim fly` writes a recording"):
        check_display(environment, "linux")


def test_a_display_is_enough():
    """X11, Wayland, and systems that always have one."""
    check_display({"DISPLAY": ":0"}, "linux")
    check_display({"WAYLAND_DISPLAY": "wayland-0"}, "linux")
    check_display({}, "darwin")


def test_a_negative_seed_is_refused(jr700):
    """It is said before anything flies."""
    with pytest.raises(InputError, match="seed"):
        prepare_live(jr700, seed=-1)


def test_the_disc_tilts_and_the_blades_turn(jr700):
    """The disc leans by the flapping states, the blade has turned clockwise with the time."""
    doublet = Doublet(axis="lat", duration=2.0, trim_time=0.2)
    flight, clock = prepare_live(jr700, doublet), Clock()
    model, data = flight.model, flight.data
    watch(flight, Window(model, 10**6), duration=0.5, clock=clock, sleep=clock.sleep)
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


def test_blades_of_the_other_direction_turn_the_other_way(jr700):
    """Counter-clockwise seen from above: what pointed ahead turns to the left."""
    other = load("jr700", parameters=mirrored(jr700.parameters))
    flight, clock = prepare_live(other), Clock()
    watch(flight, Window(flight.model, 10**6), duration=0.1, clock=clock, sleep=clock.sleep)
    at_rest = mujoco.MjData(flight.model)
    mujoco.mj_kinematics(flight.model, at_rest)
    turned = [np.arctan2(*_blade(data)[1::-1]) for data in (flight.data, at_rest)]
    angle = 178.024 * flight.data.time / SLOWED
    assert turned[0] - turned[1] == pytest.approx(angle, abs=0.01)  # of the disc's lean


def _blade(data):
    arm = data.geom("blade_1").xpos - data.site("hub").xpos
    return data.body("jr700").xmat.reshape(3, 3).T @ arm / np.linalg.norm(arm)


def test_what_is_drawn_changes_no_flight(jr700):
    """Watched or stepped alone, the state is the same to the last bit."""
    doublet, clock = Doublet(axis="lat", duration=2.0, trim_time=0.2), Clock()
    watched, alone = prepare_live(jr700, doublet), prepare_live(jr700, doublet)
    window = Window(watched.model, 10**6)
    watch(watched, window, duration=0.5, clock=clock, sleep=clock.sleep)
    with installed():
        while alone.data.time < watched.data.time:
            mujoco.mj_step(alone.model, alone.data)
    for name in ("qpos", "qvel", "act", "time"):
        np.testing.assert_array_equal(getattr(watched.data, name), getattr(alone.data, name))
