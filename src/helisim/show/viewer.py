"""Fly the vehicle in MuJoCo's own viewer, in real time, or watch an autopilot fly it."""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import DisplayError, DivergedError, InputError
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.sim import Ground, Pilot
from helisim.sim.excitation import Excitation, check_excitation, injection
from helisim.sim.flight import steps
from helisim.sim.limits import broken
from helisim.sim.plan import hover_height
from helisim.vehicle import Vehicle
from helisim.vehicle.folder import Roles
from helisim.vehicle.trim import addresses, place, root_body

if TYPE_CHECKING:
    from helisim.sitl.aircraft import Aircraft
    from helisim.sitl.link import Frame, Sensed

TILT_GAIN = 10.0
"""The disc is drawn tilted this many times as far: a sweep's half a degree would not be seen."""
SLOWED = 30.0
"""Blades are drawn turning this many times slower: 28 turns a second would only flicker."""
LEGEND = f"disc tilt x {TILT_GAIN:g}, blades {SLOWED:g} times slower, thrust red"

_STAND_OFF = 2.3
"""How many times its height the camera is away, so that the pad below is in the picture."""
_FRAME = 1.0 / 60.0
"""s between two pictures."""
_FALLEN_BEHIND = 0.5
"""s: a computer that is later than this lets the clock go on; no more is flown at once."""
_CLOSING = 5.0
"""s that a window may take to close."""
_ARROW_LENGTH, _ARROW_RADIUS = 0.5, 0.0125
"""In the model's extents: how long a thrust that carries the weight is drawn, and how thick."""
_THRUST_COLOUR = np.array([0.9, 0.3, 0.1, 1.0], dtype=np.float32)
_INSTEAD = "record the flight instead: `helisim fly` writes a recording for Rerun"
_STATE = ("qpos", "qvel", "act", "sensordata", "time")


class Window(Protocol):
    """The part of a viewer that the loop uses."""

    user_scn: mujoco.MjvScene | None

    def is_running(self) -> bool:
        """Return whether the window is still open."""
        ...

    def sync(self) -> None:
        """Show the present state."""
        ...

    def lock(self) -> AbstractContextManager[Any]:
        """Keep the viewer from reading while the state changes."""
        ...


