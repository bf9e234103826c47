"""Real-time flight in MuJoCo's viewer, by pilot or autopilot."""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Any, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from helisim.base.errors import DisplayError, DivergedError
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.sim import Ground, Pilot, Weather
from helisim.sim.excitation import Excitation, check_excitation, injection
from helisim.sim.flight import at_least, steps
from helisim.sim.limits import broken
from helisim.sim.live import Live, hovering
from helisim.sim.plan import hover_height
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses, root_body

if TYPE_CHECKING:
    from helisim.sitl.aircraft import Aircraft
    from helisim.sitl.link import Frame, Sensed

TILT_GAIN = 10.0  # factor on the drawn tilt of the disc
SLOWED = 30.0  # divisor of the drawn rotor speed
LEGEND = f"disc tilt x {TILT_GAIN:g}, blades {SLOWED:g} times slower"

_LEGEND = (None, mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, LEGEND, None)
# _STAND_OFF: distance of the camera in heights of the hover
# _FRAME: s between two pictures
_STAND_OFF, _FRAME = 2.3, 1.0 / 60.0
# _FALLEN_BEHIND: s: what a late computer makes up for at most
# _CLOSING: s, longest time for a window to close
_FALLEN_BEHIND, _CLOSING = 0.5, 5.0
_INSTEAD = "record the flight instead: `helisim fly` writes a recording for Rerun"
_STATE = ("qpos", "qvel", "act", "sensordata", "time")


class Window(Protocol):
    """The used part of a viewer."""

    def is_running(self) -> bool:
        """Return whether it is open."""
        ...

    def sync(self) -> None:
        """Show the state of now."""
        ...

    def lock(self) -> AbstractContextManager[Any]:
        """Keep the viewer from reading what is changed inside."""
        ...

    def set_texts(self, texts: Any) -> None:
        """Lay texts over the picture: (font, place, left column, right column), or several."""
        ...


def prepare_live(
    vehicle: Vehicle,
    excitation: Excitation | None = None,
    *,
    ground: Ground | None = None,
    seed: int = 1,
) -> Live:
    """Return a vehicle with all visible parts above its pad; without an excitation it hovers.

    The `ground` is without effect if None; `seed`, of the pilot's remnant, is 0 or more.
    """
    vehicle, model, height = hovering(vehicle, Weather(), ground)
    flight = Live(vehicle, model, Weather(), ground or Ground(effect=0.0), height=height)
    Pilot().write(flight.par, vehicle, seed=at_least("seed", seed, 0), height=height)
    if excitation is not None:
        check_excitation(excitation)
        excitation = excitation.on(vehicle.parameters)
        excitation.write(flight.par)
        flight.added = injection(excitation, vehicle)
    flight.reset()
    return flight


def aim(camera: mujoco.MjvCamera, model: mujoco.MjModel, body: str | int) -> None:
    """Let a camera follow a body, by name or number, with the pad in view."""
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = model.body(body).id
    camera.distance = _STAND_OFF * hover_height(model)
    camera.azimuth, camera.elevation = -140.0, -25.0


