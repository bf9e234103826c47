"""ArduCopter's gains for a helicopter, from a linear model: FF holds a rate, I is half of P.

P, D and the attitude's gain have the least mean of log |S| up to 3 rad/s within the margins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.errors import InputError
from helisim.base.linear import Linear, responses
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw, Rates
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import BY_NAME, axis_of
from helisim.records.record import ATTITUDES, IN1, RATES

LOOP_RATE = 400.0  # Hz, SCHED_LOOP_RATE
GYRO_HZ = 40.0  # Hz, INS_GYRO_FILTER: twice ArduPilot's default
FILTER_HZ = 20.0  # Hz, FLTT and FLTD
INPUT_TIME = 0.2  # s, ATC_INPUT_TC
# s, from a tick to its pulses: the next frame's, and the tail's a tick later.
_LATE = {"lat": 0.25e-3, "lon": 0.25e-3, "ped": 0.25e-3 + 1.0 / LOOP_RATE}
# dB, rad: above SAE AS94900's 6, 45 degrees; dB: below 5 (Tischler et al., AHS Forum 67, 2011).
LEAST_GAIN, LEAST_PHASE, MOST_PEAK = 8.0, np.radians(50.0), 4.5

# rad/s, at which the feed-forward is read: above the hover's slow modes, below the rotor's.
_HOLDS = 2.0
_BAND = np.geomspace(0.3, 200.0, 240)
_TELLS = 10.0  # rad/s, at which 1 / |rate over command| is the unit of P
_P = np.concatenate([np.linspace(0.0, 1.0, 11), np.linspace(1.2, 3.0, 10)])  # In that unit
_D = np.array([0.0, 0.005, 0.01, 0.02, 0.03, 0.05])  # s, in that unit
_ANGLE = np.linspace(1.0, 8.0, 29)  # 1/s
_CORNER = 0.5  # rad/s, of the integral
_SLOW = 3.0  # rad/s, up to which disturbances are rejected
_ROUNDS = 3
_LEAST = 1e-12


class Gains(NamedTuple):
    """One axis's P, I, D and FF, of full command over SI units, and attitude gain, 1/s."""

    p: float
    i: float
    d: float
    ff: float
    angle: float


