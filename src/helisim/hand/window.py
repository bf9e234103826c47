"""Fly by hand in a window of GLFW with MuJoCo's renderer, in real time.

MuJoCo's passive viewer says when a key goes down, never when it goes up, and most letters switch
something in it; sticks need to know how long a key is held. So this is a window of its own.
"""

import math
import time
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DisplayError, InputError, StorageError
from helisim.base.files import check_destination
from helisim.hand.flight import ASSISTS, HandFlight
from helisim.hand.sticks import (
    FINE_KEY,
    KEY_FEEL,
    MODES,
    Inputs,
    Joystick,
    JoystickMap,
    JoystickSticks,
    KeyboardSticks,
    StickDevice,
    StickFeel,
    choose,
    joysticks,
    read_axes,
)
from helisim.physics.native import installed
from helisim.records.record import FlightRecord
from helisim.records.storage import write_record
from helisim.show.viewer import Pace, Rotors, Window, aim, check_display
from helisim.sim import Ground, Weather
from helisim.sim.plan import hover_height
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import root_body

CAMERAS = ("behind", "around")
"""From behind, with its heading; around it, heading nowhere."""
Rows = tuple[tuple[str, str], ...]

_SHOWN = 4.0
"""s, for which a message stays."""
_BEHIND, _ABOVE_DEG, _FOLLOWS = 2.6, -16.0, 0.08
"""How far behind, of the hover's height; degrees, downwards; share of a turn that the camera
follows in a picture, so that a turn is seen."""
_GEOMS = 4000
"""Most geoms of a scene."""
_CROWDED_DPI = 1.5
"""Content scale from which on a screen's letters are drawn larger."""
_MEANING = {
    "hover": "the sticks command velocities; let go, and it stays",
    "level": "the cyclic stick commands tilt; let go, and it levels",
    "none": "all sticks go to the gyro as they are",
}
_MOVES = {"lat": "roll", "ped": "yaw", "lon": "pitch", "col": "lift"}
_KEYS: Rows = (
    ("R", "record, stop"),
    ("P", "pause"),
    ("Backspace", "start again"),
    ("H", "next assist"),
    ("G", "gyro on, off"),
    ("C", "camera"),
    ("F1", "hide keys"),
    ("Esc", "leave"),
)


class Panel(NamedTuple):
    """The words over a picture: keys and their meaning, names and values, a message or ""."""

    legend: Rows
    readout: Rows
    message: str = ""


class HandWindow(Window, Protocol):
    """The part of a window that the loop of a flight by hand uses."""

    panel: Panel | None
    camera_kind: str

    def read(self) -> Inputs:
        """Return the present report of keys and joystick."""
        ...


def fly_by_hand(
    vehicle: Vehicle,
    *,
    joystick: str | int | None = None,
    mode: int = 2,
    assist: str = "hover",
    feel: StickFeel | None = None,
    axes: JoystickMap | None = None,
    weather: Weather | None = None,
    ground: Ground | None = None,
    out: str | Path = "by_hand.parquet",
    duration: float | None = None,
    seed: int = 1,
) -> list[Path]:
    """Open a window and fly a vehicle by hand until the window is closed.

    Args:
        vehicle: that flies.
        joystick: number or part of the name of a joystick or gamepad, "" for the only one; None
            flies by the keyboard.
        mode: 1 to 4, of a transmitter: which stick is where, on keys and gamepad.
        assist: "hover", "level" or "none" at the start; a key switches it.
        feel: rates, expo and deadband of the sticks; those that suit the device if None.
        axes: of the joystick; if None, those of any gamepad, or of a transmitter's AETR.
        weather: that is flown through; calm if None.
        ground: that is below; level if None.
        out: record to write, .parquet or .csv; further ones get a number.
        duration: s after which the window closes by itself.
        seed: of turbulence and sensors.

    Returns:
        The records that were written.

    Raises:
        DisplayError: there is no display to open a window on.
        InputError: there is no such joystick, or a setting is none.
        StorageError: a record could not be written.
    """
    check_display()
    logbook = Logbook(out)
    found = None if joystick is None else choose(str(joystick), joysticks(start_glfw()))
    device: StickDevice
    if found is None:
        device = KeyboardSticks(mode=mode, feel=feel or KEY_FEEL)
    else:
        usual = JoystickMap.gamepad(mode) if found.is_gamepad else JoystickMap.transmitter()
        device = JoystickSticks(axes or usual, mode, feel or StickFeel(), found.name)
    flight = HandFlight(
        vehicle,
        assist=assist,
        feel=device.feel,
        weather=weather,
        ground=ground,
        seed=seed,
        flown_with=device.name,
    )
    cockpit = Cockpit(flight, device, logbook, paused=True)
    with GlfwWindow(flight, found) as window:
        return fly_in(window, cockpit, duration=duration)