class Pace:
    """Keeps a flight to the clock, without making up for long delays."""

    def __init__(
        self, time: float, clock: Callable[[], float], sleep: Callable[[float], None]
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self.restart(time)

    def restart(self, time: float) -> None:
        """Continue from a time of the flight, s."""
        self._origin = self._clock() - time

    def due(self, time: float) -> float:
        """Return the time, s, until which a flight now at `time` should be flown."""
        return min(self._clock() - self._origin, time + _FALLEN_BEHIND)

    def rest(self, time: float) -> None:
        """Wait for the next picture of a flight at `time`, s."""
        behind = self._clock() - self._origin - time
        if behind > _FALLEN_BEHIND:
            self._origin += behind - _FALLEN_BEHIND
        self._sleep(max(0.0, _FRAME - max(behind, 0.0)))


def watch(
    flight: Live,
    window: Window,
    *,
    duration: float | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> float:
    """Step a flight in real time for `duration`, s, or until its window closes; return s flown.

    Raises DivergedError.
    """
    model, data = flight.model, flight.data
    step, end = model.opt.timestep, np.inf if duration is None else duration
    rotors, pace = Rotors(model), Pace(data.time, clock, sleep)
    with installed():
        while window.is_running() and data.time < end - 0.5 * step:
            made, due = (round(time / step) for time in (data.time, min(pace.due(data.time), end)))
            with window.lock():
                for _ in steps(model, data, added=flight.added, first=made, count=due):
                    pass
                rotors.draw(data)
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
    """Fly in MuJoCo's viewer until its window closes; return the seconds flown.

    Arguments are those of `prepare_live` and `watch`. Raises DisplayError.
    """
    flight = prepare_live(vehicle, excitation, ground=ground, seed=seed)
    if duration is None and excitation is not None:
        duration = excitation.duration
    with shown(flight) as window:
        return watch(flight, window, duration=duration)


@contextmanager
def shown(flight: Live) -> Iterator[Any]:
    """Show a flight in a window that follows it and closes at the end. Raises DisplayError."""
    others = set(threading.enumerate())
    window = open_window(flight)
    try:
        with window:
            aim(window.cam, flight.model, root_body(flight.model))
            window.set_texts(_LEGEND)
            yield window
    finally:
        # a window whose thread still lives when Python ends takes the program down with it
        for thread in set(threading.enumerate()) - others:
            thread.join(_CLOSING)


@contextmanager
def opening() -> Iterator[Any]:
    """Start GLFW, and give it to a block that opens a window. Raises DisplayError if it can't."""
    check_display()
    try:
        import glfw

        with warnings.catch_warnings():
            warnings.simplefilter("error", glfw.GLFWError)
            glfw.init()
            yield glfw
    except (ImportError, RuntimeError, Warning, mujoco.FatalError) as error:
        raise DisplayError(f"can't open a window: {error}; {_INSTEAD}") from None


def open_window(flight: Live) -> Any:
    """Return MuJoCo's viewer of a flight, a context manager. Raises DisplayError."""
    with opening():  # where the viewer itself starts GLFW, a failure ends the program
        from mujoco import viewer

        return viewer.launch_passive(
            flight.model, flight.data, show_left_ui=False, show_right_ui=False
        )


def check_display(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> None:
    """Raise DisplayError where no window can open; macOS and Windows always have a display."""
    if platform.startswith("linux") and not (
        environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    ):
        raise DisplayError(f"no display: neither DISPLAY nor WAYLAND_DISPLAY is set; {_INSTEAD}")


def drawn_tilt(a: ArrayLike, b: ArrayLike) -> Rotation:
    """Return the drawn tip-path plane from the hub's axes, forward-right-down.

    It tilts by `TILT_GAIN` times a rearward, b rightward, rad, (n_time,) each or a number.
    """
    return Rotation.from_rotvec(TILT_GAIN * np.stack([b, a, np.zeros_like(a)], axis=-1))


class Rotors:
    """Drawn rotors."""

    def __init__(self, model: mujoco.MjModel) -> None:
        where = addresses(model)
        self._parts = []
        for name in ("rotor", "tail_rotor"):
            body = model.body(name).id
            geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype == 0))
            turns = Rotation.from_quat(model.geom_quat[geoms], scalar_first=True).as_matrix()
            self._parts.append((body, geoms, model.geom_pos[geoms].copy(), turns))
        self._direction = model.actuator_user[where.rotor, PARAM.main_direction]
        self._speeds = model.actuator_user[where.rotor, [PARAM.main_speed, PARAM.tail_speed]]
        self._tilts = where.state + np.array([STATE.flap_a, STATE.flap_b])

    def draw(self, data: mujoco.MjData, time: float | None = None) -> None:
        """Put the rotors as the state has them, turned at nominal speeds by `time`, s, or now."""
        tilt = Rotation.from_rotvec(flip(*drawn_tilt(*data.act[self._tilts]).as_rotvec()))
        main, tail = (data.time if time is None else time) * self._speeds / SLOWED
        turned = Rotation.from_rotvec([0.0, 0.0, -self._direction * main])
        turns = (tilt * turned, Rotation.from_rotvec([0.0, tail, 0.0]))
        for (body, geoms, positions, matrices), turn in zip(self._parts, turns):
            frame = data.xmat[body].reshape(3, 3) @ turn.as_matrix()
            data.geom_xpos[geoms] = data.xpos[body] + positions @ frame.T
            data.geom_xmat[geoms] = (frame @ matrices).reshape(-1, 9)


def seen(aircraft: Aircraft) -> Live:
    """Return an aircraft to be shown, not flown, with all visible parts."""
    model = aircraft.vehicle.visual_model(aircraft.ground.put_into)
    flight = Live(aircraft.vehicle, model, aircraft.weather, aircraft.ground)
    _follow(flight, aircraft)
    return flight


class Watched:
    """Shows an aircraft flown by a `Backend`, through `on_frame` and `on_wait`."""

    def __init__(
        self,
        aircraft: Aircraft,
        flight: Live,
        window: Window,
        *,
        told: Callable[[], Mapping[str, str]] = dict,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Show the aircraft in the window of a flight from `seen`, and what is `told`."""
        self._told = told
        self._aircraft, self._flight, self._window = aircraft, flight, window
        self._rotors = Rotors(flight.model)
        self._clock, self._next = clock, -np.inf
        self._turned = 0.0
        self._show()

    def on_frame(self, _frame: Frame, _sensed: Sensed) -> bool:
        """Show a picture when it is due; return whether the window was closed."""
        if self._clock() < self._next:
            return False
        self._turned += self._aircraft.rotor_speed * _FRAME
        return self._show()

    def on_wait(self) -> bool:
        """Return whether the window was closed."""
        return not self._window.is_running()

    def _show(self) -> bool:
        if not self._window.is_running():
            return True
        with self._window.lock():
            _follow(self._flight, self._aircraft)
            self._rotors.draw(self._flight.data, self._turned)
        told = {"height": f"{-self._aircraft.sensed.position[2]:z.1f} m", **self._told()}
        columns = ("\n".join(one) for one in (told, told.values()))
        self._window.set_texts([_LEGEND, (None, mujoco.mjtGridPos.mjGRID_TOPLEFT, *columns)])
        self._window.sync()
        self._next = self._clock() + _FRAME
        return False


def _follow(flight: Live, aircraft: Aircraft) -> None:
    model, data = flight.model, flight.data
    for name in _STATE:
        setattr(data, name, getattr(aircraft.data, name))
    mujoco.mj_fwdPosition(model, data)