@dataclass(frozen=True, eq=False)
class LiveFlight:
    """A flight that is ready to be shown.

    Attributes:
        model: with every part to be seen, the pilot and the manoeuvre in place.
        data: in the hover.
        added: (n_step, n_injection) `injection` of the manoeuvre; None if it has none.
        roles: names of the rotors in the model.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    added: NDArray[np.float64] | None = None
    roles: Roles = field(default_factory=Roles)

    def step(self) -> None:
        """Fly on by a time step."""
        made = round(self.data.time / self.model.opt.timestep)
        next(steps(self.model, self.data, added=self.added, first=made))


def prepare_live(
    vehicle: Vehicle,
    excitation: Excitation | None = None,
    *,
    pilot: Pilot | None = None,
    ground: Ground | None = None,
    seed: int = 1,
) -> LiveFlight:
    """Return a vehicle with all its parts, hovering above its pad, ready to be watched.

    Args:
        vehicle: that flies.
        excitation: a `Sweep`, say; None holds the hover.
        pilot: the default `Pilot` if None.
        ground: that is below, with its effect; the scene's own, without, if None.
        seed: of the pilot's remnant, 0 or more.
    """
    if seed < 0:
        raise InputError(f"seed must be 0 or more, got {seed}")
    model = vehicle.visual_model(None if ground is None else ground.put_into)
    height = hover_height(model)
    if ground is not None:
        vehicle = ground.felt_by(vehicle).trimmed(height=height)
        model.actuator_user[addresses(model).rotor, PARAM.ground_effect] = ground.effect
    par = model.actuator_user[addresses(model).rotor]
    (pilot or Pilot()).write(par, vehicle, seed=seed, height=height)
    added = None
    if excitation is not None:
        check_excitation(excitation)
        excitation = excitation.on(vehicle.parameters)
        excitation.write(par)
        added = injection(excitation, vehicle)
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim, height=height)
    if ground is not None:
        ground.begin(vehicle, model, data)
    with installed():
        mujoco.mj_forward(model, data)
    return LiveFlight(model, data, added, vehicle.roles)


def aim(camera: mujoco.MjvCamera, model: mujoco.MjModel, body: str | int) -> None:
    """Let a camera follow a body so that it, its shadow and the pad are seen.

    Args:
        camera: to be set.
        model: of a scene, with every part to be seen.
        body: the vehicle's, by name or number.
    """
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = model.body(body).id
    camera.distance = _STAND_OFF * hover_height(model)
    camera.azimuth, camera.elevation = -140.0, -25.0


class Pace:
    """Keeps a flight to the clock, without hurry after a computer that was late."""

    def __init__(
        self, time: float, clock: Callable[[], float], sleep: Callable[[float], None]
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self.restart(time)

    def restart(self, time: float) -> None:
        """Go on from a time of the flight, s: it was paused, or begins anew."""
        self._origin = self._clock() - time

    def due(self, time: float) -> float:
        """Return the time until which a flight is to be flown that is at a time now, s."""
        return min(self._clock() - self._origin, time + _FALLEN_BEHIND)

    def rest(self, time: float) -> None:
        """Wait for the next picture, a flight being at a time, s."""
        behind = self._clock() - self._origin - time
        if behind > _FALLEN_BEHIND:
            self._origin += behind - _FALLEN_BEHIND
        self._sleep(max(0.0, _FRAME - max(behind, 0.0)))


def watch(
    flight: LiveFlight,
    window: Window,
    *,
    duration: float | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> float:
    """Step a flight in real time until its window is closed or its time is over.

    Args:
        flight: to be watched; its data move.
        window: that shows it.
        duration: s of flight; None flies on.
        clock: s, rising.
        sleep: for a number of seconds.

    Returns:
        The seconds that were flown.

    Raises:
        DivergedError: the state is no longer finite.
    """
    model, data = flight.model, flight.data
    rotors = Rotors(model, flight.roles)
    step, end = model.opt.timestep, np.inf if duration is None else duration
    pace = Pace(data.time, clock, sleep)
    with installed():
        while window.is_running() and data.time < end - 0.5 * step:
            until = min(pace.due(data.time), end)
            with window.lock():
                while data.time < until - 0.5 * step:
                    flight.step()
                rotors.draw(data, window.user_scn)
            if broken(data):
                raise DivergedError(f"the flight has no finite state at {data.time:.2f} s")
            window.sync()
            pace.rest(data.time)
    return float(data.time)


def view(
    vehicle: Vehicle,
    excitation: Excitation | None = None,
    *,
    duration: float | None = None,
    ground: Ground | None = None,
    seed: int = 1,
) -> float:
    """Fly in MuJoCo's viewer until its window is closed; return the seconds flown.

    Arguments are those of `prepare_live` and `watch`.

    Raises:
        DisplayError: there is no display to open a window on.
    """
    check_display()
    flight = prepare_live(vehicle, excitation, ground=ground, seed=seed)
    if duration is None and excitation is not None:
        duration = excitation.duration
    with shown(flight) as window:
        return watch(flight, window, duration=duration)


@contextmanager
def shown(flight: LiveFlight) -> Iterator[Any]:
    """Show a flight in a window that follows it; the window closes at the end.

    Raises:
        DisplayError: no window can be opened.
    """
    others = set(threading.enumerate())
    window = open_window(flight)
    try:
        with window:
            aim(window.cam, flight.model, root_body(flight.model))
            window.set_texts((None, mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, LEGEND, None))
            yield window
    finally:
        # a window whose thread still lives when Python ends takes the program down with it
        for thread in set(threading.enumerate()) - others:
            thread.join(_CLOSING)


def open_window(flight: LiveFlight) -> Any:
    """Return MuJoCo's viewer of a flight, which closes at the end of a `with` block.

    Raises:
        DisplayError: no window can be opened.
    """
    try:
        import glfw
        from mujoco import viewer

        with warnings.catch_warnings(record=True) as reasons:
            warnings.simplefilter("always")
            if not glfw.init():  # asked here: where the viewer asks, its failure ends the program
                raise RuntimeError(str(reasons[-1].message) if reasons else "no GLFW")
        return viewer.launch_passive(
            flight.model, flight.data, show_left_ui=False, show_right_ui=False
        )
    except (ImportError, RuntimeError, mujoco.FatalError) as error:
        raise DisplayError(f"can't open a window: {error}; {_INSTEAD}") from None


def check_display(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> None:
    """Raise DisplayError where no window can open; macOS and Windows always have a display."""
    if platform.startswith("linux") and not (
        environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    ):
        raise DisplayError(f"no display: neither DISPLAY nor WAYLAND_DISPLAY is set; {_INSTEAD}")


def drawn_tilt(a: ArrayLike, b: ArrayLike) -> Rotation:
    """Return the tip-path plane as drawn, from the hub's axes, forward-right-down.

    Args:
        a: rearward tilt, rad, (n_time,) or a number.
        b: rightward tilt, rad, of the same shape.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return Rotation.from_rotvec(TILT_GAIN * np.stack([b, a, np.zeros_like(a)], axis=-1))


def drawn_turn(time: ArrayLike, speed: float) -> NDArray[np.float64]:
    """Return how far blades of a speed in rad/s are drawn to have turned, rad; (n_time,) each."""
    return np.asarray(time, dtype=np.float64) * speed / SLOWED


