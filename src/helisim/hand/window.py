"""Fly by hand in a window of GLFW with MuJoCo's renderer, in real time."""

import math
import time
from collections.abc import Callable, Sequence, Set
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.files import check_destination, numbered
from helisim.hand.flight import ASSISTS, HandFlight
from helisim.hand.sticks import KEYS, MODES, Joystick, Sticks, choose, read_axes
from helisim.records.storage import write_record
from helisim.show.viewer import Pace, Rotors, opening
from helisim.sim import Ground, Weather
from helisim.sim.plan import hover_height
from helisim.vehicle import Vehicle

Rows = tuple[tuple[str, str], ...]

# Heights of the hover; degrees; share of a turn that the camera follows in a picture.
_BEHIND, _ABOVE_DEG, _FOLLOWS = 2.6, -16.0, 0.08
_MOVES = {"lat": "roll", "ped": "yaw", "lon": "pitch", "col": "lift"}
_KEYS: Rows = (
    ("R", "record, stop"),
    ("P", "pause"),
    ("Backspace", "start again"),
    ("H", "next assist"),
    ("Esc", "leave"),
)
_USED = ("r", "p", "backspace", "h", "escape", *(name for pair in KEYS for name in pair))


class Inputs(NamedTuple):
    """Keys that are down, and a joystick's axes or None."""

    held: Set[str] = frozenset()
    axes: Sequence[float] | None = None


def fly_by_hand(
    vehicle: Vehicle,
    *,
    joystick: str | None = None,
    mode: int = 2,
    order: str = "AETR",
    assist: str = "hover",
    weather: Weather | None = None,
    ground: Ground | None = None,
    out: str | Path = "by_hand.parquet",
    duration: float | None = None,
    seed: int = 1,
) -> list[Path]:
    """Fly a vehicle by hand in a window until it is closed, or `duration`, s; return the records.

    The joystick is a number or part of a name, "" the only one, None the keyboard; mode (1 to 4)
    and order, such as "TAER", are a transmitter's. Weather is calm and the ground level if None.
    Further records than `out` get a number. Raises DisplayError, InputError, StorageError.
    """
    flight = HandFlight(vehicle, assist=assist, weather=weather, ground=ground, seed=seed)
    sticks = Sticks(mode=mode, order=order)
    check_destination(out)
    if joystick is not None:
        with opening() as glfw:
            sticks = Sticks(choose(glfw, joystick), mode=mode, order=order)
    flight.flown_with = sticks.name
    with GlfwWindow(flight, sticks.joystick) as window:
        return fly_in(window, Cockpit(flight, sticks, Path(out), paused=True), duration=duration)


