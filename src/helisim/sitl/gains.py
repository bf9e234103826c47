"""ArduCopter's gains for a helicopter, from a linear model of it: what each follows from.

Of each axis: the feed-forward is the command that holds a rate. The integral is half of what is
proportional, as ArduPilot's own autotune has it of the feed-forward, so that it acts below half a
radian a second. P, D and the attitude's gain are then those that leave least of slow disturbances
(the mean of log |S| up to 3 rad/s) and keep the margins below, all other axes closed: a search over
a grid of all three.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import Linear
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw, Rates
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import Margins, Rejection, margins, rejection
from helisim.handling.loop import BY_NAME, axis_of
from helisim.records.record import ATTITUDES, IN1, RATES

Array = NDArray[np.float64]
Response = NDArray[np.complex128]

LOOP_RATE = 400.0
"""Hz, SCHED_LOOP_RATE."""
GYRO_HZ = 40.0
"""INS_GYRO_FILTER: twice ArduPilot's own, as no vibration is simulated."""
FILTER_HZ = 20.0
"""FLTT and FLTD."""
INPUT_TIME = 0.2
"""s, ATC_INPUT_TC."""
_LATE = {"lat": 0.25e-3, "lon": 0.25e-3, "ped": 0.25e-3 + 1.0 / LOOP_RATE}
"""s, from a tick to the pulses that follow from it: frames come each millisecond, ticks each 2.5;
the tail's pulse waits for the tick that follows."""
LEAST_GAIN, LEAST_PHASE, MOST_PEAK = 8.0, np.radians(50.0), 4.5
"""dB, rad: SAE AS94900's 6 dB and 45 degrees, and some; dB, of the disturbance's peak, less than
the 5 dB that are usual (Tischler and others, AHS Forum 67, 2011)."""

_HOLDS = 2.0
"""rad/s, at which the feed-forward is told: above the hover's slow modes, below the rotor's."""
_BAND = np.geomspace(0.3, 200.0, 240)
_TELLS = 10.0
"""rad/s: a gain of 1 / |rate over command| there is the unit of P."""
_P = np.concatenate([np.linspace(0.0, 1.0, 11), np.linspace(1.2, 3.0, 10)])
"""Of that unit."""
_D = np.array([0.0, 0.005, 0.01, 0.02, 0.03, 0.05])
"""s, of that unit."""
_ANGLE = np.linspace(1.0, 8.0, 29)
"""1/s."""
_CORNER = 0.5
"""rad/s, of the integral."""
_SLOW = 3.0
"""rad/s, up to which disturbances are to be rejected."""
_ROUNDS = 3
_LEAST = 1e-12


class Gains(NamedTuple):
    """Of one axis: P, I, D and FF, of full command over SI units; of attitude, 1/s."""

    p: float
    i: float
    d: float
    ff: float
    angle: float