class Rotors:
    """Both rotors as they are drawn, and the arrow of the main rotor's thrust."""

    def __init__(self, model: mujoco.MjModel, roles: Roles) -> None:
        where = addresses(model)
        self._main = _RotorGeoms(model, roles.body("rotor"))
        self._tail = _RotorGeoms(model, roles.body("tail_rotor"))
        self._direction = model.actuator_user[where.rotor, PARAM.main_direction]
        self._speeds = model.actuator_user[where.rotor, [PARAM.main_speed, PARAM.tail_speed]]
        self._tilts = where.state + np.array([STATE.flap_a, STATE.flap_b])
        self._thrust = model.sensor("rotor").adr[0]
        extent, mass = model.stat.extent, model.body_subtreemass[model.body_rootid[self._main.body]]
        self._metres_per_newton = _ARROW_LENGTH * extent / (mass * -model.opt.gravity[2])
        self._arrow_radius = _ARROW_RADIUS * extent

    def draw(
        self, data: mujoco.MjData, scene: mujoco.MjvScene | None, time: float | None = None
    ) -> None:
        """Put the rotors and the arrow where the state has them.

        Args:
            data: of the flight.
            scene: for the arrow; None draws none.
            time: s that the rotors have turned, as at their nominal speeds; the flight's if None.
        """
        tilt = Rotation.from_rotvec(flip(*drawn_tilt(*data.act[self._tilts]).as_rotvec()))
        main, tail = drawn_turn(data.time if time is None else time, self._speeds)
        turned = Rotation.from_rotvec([0.0, 0.0, -self._direction * main])
        self._main.place(data, (tilt * turned).as_matrix())
        self._tail.place(data, Rotation.from_rotvec([0.0, tail, 0.0]).as_matrix())
        if scene is None:
            return
        hub = data.xpos[self._main.body]
        up = data.xmat[self._main.body].reshape(3, 3) @ tilt.apply([0.0, 0.0, 1.0])
        tip = hub + up * self._metres_per_newton * data.sensordata[self._thrust]
        arrow, shape = scene.geoms[0], mujoco.mjtGeom.mjGEOM_ARROW
        mujoco.mjv_initGeom(arrow, shape, np.zeros(3), np.zeros(3), np.zeros(9), _THRUST_COLOUR)
        mujoco.mjv_connector(arrow, shape, self._arrow_radius, hub, tip)
        scene.ngeom = 1


class _RotorGeoms:
    """The geoms of one rotor, moved in mjData for a picture alone; the next step undoes it."""

    def __init__(self, model: mujoco.MjModel, body: str) -> None:
        self.body = model.body(body).id
        self.ids = np.flatnonzero((model.geom_bodyid == self.body) & (model.geom_contype == 0))
        self.positions = model.geom_pos[self.ids].copy()
        turns = Rotation.from_quat(model.geom_quat[self.ids], scalar_first=True)
        self.matrices = turns.as_matrix()

    def place(self, data: mujoco.MjData, turn: NDArray[np.float64]) -> None:
        """Turn the geoms by a (3, 3) rotation in the body's axes."""
        frame = data.xmat[self.body].reshape(3, 3) @ turn
        data.geom_xpos[self.ids] = data.xpos[self.body] + self.positions @ frame.T
        data.geom_xmat[self.ids] = (frame @ self.matrices).reshape(-1, 9)


def seen(aircraft: Aircraft) -> LiveFlight:
    """Return an aircraft with every part to be seen, where it is; it is shown, not flown."""
    model = aircraft.vehicle.visual_model(aircraft.ground.put_into)
    flight = LiveFlight(model, mujoco.MjData(model), None, aircraft.vehicle.roles)
    _follow(flight, aircraft)
    return flight


class Watched:
    """Shows an aircraft in a window while a `Backend` flies it: its `on_frame` and `on_wait`."""

    def __init__(
        self,
        aircraft: Aircraft,
        flight: LiveFlight,
        window: Window,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Show the aircraft as it stands.

        Args:
            aircraft: that is flown.
            flight: `seen` of it, which the window shows.
            window: that shows it.
            clock: s, rising.
        """
        self._aircraft, self._flight, self._window = aircraft, flight, window
        self._rotors = Rotors(flight.model, flight.roles)
        self._clock, self._next = clock, -np.inf
        self._turned = self._time = 0.0
        self._show()

    def on_frame(self, _frame: Frame, sensed: Sensed) -> bool:
        """Show a picture when it is time for one; return whether the window was closed."""
        if self._clock() < self._next:
            return False
        self._turned += self._aircraft.rotor_speed * max(0.0, sensed.time - self._time)
        self._time = sensed.time
        return self._show()

    def on_wait(self) -> bool:
        """Return whether the window was closed."""
        return not self._window.is_running()

    def _show(self) -> bool:
        if not self._window.is_running():
            return True
        with self._window.lock():
            _follow(self._flight, self._aircraft)
            self._rotors.draw(self._flight.data, self._window.user_scn, self._turned)
        self._window.sync()
        self._next = self._clock() + _FRAME
        return False


def _follow(flight: LiveFlight, aircraft: Aircraft) -> None:
    """Put the shown model into the state of an aircraft."""
    model, data = flight.model, flight.data
    for name in _STATE:
        setattr(data, name, getattr(aircraft.data, name))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