def fly_in(
    window: HandWindow,
    cockpit: "Cockpit",
    *,
    duration: float | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> list[Path]:
    """Fly in real time until the window is closed, the pilot leaves, or the time is over.

    A recording that runs is written however the flight ends.

    Args:
        window: that shows it and reads the devices.
        cockpit: with the flight.
        duration: s of the clock; None flies on.
        clock: s, rising.
        sleep: for a number of seconds.

    Returns:
        The records that were written.

    Raises:
        StorageError: a record could not be written.
        InputError: the joystick lacks an axis of its map.
    """
    flight = cockpit.flight
    rotors = Rotors(flight.model, flight.vehicle.roles)
    pace = Pace(flight.time, clock, sleep)
    half = 0.5 * float(flight.model.opt.timestep)
    began = last = clock()
    try:
        with installed():
            while window.is_running() and not cockpit.closed:
                now = clock()
                if duration is not None and now - began >= duration:
                    break
                before = flight.time
                cockpit.turn(window.read(), now - last)
                last = now
                if cockpit.paused or flight.crashed or flight.time < before:
                    pace.restart(flight.time)
                until = pace.due(flight.time) - half
                while flight.time < until and not flight.crashed:
                    flight.step()
                cockpit.land()
                if np.all(np.isfinite(flight.data.qpos)):
                    rotors.draw(flight.data, window.user_scn)
                window.panel, window.camera_kind = cockpit.panel, cockpit.camera
                window.sync()
                pace.rest(flight.time)
    finally:
        cockpit.leave()
    return cockpit.logbook.written


class Logbook:
    """Writes records to FILE, then to FILE_2, FILE_3 and so on; none is ever written over.

    Attributes:
        written: paths of the records that were written, in order.
        kept: records that could not be written, and are still in memory.
    """

    def __init__(self, path: str | Path) -> None:
        """Raise StorageError if nothing could be written there."""
        self.path = Path(path)
        check_destination(self.next_path)
        self.written: list[Path] = []
        self.kept: list[FlightRecord] = []

    @property
    def next_path(self) -> Path:
        """The first path of the series where nothing is yet."""
        path, number = self.path, 1
        while path.exists():
            number += 1
            path = self.path.with_stem(f"{self.path.stem}_{number}")
        return path

    def flush(self) -> None:
        """Write what is kept. Raises StorageError."""
        while self.kept:
            path = self.next_path
            try:
                write_record(self.kept[0], path)
            except StorageError as error:
                lost = f"{len(self.kept)} record{'s' if len(self.kept) > 1 else ''}"
                raise StorageError(f"{error}; {lost} not written yet") from None
            self.written.append(path)
            del self.kept[0]


@dataclass
class Cockpit:
    """A pilot's seat without a window: obeys keys, moves the sticks, keeps every recording.

    Attributes:
        flight: that is flown.
        device: that moves its sticks.
        logbook: of the recordings.
        paused: whether time stands still.
        camera: one of `CAMERAS`.
        closed: whether the pilot has left.
    """

    flight: HandFlight
    device: StickDevice
    logbook: Logbook
    paused: bool = False
    camera: str = CAMERAS[0]
    closed: bool = False
    _legend: bool = True
    _said: str = ""
    _said_for: float = 0.0

    def __post_init__(self) -> None:
        self._take_up()

    def turn(self, inputs: Inputs, seconds: float) -> None:
        """Obey the inputs; seconds have passed since the last time."""
        self._said_for += seconds
        for key in inputs.pressed:
            self._obey(key)
        climbs = self.flight.assist == "hover"
        deflection = self.device.deflection(inputs, 0.0 if self.paused else seconds, climbs=climbs)
        if deflection is not None:
            self.flight.deflection = deflection
        elif not self.paused:
            self.paused = True
            self.say(f"{self.device.name} is gone: plug it in, then press P")

    def land(self) -> None:
        """Keep a recording that runs where the helicopter has crashed."""
        if self.flight.crashed:
            self._stop_recording()

    def leave(self) -> None:
        """Write the records that are not written yet. Raises StorageError."""
        self._stop_recording()
        self.logbook.flush()

    def say(self, text: str) -> None:
        """Show a message for a while."""
        self._said, self._said_for = text, 0.0

    @property
    def panel(self) -> Panel:
        """The words to be shown."""
        flight, now = self.flight, self.flight.motion
        recorded, sticks = flight.recorded, flight.deflection
        readout = [("REC", f"{recorded:.1f} s")] if recorded is not None else []
        readout += [
            ("time", f"{flight.time:.1f} s"),
            ("height", f"{flight.clearance:.1f} m"),
            ("speed", f"{math.hypot(now.u, now.v):.1f} m/s"),
            ("climb", f"{float(flight.data.qvel[2]):+.1f} m/s".replace("-0.0", "+0.0")),
            ("heading", f"{round(math.degrees(now.psi)) % 360:03d} deg"),
            ("assist", flight.assist),
            ("gyro", "on" if flight.gyro else "off"),
            *((name, f"{100.0 * one:+.0f} %") for name, one in sticks._asdict().items()),
            ("col in hover", f"{200.0 * float(flight.hover_collective):+.0f} %"),
        ]
        message = "paused: P goes on" if self.paused else ""
        if flight.crashed:
            message = f"{flight.crashed}: Backspace starts again"
        elif self._said and self._said_for < _SHOWN:
            message = self._said
        legend = self._keys() if self._legend else (("F1", "keys"),)
        return Panel(legend, tuple(readout), message)

    def _keys(self) -> Rows:
        """Return the keys and their meaning, those of the sticks first where keys are sticks."""
        if not isinstance(self.device, KeyboardSticks):
            return _KEYS
        left_x, left_y, right_x, right_y = (_MOVES[name] for name in MODES[self.device.mode])
        sticks = (("W S", left_y), ("A D", left_x), ("up down", right_y), ("left right", right_x))
        return (*sticks, (FINE_KEY.capitalize(), "small moves"), *_KEYS)

    def _obey(self, key: str) -> None:
        flight = self.flight
        match key:
            case "p":
                self.paused = not self.paused
            case "r" if flight.recorded is not None:
                self._stop_recording()
            case "r" if not flight.crashed:
                flight.start_recording()
            case "backspace":
                self._stop_recording()
                flight.reset()
                self._take_up()
            case "h":
                flight.assist = ASSISTS[(ASSISTS.index(flight.assist) + 1) % len(ASSISTS)]
                self._take_up()
                self.say(f"assist {flight.assist}: {_MEANING[flight.assist]}")
            case "g":
                flight.gyro = not flight.gyro
                self.say("gyro on" if flight.gyro else "gyro off: the sticks move the servos")
            case "c":
                self.camera = CAMERAS[(CAMERAS.index(self.camera) + 1) % len(CAMERAS)]
            case "f1":
                self._legend = not self._legend
            case "escape":
                self.closed = True

    def _take_up(self) -> None:
        self.device.take_up(2.0 * float(self.flight.sticks[0]))

    def _stop_recording(self) -> None:
        """Write the recording that runs, if any."""
        if self.flight.recorded is None:
            return
        try:
            record = self.flight.stop_recording()
            self.logbook.kept.append(record)
            self.logbook.flush()
        except (InputError, StorageError) as error:
            self.say(str(error))
            return
        ended = f", but {record.ended}" if record.ended else ""
        self.say(f"written: {self.logbook.written[-1]} ({record.duration:.1f} s){ended}")


def start_glfw() -> Any:
    """Return the glfw module, ready. Raises DisplayError."""
    try:
        import glfw
    except ImportError as error:
        raise DisplayError(f"can't open a window: {error}; pip install glfw") from None
    with warnings.catch_warnings(record=True) as reasons:
        warnings.simplefilter("always")
        if not glfw.init():
            why = str(reasons[-1].message) if reasons else "GLFW does not start"
            raise DisplayError(f"can't open a window: {why}")
    return glfw


class GlfwWindow:
    """Shows a flight by hand and reads keys and joystick.

    Attributes:
        user_scn: geoms that are drawn beside the model's.
        panel: words over the picture; None for none.
        camera_kind: one of `CAMERAS`.
    """

    def __init__(
        self,
        flight: HandFlight,
        joystick: Joystick | None = None,
        *,
        size: tuple[int, int] = (1200, 800),
    ) -> None:
        """Open the window, so many pixels wide and high. Raises DisplayError."""
        self._glfw = glfw = start_glfw()
        self._flight, self._joystick = flight, joystick
        self._held: set[str] = set()
        self._pressed: list[str] = []
        self.panel: Panel | None = None
        self.camera_kind, self._shown_kind = CAMERAS[0], ""
        glfw.default_window_hints()
        glfw.window_hint(glfw.SAMPLES, int(flight.model.vis.quality.offsamples))
        with warnings.catch_warnings(record=True) as reasons:
            warnings.simplefilter("always")
            title = f"helisim: {flight.vehicle.name} by hand"
            self._window = glfw.create_window(*size, title, None, None)
        if not self._window:
            glfw.terminate()
            why = str(reasons[-1].message) if reasons else "no OpenGL"
            raise DisplayError(f"can't open a window: {why}")
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        glfw.set_key_callback(self._window, self._on_key)
        glfw.set_window_focus_callback(self._window, self._on_focus)
        glfw.set_scroll_callback(self._window, self._on_scroll)
        sizes = mujoco.mjtFontScale
        crowded = glfw.get_window_content_scale(self._window)[0] > _CROWDED_DPI
        font = sizes.mjFONTSCALE_200 if crowded else sizes.mjFONTSCALE_150
        self._context = mujoco.MjrContext(flight.model, font)
        self._scene = mujoco.MjvScene(flight.model, maxgeom=_GEOMS)
        self.user_scn = mujoco.MjvScene(flight.model, maxgeom=10)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._zoom = 1.0

    def __enter__(self) -> "GlfwWindow":
        return self

    def __exit__(self, *_: object) -> None:
        self._context.free()
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()

    def is_running(self) -> bool:
        """Return whether the window is still open."""
        return not self._glfw.window_should_close(self._window)

    def lock(self) -> AbstractContextManager[Any]:
        """Nothing else reads the state."""
        return nullcontext()

    def read(self) -> Inputs:
        """Return the present report of keys and joystick."""
        self._glfw.poll_events()
        pressed, self._pressed = tuple(self._pressed), []
        axes = None if self._joystick is None else read_axes(self._glfw, self._joystick)
        return Inputs(frozenset(self._held), pressed, axes)

    def sync(self) -> None:
        """Show the present state."""
        self._look()
        model, data, scene = self._flight.model, self._flight.data, self._scene
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, self._option, None, self._camera, everything, scene)
        for geom in self.user_scn.geoms[: self.user_scn.ngeom]:
            shape = (geom.type, geom.size, geom.pos, geom.mat.flatten(), geom.rgba)
            mujoco.mjv_initGeom(scene.geoms[scene.ngeom], *shape)
            scene.ngeom += 1
        frame = mujoco.MjrRect(0, 0, *self._glfw.get_framebuffer_size(self._window))
        mujoco.mjr_render(frame, scene, self._context)
        if self.panel is not None:
            places, font = mujoco.mjtGridPos, mujoco.mjtFont.mjFONT_NORMAL
            for place, rows in (
                (places.mjGRID_TOPLEFT, self.panel.legend),
                (places.mjGRID_TOPRIGHT, self.panel.readout),
                (places.mjGRID_BOTTOMLEFT, ((self.panel.message, ""),)),
            ):
                left, right = ("\n".join(column) for column in zip(*rows))
                if left:
                    mujoco.mjr_overlay(font, place, frame, left, right, self._context)
        self._glfw.swap_buffers(self._window)

    def picture(self) -> NDArray[np.uint8]:
        """Return the last picture, of shape (height, width, 3), its first row on top."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        pixels = np.zeros((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, mujoco.MjrRect(0, 0, width, height), self._context)
        return pixels[::-1]

    def _look(self) -> None:
        """Aim the camera for the next picture."""
        model, view = self._flight.model, self._camera
        new, self._shown_kind = self.camera_kind != self._shown_kind, self.camera_kind
        if new:
            aim(view, model, root_body(model))
            self._around = view.distance
        distance = self._around
        if self.camera_kind == "behind":
            view.type = mujoco.mjtCamera.mjCAMERA_FREE
            heading = -math.degrees(self._flight.motion.psi)
            turn = (heading - view.azimuth + 180.0) % 360.0 - 180.0
            view.azimuth += turn if new else _FOLLOWS * turn
            view.elevation = _ABOVE_DEG
            distance = _BEHIND * hover_height(model)
            view.lookat[:] = self._flight.data.qpos[:3]
        view.distance = distance * self._zoom

    def _on_key(self, _window: Any, key: int, _code: int, action: int, _modifiers: int) -> None:
        name = self._key_name(key)
        if action == self._glfw.PRESS:
            self._held.add(name)
            self._pressed.append(name)
        elif action == self._glfw.RELEASE:
            self._held.discard(name)

    def _on_focus(self, _window: Any, focused: int) -> None:
        if not focused:  # a key that goes up elsewhere is never reported
            self._held.clear()

    def _on_scroll(self, _window: Any, _across: float, upwards: float) -> None:
        self._zoom = min(4.0, max(0.25, self._zoom * 0.9**upwards))

    def _key_name(self, key: int) -> str:
        glfw = self._glfw
        if glfw.KEY_A <= key <= glfw.KEY_Z:
            return chr(key).lower()
        return {
            glfw.KEY_LEFT: "left",
            glfw.KEY_RIGHT: "right",
            glfw.KEY_UP: "up",
            glfw.KEY_DOWN: "down",
            glfw.KEY_LEFT_SHIFT: FINE_KEY,
            glfw.KEY_RIGHT_SHIFT: FINE_KEY,
            glfw.KEY_BACKSPACE: "backspace",
            glfw.KEY_ESCAPE: "escape",
            glfw.KEY_F1: "f1",
        }.get(key, "")