@dataclass(frozen=True, eq=False)
class Commanded:
    """A vehicle as the autopilot's commands move it; it is `Linear`.

    Attributes:
        vehicle: from col, lon, lat, ped in the vehicle's unit to p, q, r, phi, theta, psi.
        scale: (4, 4): what a unit of the autopilot's moves of them; see `mixing.Controls`.
        late: s, by which commands act late besides.
        held: whether they are held for a tick, which the vehicle's model doesn't have in it.
        axes: the commands that are looked at.
    """

    vehicle: Linear
    scale: Array
    late: float = 0.0
    held: bool = True
    axes: tuple[str, ...] = COMMANDS

    @property
    def inputs(self) -> tuple[str, ...]:
        """The commands, in the autopilot's unit, of which the vehicle's model knows."""
        return tuple(name for name in self.axes if name in self.vehicle.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Rates and attitudes."""
        known = self.vehicle.outputs
        return tuple(name for name in (*RATES, *ATTITUDES) if name in known)

    def response(self, frequency: Array) -> Response:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        own = self.vehicle
        rows = [own.outputs.index(name) for name in self.outputs]
        whole = own.response(frequency)[rows]
        by = [IN1.index(name) for name in own.inputs]
        to = [IN1.index(name) for name in self.inputs]
        moved = np.einsum("yuf,uc->ycf", whole, self.scale[np.ix_(by, to)])
        held = [0.5 / LOOP_RATE + _LATE[name] if self.held else 0.0 for name in self.inputs]
        late = self.late + np.array(held)
        return np.asarray(moved * np.exp(-1j * late[:, None] * np.asarray(frequency)))


@dataclass(frozen=True, eq=False)
class Tuning:
    """Gains of all axes, and what they make of the vehicle.

    Attributes:
        plant: the vehicle as the autopilot moves it.
        gains: of each axis that could be tuned.
        lean: (phi, theta) of the hover, rad.
        holds: command that holds 1 rad/s, of each axis.
    """

    plant: Commanded
    gains: Mapping[str, Gains]
    lean: tuple[float, float] = (0.0, 0.0)
    holds: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def loop(self) -> ClosedLoop:
        """The vehicle with the autopilot."""
        return ClosedLoop(self.plant, law_of(self.gains, self.lean), _BAND)

    def margins(self, axis: str) -> Margins:
        """Return the margins of an axis, cut at its command."""
        return margins(self.loop.broken(axis))

    def rejection(self, axis: str) -> Rejection:
        """Return how an axis rejects disturbances of its attitude."""
        return rejection(self.loop.disturbance(axis))


def law_of(gains: Mapping[str, Gains], lean: tuple[float, float] = (0.0, 0.0)) -> ArduCopterLaw:
    """Return ArduCopter's law with some gains, none on other axes."""
    full = {axis: gains.get(axis, Gains(0.0, 0.0, 0.0, 0.0, 0.0)) for axis in COMMANDS}
    return ArduCopterLaw(
        {axis: rates_of(one) for axis, one in full.items()},
        {axis: one.angle for axis, one in full.items()},
        1.0 / LOOP_RATE,
        gyro_hz=GYRO_HZ,
        input_time=INPUT_TIME,
        lean=lean,
    )


def rates_of(gains: Gains) -> Rates:
    """Return one axis's rate PID, with the filters that `settings` write."""
    return Rates(
        gains.p,
        gains.i,
        gains.d,
        gains.ff,
        d_ff=0.0,
        target_hz=FILTER_HZ,
        error_hz=0.0,
        slope_hz=FILTER_HZ,
        most=1.0,
        least_leak=1.0,
        leaks=False,
    )


def tune(
    vehicle: Linear,
    scale: Array,
    *,
    lean: tuple[float, float] = (0.0, 0.0),
    late: float = 0.0,
    held: bool = True,
    axes: Sequence[str] = COMMANDS,
) -> Tuning:
    """Return gains for a vehicle.

    Args:
        vehicle: from col, lon, lat, ped to p, q, r, phi, theta, psi, delays and servos in it.
        scale: (4, 4), of the autopilot's units; see `mixing.Controls`.
        lean: (phi, theta) of the hover, rad.
        late: s, by which commands act later than the model and the autopilot's ticks say.
        held: whether the autopilot's holding of commands is yet to be put into the model.
        axes: that are tuned, where the model knows them.

    Raises:
        InputError: no axis has both its command and its rate in the model, or an axis has no
            gains that keep the margins.
    """
    plant = Commanded(vehicle, scale, late, held, tuple(axes))
    axes = [name for name in plant.inputs if BY_NAME[name].angle in plant.outputs]
    if not axes:
        raise InputError(
            f"no axis can be tuned: the model goes from {', '.join(vehicle.inputs)} to "
            f"{', '.join(vehicle.outputs)}; a gain needs a command and its own rate, as lat and p"
        )
    if not set(ATTITUDES) <= set(plant.outputs):
        lean = (0.0, 0.0)  # which turns one attitude into another's rate
    steady = {axis: _holds(plant, axis) for axis in axes}
    found: dict[str, Gains] = {}
    for _ in range(_ROUNDS):
        before = dict(found)
        for axis in axes:
            others = {name: one for name, one in found.items() if name != axis}
            found[axis] = _best(plant, axis, others, steady[axis], lean)
        if found == before:
            break
    return Tuning(plant, found, lean, steady)


def _own(plant: Linear, axis: str, frequency: Array) -> Response:
    row, column = plant.outputs.index(axis_of(axis).rate or ""), plant.inputs.index(axis)
    return np.asarray(plant.response(frequency)[row, column])


def _holds(plant: Linear, axis: str) -> float:
    """Return the command in phase with a rate of 1 rad/s, as it swings slowly."""
    return float((1.0 / _own(plant, axis, np.array([_HOLDS])))[0].real)


def _best(
    plant: Commanded,
    axis: str,
    others: Mapping[str, Gains],
    holds: float,
    lean: tuple[float, float],
) -> Gains:
    """Return an axis's gains, the others given. Raises InputError."""
    unit = 1.0 / abs(_own(plant, axis, np.array([_TELLS]))[0])
    p, d, angle = (one.ravel() for one in np.meshgrid(_P * unit, _D * unit, _ANGLE))
    ff = max(0.0, holds)
    gains = [p, _CORNER * (ff + p), d, np.full_like(p, ff), angle]
    loops = _loops(plant, axis, others, gains, lean)
    clear = _clear(loops)
    if not np.any(clear):
        raise InputError(
            f"{axis_of(axis).word} has no gains with margins of {LEAST_GAIN:g} dB and "
            f"{np.degrees(LEAST_PHASE):.0f} degrees: its model answers too late, or with another "
            "sign than the autopilot's command has"
        )
    slow = _BAND <= _SLOW
    left = np.mean(np.log(np.abs(1.0 + loops[:, slow])), axis=1)
    best = int(np.argmax(np.where(clear, left, -np.inf)))
    return Gains(*(float(one[best]) for one in gains))


def _loops(
    plant: Commanded,
    axis: str,
    others: Mapping[str, Gains],
    gains: Sequence[Array],
    lean: tuple[float, float],
) -> Response:
    """Return an axis's loops, cut at its command, (n_gains, n_freq): they are linear in gains."""
    p, i, d, ff, angle = gains
    law = law_of(others, lean)
    moved = np.moveaxis(plant.response(_BAND), -1, 0)
    inputs = [law.inputs.index(name) for name in plant.outputs]
    rows = [COMMANDS.index(name) for name in plant.inputs]
    k = plant.inputs.index(axis)
    back = np.moveaxis(law.response(_BAND)[np.ix_(rows, inputs)], -1, 0)
    back[:, k] = 0.0
    closed = np.linalg.solve(np.eye(len(rows)) - back @ moved, np.eye(len(rows))[:, k])
    sensed = np.einsum("fyc,fc->fy", moved, closed)
    slow = np.array([name in RATES for name in plant.outputs])
    total = np.zeros((p.size, _BAND.size), dtype=np.complex128)
    for name, gain in zip(("p", "i", "d", "ff"), (p, i, d, ff)):
        one = Gains(**{**dict.fromkeys(Gains._fields, 0.0), name: 1.0, "angle": 1.0})
        own = law_of({axis: one}, lean).response(_BAND)[COMMANDS.index(axis), inputs].T
        by_rate, by_angle = ((own * sensed)[:, kind].sum(axis=1) for kind in (slow, ~slow))
        total -= gain[:, None] * (by_rate + angle[:, None] * by_angle)
    return total


def _clear(loops: Response) -> NDArray[np.bool_]:
    """Return which loops are stable with the margins that are asked for, (n_gains,).

    Above the hover's slow modes they must be as integrators of negative feedback are, above one.
    They must stay out of a box of the Nichols chart about -1: what is within it has too little of
    one margin or both. And they must not have passed it: at no gain above one is the phase beyond
    -180 degrees.
    """
    first = loops[:, int(np.argmax(_BAND >= _HOLDS))]
    begins = (first.imag < 0.0) & (np.abs(first) > 1.0)
    size = 20.0 * np.log10(np.maximum(np.abs(loops), _LEAST))
    behind = np.abs(np.angle(-loops))
    near = (np.abs(size) < LEAST_GAIN) & (behind < LEAST_PHASE)
    angle = np.unwrap(np.angle(loops), axis=1)
    slow = np.round((angle[:, :1] + 0.5 * np.pi) / (2.0 * np.pi)) * 2.0 * np.pi
    passed = ((angle - slow) < -np.pi) & (size > 0.0)
    peak = -20.0 * np.log10(np.abs(1.0 + loops).min(axis=1))
    return begins & ~np.any(near | passed, axis=1) & (peak < MOST_PEAK)
