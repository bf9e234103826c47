"""Fly by hand in a window, in real time."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np

from helisim.hand import (
    KEY_FEEL,
    HandFlight,
    Inputs,
    JoystickMap,
    JoystickSticks,
    KeyboardSticks,
    Logbook,
    StickDevice,
    StickFeel,
)
from helisim.hand.cockpit import Cockpit
from helisim.hand.joysticks import Joystick, choose, joysticks
from helisim.hand.panel import Panel
from helisim.hand.window import GlfwWindow, start_glfw
from helisim.physics.native import installed
from helisim.show.viewer import Pace, Rotors, Window, check_display
from helisim.sim import Ground, Weather
from helisim.vehicle import Vehicle


class HandWindow(Window, Protocol):
    """What the loop asks of a window to fly in."""

    panel: Panel | None
    camera_kind: str

    def read(self) -> Inputs:
        """Return what keys and joystick report now."""
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
        mode: 1 to 4, of a transmitter: which stick is where, on keys, gamepad and screen.
        assist: "hover", "level" or "none" at the start; a key switches it.
        feel: rates, expo and deadband of the sticks; what suits the device if None.
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
    device = _device(found, mode, feel, axes)
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


def _device(
    found: Joystick | None, mode: int, feel: StickFeel | None, axes: JoystickMap | None
) -> StickDevice:
    """Return the sticks of a joystick, of the keyboard if None."""
    if found is None:
        return KeyboardSticks(mode=mode, feel=feel or KEY_FEEL)
    if axes is None:
        axes = JoystickMap.gamepad(mode) if found.is_gamepad else JoystickMap.transmitter()
    return JoystickSticks(axes, mode=mode, feel=feel or StickFeel(), name=found.name)


def fly_in(
    window: HandWindow,
    cockpit: Cockpit,
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
                _fly_on(flight, pace)
                cockpit.land()
                _show(window, cockpit, rotors)
                pace.rest(flight.time)
    finally:
        cockpit.leave()
    return cockpit.logbook.written


def _fly_on(flight: HandFlight, pace: Pace) -> None:
    until = pace.due(flight.time) - 0.5 * float(flight.model.opt.timestep)
    while flight.time < until and not flight.crashed:
        flight.step()


def _show(window: HandWindow, cockpit: Cockpit, rotors: Rotors) -> None:
    data = cockpit.flight.data
    if np.all(np.isfinite(data.qpos)):
        rotors.draw(data, window.user_scn)
    window.panel, window.camera_kind = cockpit.panel, cockpit.camera
    window.sync()
