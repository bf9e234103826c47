"""Fly the vehicle in MuJoCo's own viewer, in real time."""

import os
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.base.errors import DisplayError, DivergedError, InputError
from helisim.physics.frames import flip
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.physics.params import PARAM
from helisim.show.drawn_rotor import SLOWED, TILT_GAIN, RotorGeoms, drawn_tilt, drawn_turn
from helisim.sim import Ground, Pilot
from helisim.sim.excitation import Excitation, check_excitation
from helisim.sim.injection import injection
from helisim.sim.pilot import hover_height
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses, root_body
from helisim.vehicle.roles import Roles
from helisim.vehicle.trim import place

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

LEGEND = f"disc tilt x {TILT_GAIN:g}, blades {SLOWED:g} times slower, thrust red"


class Window(Protocol):
    """What the loop asks of a viewer."""

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
        if self.added is not None:
            number = round(self.data.time / self.model.opt.timestep)
            row = self.added[number] if number < len(self.added) else 0.0
            self.data.userdata[: self.added.shape[1]] = row
        mujoco.mj_step(self.model, self.data)


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
            if not np.all(np.isfinite(data.qpos)) or any(w.number for w in data.warning):
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


_INSTEAD = "record the flight instead: helisim fly --axis lat --out lat.parquet --rerun lat.rrd"


def check_display(
    environment: Mapping[str, str] = os.environ, platform: str = sys.platform
) -> None:
    """Raise DisplayError where no window can open; macOS and Windows always have a display."""
    if platform.startswith("linux") and not (
        environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    ):
        raise DisplayError(f"no display: neither DISPLAY nor WAYLAND_DISPLAY is set; {_INSTEAD}")


class Rotors:
    """Both rotors as they are drawn, and the arrow of the main rotor's thrust."""

    def __init__(self, model: mujoco.MjModel, roles: Roles) -> None:
        where = addresses(model)
        self.main = RotorGeoms.of(model, roles.body("rotor"))
        self.tail = RotorGeoms.of(model, roles.body("tail_rotor"))
        self.direction = model.actuator_user[where.rotor, PARAM.main_direction]
        self.speeds = model.actuator_user[where.rotor, [PARAM.main_speed, PARAM.tail_speed]]
        self.tilts = where.state + np.array([STATE.flap_a, STATE.flap_b])
        self.thrust = model.sensor("rotor").adr[0]
        extent, mass = model.stat.extent, model.body_subtreemass[model.body_rootid[self.main.body]]
        self.metres_per_newton = _ARROW_LENGTH * extent / (mass * -model.opt.gravity[2])
        self.arrow_radius = _ARROW_RADIUS * extent

    def draw(
        self, data: mujoco.MjData, scene: mujoco.MjvScene | None, time: float | None = None
    ) -> None:
        """Put the rotors and the arrow where the state has them.

        Args:
            data: of the flight.
            scene: for the arrow; None draws none.
            time: s that the rotors have turned, as at their nominal speeds; the flight's if None.
        """
        tilt = Rotation.from_rotvec(flip(*drawn_tilt(*data.act[self.tilts]).as_rotvec()))
        main, tail = drawn_turn(data.time if time is None else time, self.speeds)
        turned = Rotation.from_rotvec([0.0, 0.0, -self.direction * main])
        self.main.place(data, (tilt * turned).as_matrix())
        self.tail.place(data, Rotation.from_rotvec([0.0, tail, 0.0]).as_matrix())
        if scene is None:
            return
        hub = data.xpos[self.main.body]
        up = data.xmat[self.main.body].reshape(3, 3) @ tilt.apply([0.0, 0.0, 1.0])
        tip = hub + up * self.metres_per_newton * data.sensordata[self.thrust]
        arrow, shape = scene.geoms[0], mujoco.mjtGeom.mjGEOM_ARROW
        mujoco.mjv_initGeom(arrow, shape, np.zeros(3), np.zeros(3), np.zeros(9), _THRUST_COLOUR)
        mujoco.mjv_connector(arrow, shape, self.arrow_radius, hub, tip)
        scene.ngeom = 1