def fly_in(
    window: "GlfwWindow",
    cockpit: "Cockpit",
    *,
    duration: float | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> list[Path]:
    """Fly in real time until the window closes, the pilot leaves or `duration`, s, is over.

    Returns the records that were written. Raises StorageError, or InputError for a missing axis.
    """
    flight = cockpit.flight
    rotors, pace = Rotors(flight.model), Pace(flight.time, clock, sleep)
    last = clock()
    end = math.inf if duration is None else last + duration
    try:
        while window.is_running() and not cockpit.closed and clock() < end:
            now, before = clock(), flight.time
            cockpit.turn(window.read(), now - last)
            last = now
            if cockpit.paused or flight.crashed or flight.time < before:
                pace.restart(flight.time)
            ahead = pace.due(flight.time) - flight.time
            if ahead > 0.0:
                flight.fly(ahead)
            if flight.crashed:
                cockpit.stop_recording()
            if np.all(np.isfinite(flight.data.qpos)):
                rotors.draw(flight.data)
            window.show(*cockpit.words())
            pace.rest(flight.time)
    finally:
        cockpit.stop_recording()
    return cockpit.written


class Cockpit:
    """A pilot's seat without a window: obeys keys, moves the sticks, writes every recording.

    `out` is the record to write; further ones get a number. `closed` is whether the pilot has left.
    """

    def __init__(
        self, flight: HandFlight, sticks: Sticks, out: Path, *, paused: bool = False
    ) -> None:
        self.flight, self.sticks, self.out, self.paused = flight, sticks, out, paused
        self.closed, self.written, self._said = False, list[Path](), ""
        self._held: Set[str] = frozenset()
        self._take_up()

    def turn(self, inputs: Inputs, seconds: float) -> None:
        """Obey the inputs; seconds have passed since the last time."""
        for key in sorted(inputs.held - self._held):
            self._obey(key)
        self._held = inputs.held
        deflection = self.sticks.deflection(
            *inputs, 0.0 if self.paused else seconds, climbs=self.flight.assist == "hover"
        )
        if deflection is not None:
            self.flight.deflection = deflection
        elif not self.paused:
            self.paused = True
            self._said = f"{self.sticks.name} is gone: plug it in, then press P"

    def _obey(self, key: str) -> None:
        flight, self._said = self.flight, ""
        match key:
            case "p":
                self.paused = not self.paused
            case "r" if flight.recorded is not None:
                self.stop_recording()
            case "r" if not flight.crashed:
                flight.start_recording()
            case "backspace":
                self.stop_recording()
                flight.reset()
                self._take_up()
            case "h":
                names = list(ASSISTS)
                flight.assist = names[(names.index(flight.assist) + 1) % len(names)]
                self._take_up()
                self._said = f"assist {flight.assist}: {ASSISTS[flight.assist]}"
            case "escape":
                self.closed = True

    def _take_up(self) -> None:
        self.sticks.collective = 2.0 * float(self.flight.sticks[0])

    def stop_recording(self) -> None:
        """Write the recording that runs, if any. Raises StorageError."""
        if self.flight.recorded is None:
            return
        try:
            record = self.flight.stop_recording()
        except InputError as error:
            self._said = str(error)
        else:
            path = next(one for one in numbered(self.out) if not one.exists())
            self.written.append(write_record(record, path))
            ended = f", but {record.ended}" if record.ended else ""
            self._said = f"written: {path} ({record.duration:.1f} s){ended}"

    def words(self) -> tuple[Rows, Rows, str]:
        """Return keys and their meaning, names and values of the flight, and a message or ""."""
        flight, now = self.flight, self.flight.motion
        readout = {
            "recorded": f"{flight.recorded or 0.0:.1f} s",
            "time": f"{flight.time:.1f} s",
            "height": f"{flight.clearance:.1f} m",
            "speed": f"{math.hypot(now.u, now.v):.1f} m/s",
            "heading": f"{round(math.degrees(now.psi)) % 360:03d} deg",
            "assist": flight.assist,
        } | {name: f"{100.0 * one:+.0f} %" for name, one in flight.deflection._asdict().items()}
        crashed = f"{flight.crashed}: Backspace starts again" if flight.crashed else ""
        message = crashed or self._said or ("paused: P goes on" if self.paused else "")
        moves = [_MOVES[name] for name in MODES[self.sticks.mode]]
        thumbs = zip(("A D", "W S", "left right", "up down"), moves)
        legend = _KEYS if self.sticks.joystick else (*thumbs, *_KEYS)
        return legend, tuple(readout.items()), message


class GlfwWindow:
    """Shows a flight by hand and reads keys and joystick."""

    def __init__(
        self,
        flight: HandFlight,
        joystick: Joystick | None = None,
        *,
        size: tuple[int, int] = (1200, 800),
    ) -> None:
        """Open the window, so many pixels wide and high. Raises DisplayError."""
        self._flight, self._joystick = flight, joystick
        with opening() as glfw:
            glfw.default_window_hints()
            glfw.window_hint(glfw.SAMPLES, int(flight.model.vis.quality.offsamples))
            title = f"helisim: {flight.vehicle.name} by hand"
            self._glfw, self._window = glfw, glfw.create_window(*size, title, None, None)
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        glfw.set_input_mode(self._window, glfw.STICKY_KEYS, True)  # a short tap is seen, too
        self._context = mujoco.MjrContext(flight.model, mujoco.mjtFontScale.mjFONTSCALE_150)
        self._scene = mujoco.MjvScene(flight.model, maxgeom=4000)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation = -math.degrees(flight.motion.psi), _ABOVE_DEG
        self._camera.distance = _BEHIND * hover_height(flight.model)

    def __enter__(self) -> "GlfwWindow":
        return self

    def __exit__(self, *_: object) -> None:
        self._context.free()
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()

    def is_running(self) -> bool:
        """Return whether the window is still open."""
        return not self._glfw.window_should_close(self._window)

    def read(self) -> Inputs:
        """Return the present report of keys and joystick."""
        glfw = self._glfw
        glfw.poll_events()
        codes = {name: getattr(glfw, f"KEY_{name.upper()}") for name in _USED}
        held = {name for name, code in codes.items() if glfw.get_key(self._window, code)}
        return Inputs(held, None if self._joystick is None else read_axes(glfw, self._joystick))

    def show(self, legend: Rows, readout: Rows, message: str) -> None:
        """Show the present state and words over it."""
        model, data, scene = self._flight.model, self._flight.data, self._scene
        turned = -math.degrees(self._flight.motion.psi) - self._camera.azimuth
        self._camera.azimuth += _FOLLOWS * ((turned + 180.0) % 360.0 - 180.0)
        self._camera.lookat[:] = data.qpos[:3]
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, self._option, None, self._camera, everything, scene)
        frame = mujoco.MjrRect(0, 0, *self._glfw.get_framebuffer_size(self._window))
        mujoco.mjr_render(frame, scene, self._context)
        places, font = mujoco.mjtGridPos, mujoco.mjtFont.mjFONT_NORMAL
        for place, part, rows in (
            (places.mjGRID_TOPLEFT, frame, legend),
            (places.mjGRID_TOPRIGHT, frame, readout),
            # top of the lower half: the middle
            (
                places.mjGRID_TOP,
                mujoco.MjrRect(0, 0, frame.width, frame.height // 2),
                ((message, ""),),
            ),
        ):
            left, right = ("\n".join(column) for column in zip(*rows))
            if left:
                mujoco.mjr_overlay(font, place, part, left, right, self._context)
        self._glfw.swap_buffers(self._window)

    def picture(self) -> NDArray[np.uint8]:
        """Return the last picture, (n_row, n_column, 3), its first row on top."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        pixels = np.zeros((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, mujoco.MjrRect(0, 0, width, height), self._context)
        return pixels[::-1]
