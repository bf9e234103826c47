"""Frequency sweeps by ArduPilot's own SystemID mode.

Numbers of its axes, units and the course of a sweep: ArduPilot's documentation of the mode and of
the parameters SID_AXIS to SID_T_FADE_OUT. It waits a second, sweeps for SID_T_REC in all, of which
two periods at the start frequency are held, and then sits still for as long as both fades and those
two periods last.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from helisim.base.errors import AutopilotError, InputError, UnknownNameError
from helisim.handling.loop import axis_of
from helisim.sitl.pilot import Hold, Pilot, Steps

HEIGHT = 50.0
"""m above the ground where sweeps are flown, far from its effect and its hardness."""
_DELAY = 1.0
"""s that the mode waits before it sweeps."""
_AFTER = 2.0
"""s after a sweep until the pilot takes over."""
_FARTHEST = 30.0
"""m from where a sweep began, at which it is ended."""


@dataclass(frozen=True)
class Sweep:
    """One sweep of SystemID.

    Attributes:
        axis: "roll", "pitch", "yaw" or "thrust".
        into: where the signal is added, a key of `INTO`.
        magnitude: in the unit of `INTO`.
        start_hz, stop_hz: frequencies.
        seconds: it lasts.
        fade_in, fade_out: s.
    """

    axis: str
    into: str
    magnitude: float
    start_hz: float
    stop_hz: float
    seconds: float
    fade_in: float = 5.0
    fade_out: float = 2.0

    def __post_init__(self) -> None:
        held = 2.0 / self.start_hz if self.start_hz > 0.0 else math.inf
        if not 0.0 < self.start_hz < self.stop_hz <= 100.0:
            raise InputError(
                "a sweep goes from a frequency above 0 to a higher one of at most 100 Hz, got "
                f"{self.start_hz:g} to {self.stop_hz:g}"
            )
        if not self.magnitude > 0.0:
            raise InputError(f"a sweep's magnitude must be above 0, got {self.magnitude:g}")
        if not max(held, self.fade_in + self.fade_out) < self.seconds <= 255.0:
            raise InputError(
                f"a sweep lasts at most 255 s and longer than two periods of its start frequency "
                f"and both fades, here {max(held, self.fade_in + self.fade_out):g} s; got "
                f"{self.seconds:g}"
            )
        if not (0.0 <= self.fade_in <= 20.0 and 0.0 <= self.fade_out <= 5.0):
            raise InputError(
                "a sweep fades in for at most 20 s and out for at most 5 s, got "
                f"{self.fade_in:g} and {self.fade_out:g}"
            )

    @property
    def number(self) -> int:
        """Of SID_AXIS."""
        return INTO[self.into].numbers[self.axis]

    @property
    def parameters(self) -> dict[str, float]:
        """Of ArduPilot, by name."""
        return {
            "SID_AXIS": self.number,
            "SID_MAGNITUDE": self.magnitude,
            "SID_F_START_HZ": self.start_hz,
            "SID_F_STOP_HZ": self.stop_hz,
            "SID_T_REC": self.seconds,
            "SID_T_FADE_IN": self.fade_in,
            "SID_T_FADE_OUT": self.fade_out,
        }

    def __str__(self) -> str:
        unit = INTO[self.into].units[self.axis]
        return (
            f"SystemID axis {self.number}, {self.into} {self.axis}: {self.magnitude:g} {unit}, "
            f"{self.start_hz:g} to {self.stop_hz:g} Hz in {self.seconds:g} s"
        )


@dataclass(frozen=True)
class _Into:
    """A place in the loop where SystemID adds its signal, with what is usual there."""

    numbers: dict[str, int]
    magnitudes: dict[str, float]
    units: dict[str, str]
    start_hz: float
    stop_hz: float
    seconds: float
    by_position: bool = False


def _into(
    first: int,
    magnitudes: dict[str, float],
    unit: str,
    band: tuple[float, float, float],
    *,
    by_position: bool = False,
    yaw: str = "",
) -> _Into:
    numbers = {axis: first + k for k, axis in enumerate(magnitudes)}
    units = {axis: yaw if yaw and axis == "yaw" else unit for axis in magnitudes}
    return _Into(numbers, magnitudes, units, *band, by_position)


_ANGLES, _RATES, _MIXER = (0.1, 8.0, 90.0), (0.2, 12.0, 90.0), (0.2, 12.0, 90.0)
_PLACES, _WISHES = (0.05, 2.0, 120.0), (0.05, 0.5, 120.0)
"""Usual start and stop frequency, Hz, and duration, s."""
_HALF = {"roll": 0.5, "pitch": 0.5}
INTO = {
    "input": _into(1, {"roll": 5.0, "pitch": 5.0, "yaw": 15.0}, "deg", _ANGLES, yaw="deg/s"),
    "recovery": _into(4, {"roll": 3.0, "pitch": 3.0, "yaw": 15.0}, "deg", _ANGLES, yaw="deg/s"),
    "rate": _into(7, {"roll": 10.0, "pitch": 10.0, "yaw": 15.0}, "deg/s", _RATES),
    "mixer": _into(10, {"roll": 0.06, "pitch": 0.06, "yaw": 0.07, "thrust": 0.06}, "of 1", _MIXER),
    "position": _into(14, _HALF, "m", _PLACES, by_position=True),
    "velocity": _into(16, _HALF, "m/s", _PLACES, by_position=True),
    "velocity-input": _into(18, _HALF, "m/s", _WISHES, by_position=True),
}
"""Name -> where SystemID adds its signal: to what the pilot asks (with feed forward, "input", and
without, "recovery"), to the rates that are wanted, to the mixer, to a measured position or
velocity, or to the velocity that is wanted."""


def sweeps(
    axes: Sequence[str], into: Sequence[str] = ("mixer",), *, count: int = 1, **changes: float
) -> list[Sweep]:
    """Return the sweeps of axes, each with what is usual there unless changed.

    Args:
        axes: of control, as "roll" or "lat".
        into: keys of `INTO`; an axis that one lacks is left out there.
        count: sweeps of each.
        changes: fields of `Sweep`.

    Raises:
        UnknownNameError: no such axis or place.
        InputError: none is left, or ArduPilot has no such sweep.
    """
    if count < 1:
        raise InputError(f"each axis needs at least one sweep, got {count}")
    words = [_word(axis) for axis in axes]
    made = []
    for place in into:
        if place not in INTO:
            raise UnknownNameError("place of SystemID's signal", place, INTO)
        usual = INTO[place]
        for axis in words:
            if axis in usual.numbers:
                band = (usual.start_hz, usual.stop_hz, usual.seconds)
                one = Sweep(axis, place, usual.magnitudes[axis], *band)
                made += [replace(one, **changes)] * count
    if not made:
        raise InputError(
            f"ArduPilot's SystemID adds nothing to {', '.join(into)} of {', '.join(words)}; "
            f"{into[0]} has {', '.join(INTO[into[0]].numbers)}"
        )
    return made


def _word(axis: str) -> str:
    """Return how ArduPilot calls an axis of control."""
    found = "thrust" if axis == "thrust" else axis_of(axis).word
    return "thrust" if found == "heave" else found


def fly_sweeps(wanted: Sequence[Sweep], *, height: float = HEIGHT) -> Callable[[Pilot], Steps]:
    """Return a script that takes off, flies sweeps one after another in the same place, and lands.

    Args:
        wanted: sweeps.
        height: m above the ground.
    """

    def script(pilot: Pilot) -> Steps:
        yield from pilot.take_off(height)
        for k, sweep in enumerate(wanted, 1):
            yield from pilot.go_to(0.0, 0.0, height)
            pilot.say(f"sweep {k} of {len(wanted)}: {sweep}")
            yield from fly_sweep(pilot, sweep)
        yield from pilot.go_to(0.0, 0.0, height)
        yield from pilot.go_to(0.0, 0.0, 5.0)
        yield from pilot.land()

    return script


def fly_sweep(pilot: Pilot, sweep: Sweep) -> Steps:
    """Fly a sweep from where the aircraft hovers.

    Raises:
        AutopilotError: the autopilot refuses it or stops it, or the aircraft gets too far away.
    """
    yield from pilot.set(**sweep.parameters)
    if INTO[sweep.into].by_position:
        yield from pilot.mode("loiter")
        yield from pilot.wait(3.0)
        hold = None
    else:
        hold = Hold(pilot)
        yield from hold.learn()
        yield from pilot.mode("stabilize")
        yield from hold.fly(2.0)
    begun = tuple(pilot.sensed.position)
    heard = len(pilot.telemetry.said)
    yield from pilot.mode("systemid")
    end = pilot.time + _DELAY + sweep.seconds + _AFTER
    while pilot.time < end:
        stopped = [text for text in pilot.telemetry.said[heard:] if "SystemID Stopped" in text]
        if stopped or math.dist(begun, pilot.sensed.position) > _FARTHEST:
            why = stopped[0] if stopped else f"it went {_FARTHEST:g} m away"
            raise AutopilotError(f"{sweep}: {why}; try a smaller magnitude or a higher start")
        if hold is not None:
            hold.steer()
        yield
    if hold is not None:
        hold.let_go()