@dataclass(frozen=True, eq=False)
class Commanded:
    """A vehicle, from col, lon, lat, ped, as the autopilot's commands move it; it is `Linear`.

    `scale`, (4, 4), is `mixing.command_scale`'s; commands act `late` s later, `held` for a tick.
    """

    vehicle: Linear
    scale: Real
    late: float = 0.0
    held: bool = True

    @property
    def inputs(self) -> tuple[str, ...]:
        """The commands that the vehicle's model has, in the autopilot's unit."""
        return tuple(name for name in COMMANDS if name in self.vehicle.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Rates and attitudes."""
        return tuple(name for name in (*RATES, *ATTITUDES) if name in self.vehicle.outputs)

    def response(self, frequency: Real) -> Complex:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        own = self.vehicle
        whole = own.response(frequency)[[own.outputs.index(name) for name in self.outputs]]
        by = [IN1.index(name) for name in own.inputs]
        to = [IN1.index(name) for name in self.inputs]
        moved = np.einsum("yuf,uc->ycf", whole, self.scale[np.ix_(by, to)])
        held = [0.5 / LOOP_RATE + _LATE[name] if self.held else 0.0 for name in self.inputs]
        late = self.late + np.array(held)
        return np.asarray(moved * np.exp(-1j * late[:, None] * np.asarray(frequency)))


class Tuning(NamedTuple):
    """Gains of all axes, their loops, and the command for 1 rad/s of each axis."""

    gains: Mapping[str, Gains]
    loop: ClosedLoop
    holds: Mapping[str, float]


def law_of(gains: Mapping[str, Gains], lean: tuple[float, float]) -> ArduCopterLaw:
    """Return ArduCopter's law with some gains, none on other axes, and `settings`' filters."""
    full = {axis: gains.get(axis, Gains(0.0, 0.0, 0.0, 0.0, 0.0)) for axis in COMMANDS}
    filters = {"d_ff": 0.0, "target_hz": FILTER_HZ, "error_hz": 0.0, "slope_hz": FILTER_HZ}
    return ArduCopterLaw(
        {
            axis: Rates(*one[:4], **filters, most=1.0, least_leak=1.0, leaks=False)
            for axis, one in full.items()
        },
        {axis: one.angle for axis, one in full.items()},
        1.0 / LOOP_RATE,
        gyro_hz=GYRO_HZ,
        input_time=INPUT_TIME,
        lean=lean,
    )


def tune(
    vehicle: Linear,
    scale: Real,
    *,
    lean: tuple[float, float] = (0.0, 0.0),
    late: float = 0.0,
    held: bool = True,
) -> Tuning:
    """Return gains for a vehicle from col, lon, lat, ped to p, q, r, phi, theta, psi.

    `scale`, (4, 4), is `mixing.command_scale`'s, `lean` phi and theta of the hover, rad. Commands
    act `late` s later than by the model and the ticks; `held` adds their holding to the model.
    Raises InputError if no gains keep an axis's margins.
    """
    plant = Commanded(vehicle, scale, late, held)
    axes = [name for name in plant.inputs if BY_NAME[name].angle in plant.outputs]
    if not axes:
        raise InputError(
            f"no axis can be tuned: the model goes from {', '.join(vehicle.inputs)} to "
            f"{', '.join(vehicle.outputs)}; a gain needs a command and its own rate, as lat and p"
        )
    if not set(ATTITUDES) <= set(plant.outputs):
        lean = (0.0, 0.0)  # a lean turns one attitude into another's rate
    steady = {axis: _holds(plant, axis) for axis in axes}
    found: dict[str, Gains] = {}
    for _ in range(_ROUNDS):
        before = dict(found)
        for axis in axes:
            others = {name: one for name, one in found.items() if name != axis}
            found[axis] = _best(plant, axis, others, steady[axis], lean)
        if found == before:
            break
    return Tuning(found, ClosedLoop(plant, law_of(found, lean), _BAND), steady)


def _own(plant: Linear, axis: str, frequency: Real) -> Complex:
    return responses(plant, frequency, [axis_of(axis).rate or ""], [axis])[0, 0]


def _holds(plant: Linear, axis: str) -> float:
    """Return the command in phase with a rate of 1 rad/s, in a slow swing."""
    return float((1.0 / _own(plant, axis, np.array([_HOLDS])))[0].real)


def _best(
    plant: Commanded,
    axis: str,
    others: Mapping[str, Gains],
    holds: float,
    lean: tuple[float, float],
) -> Gains:
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
    gains: Sequence[Real],
    lean: tuple[float, float],
) -> Complex:
    """Return an axis's loops, cut at its command, (n_gains, n_freq)."""

    def loop(**unit: float) -> Complex:
        one = Gains(**{**dict.fromkeys(Gains._fields, 0.0), **unit})
        return ClosedLoop(plant, law_of({**others, axis: one}, lean), _BAND).broken(axis).response

    *terms, angle = gains
    total = np.zeros((angle.size, _BAND.size), dtype=np.complex128)
    for name, gain in zip(Gains._fields, terms):  # each is linear in its gain
        by_rate = loop(**{name: 1.0})
        by_angle = loop(**{name: 1.0}, angle=1.0) - by_rate
        total += gain[:, None] * (by_rate + angle[:, None] * by_angle)
    return total


def _clear(loops: Complex) -> NDArray[np.bool_]:
    """Return which loops are stable with the margins, (n_gains,): outside a Nichols box at -1.

    The phase of a loop of more than 1 may rise through -180 degrees, past the hover's unstable
    modes, but not fall through it.
    """
    first = loops[:, int(np.argmax(_BAND >= _HOLDS))]
    begins = (first.imag < 0.0) & (np.abs(first) > 1.0)
    size = 20.0 * np.log10(np.maximum(np.abs(loops), _LEAST))
    near = (np.abs(size) < LEAST_GAIN) & (np.abs(np.angle(-loops)) < LEAST_PHASE)
    angle = np.unwrap(np.angle(loops), axis=1)
    fallen = np.diff(np.floor((angle + np.pi) / (2.0 * np.pi)), axis=1) < 0.0
    return (
        begins
        & ~np.any(near, axis=1)
        & ~np.any(fallen & (size[:, 1:] > 0.0), axis=1)
        & ((-20.0 * np.log10(np.abs(1.0 + loops).min(axis=1))) < MOST_PEAK)
    )
