"""Attitude command, attitude hold by explicit model following: a law as plain data.

Roll and pitch follow a second-order model of the attitude that the stick asks for, yaw a
first-order model of the rate, its heading held. An inverse of the aircraft goes ahead of the
feedback, so this only mends what the inverse misses: "explicit model following" with single-axis
inverse plants ("Multi-Input Multi-Output Model-Following Control Design Methods for Rotorcraft",
Journal of the American Helicopter Society 66, 2021, 032002).
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem, Response
from helisim.base.settings import Value, setting
from helisim.design.laws import attitude_kernel as kernel
from helisim.design.laws.attitude_kernel import ATTITUDE, GENERAL, HEAVE
from helisim.design.laws.law import (
    LIMIT,
    Filter,
    TabledLaw,
    not_negative,
    number,
    positive,
    probed,
    register,
)
from helisim.records.record import IN1
from helisim.vehicle.swashplate import as_it_is

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

_PLATE = slice(GENERAL.plate, GENERAL.plate + 21)


@dataclass(frozen=True, kw_only=True)
class AttitudeAxis:
    """Roll or pitch: an attitude is commanded and held.

    Attributes:
        stick: attitude that a whole stick asks for, rad.
        most: greatest attitude that can be asked for, from the trim's, rad.
        frequency: of the command model, rad/s.
        damping: of the command model, a ratio.
        k_angle: command over attitude, 1/rad.
        k_rate: command over rate, s/rad.
        k_integral: command over attitude's integral, 1/(rad s).
        k_angle_cross: command over the other axis's attitude, 1/rad.
        k_rate_cross: command over the other axis's rate, s/rad.
        ff_acceleration: command over the model's acceleration, s^2/rad.
        ff_rate: command over the model's rate, s/rad.
        ff_delay: by how much the model is late before attitude and rate are compared with it, s,
            in whole ticks: as late as the aircraft follows what goes ahead.
        limit: of the command, unitised.
        filters: of the feedback, but for the integral.
    """

    stick: float = number()
    frequency: float = positive()
    k_angle: float = number()
    k_rate: float = number()
    k_integral: float = number(0.0)
    damping: float = positive(1.0)
    most: float = positive(0.8)
    k_angle_cross: float = number(0.0)
    k_rate_cross: float = number(0.0)
    ff_acceleration: float = number(0.0)
    ff_rate: float = number(0.0)
    ff_delay: float = not_negative(0.0)
    limit: float = positive(LIMIT)
    filters: tuple[Filter, ...] = setting((), unsaid=True)


@dataclass(frozen=True, kw_only=True)
class YawAxis:
    """Yaw: a rate is commanded, and the heading held that it leads to.

    Attributes:
        stick: rate that a whole pedal asks for, rad/s.
        most: greatest rate that can be asked for, rad/s.
        frequency: of the command model, rad/s, of first order.
        k_angle: command over heading, 1/rad.
        k_rate: command over rate, s/rad.
        k_integral: command over heading's integral, 1/(rad s).
        ff_acceleration: command over the model's acceleration, s^2/rad.
        ff_rate: command over the model's rate, s/rad.
        ff_delay: by how much the model is late before heading and rate are compared with it, s.
        limit: of the command, unitised.
        filters: of the feedback, but for the integral.
    """

    stick: float = number()
    frequency: float = positive()
    k_angle: float = number()
    k_rate: float = number()
    k_integral: float = number(0.0)
    most: float = positive(10.0)
    ff_acceleration: float = number(0.0)
    ff_rate: float = number(0.0)
    ff_delay: float = not_negative(0.0)
    limit: float = positive(LIMIT)
    filters: tuple[Filter, ...] = setting((), unsaid=True)


@dataclass(frozen=True, kw_only=True)
class HeaveAxis:
    """Heave: the stick moves the collective, and climbs are damped if it says so.

    Attributes:
        stick: collective of a whole stick, unitised.
        k_velocity: collective over velocity down, by the specific force washed out, s/m.
        washout: time constant of the washout, s.
        to_ped: pedal command over the collective stick.
        limit: of the command, unitised.
    """

    stick: float = number(1.0)
    k_velocity: float = number(0.0)
    washout: float = positive(2.0)
    to_ped: float = number(0.0)
    limit: float = positive(LIMIT)


_SEEN = ("p", "q", "r", "phi", "theta", "psi")
_STICKS = ("COL", "LON", "LAT", "PED")
_SENSED = {"lat": ("phi", "p"), "lon": ("theta", "q"), "ped": ("psi", "r")}
_OTHER = {"lat": "lon", "lon": "lat"}
_MOST = 1000
_BLOCKS = {"lon": kernel.LON, "lat": kernel.LAT, "ped": kernel.PED}


@register
@dataclass(frozen=True, kw_only=True, repr=False)
class AttitudeCommand(TabledLaw):
    """Attitude command and attitude hold by explicit model following.

    Attributes:
        lat: roll.
        lon: pitch.
        ped: yaw.
        col: heave.
        phase: angle by which the pair (lat, lon) is turned to what the swashplate gets, rad: a
            rotor that follows late answers a command in one axis in the other too.
        delay: time that the law computes, s, in whole ticks.
        name: for messages and records; by itself the kind.
        provenance: how it was made, plain data.
    """

    kind: ClassVar[str] = "attitude_command"
    not_tuned: ClassVar[tuple[str, ...]] = ("most", "limit", "ff_delay", "delay")
    lat: AttitudeAxis
    lon: AttitudeAxis
    ped: YawAxis
    col: HeaveAxis = field(default_factory=HeaveAxis)
    phase: float = number(0.0)
    delay: float = not_negative(0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("lat", "lon", "ped"):
            count = len(getattr(self, name).filters)
            if count > kernel.MOST_FILTERS:
                raise InputError(
                    f"[{name}] has {count} filters, and at most {kernel.MOST_FILTERS} fly"
                )

    def linear(self, period: float) -> "AttitudeLinear":
        """Return what it does about a trim, at ticks that are a period (s) apart."""
        return AttitudeLinear(self, period)

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle, about its trim's attitude."""
        from helisim.vehicle import Controller

        numbers = vehicle.swashplate.numbers
        trim = vehicle.trim
        settings, states = self.numbers(vehicle.parameters["gyro.period"])
        settings[GENERAL.phi], settings[GENERAL.theta] = trim.phi, trim.theta
        settings[_PLATE] = numbers
        return Controller(
            kernel.COMPILED,
            states=states,
            settings=settings,
            name=self.name,
            written=self,
        )

    def numbers(self, period: float) -> tuple[NDArray[np.float64], int]:
        """Return the compiled law's settings, (n_settings,), and how many states it has.

        Of a swashplate that gives its commands as they are, about level flight.

        Args:
            period: s, of its ticks.
        """
        settings = np.zeros(kernel.SETTINGS)
        settings[GENERAL.period], settings[GENERAL.wait] = period, round(self.delay / period)
        settings[GENERAL.cosine], settings[GENERAL.sine] = (
            math.cos(self.phase),
            math.sin(self.phase),
        )
        settings[_PLATE] = as_it_is().numbers
        states = 0
        for name, first in _BLOCKS.items():
            axis = getattr(self, name)
            wait = round(axis.ff_delay / period)
            block = settings[first : first + len(ATTITUDE) - 1 + 5 * kernel.MOST_FILTERS]
            _fill(block, axis, period)
            block[ATTITUDE.state], block[ATTITUDE.wait] = states, wait
            states += kernel.axis_states(wait, len(axis.filters))
        share = -math.expm1(-period / self.col.washout)
        heave = settings[kernel.COL :]
        heave[HEAVE.state], heave[HEAVE.stick] = states, self.col.stick
        heave[HEAVE.k_velocity], heave[HEAVE.washout] = self.col.k_velocity, self.col.washout
        heave[HEAVE.share], heave[HEAVE.limit] = share, self.col.limit
        heave[HEAVE.to_ped] = self.col.to_ped
        settings[GENERAL.line] = states + kernel.HEAVE_STATES
        states += kernel.HEAVE_STATES + 4 * round(self.delay / period)
        if states > _MOST:
            raise InputError(
                f"with its delays the law keeps {states} numbers at ticks of {period:g} s, and at "
                f"most {_MOST} fly: make delay or ff_delay shorter"
            )
        if not np.all(np.isfinite(settings)):
            raise InputError(f"a number of the law is out of all proportion at {period:g} s")
        return settings, states


def command_model(axis: AttitudeAxis | YawAxis, period: float) -> tuple[NDArray[np.float64], ...]:
    """Return the command model's matrices over a period (s): (2, 2) of angle and rate, and (2,).

    What is wanted is held in between, so it is sampled exactly.
    """
    if isinstance(axis, YawAxis):
        w = axis.frequency
        left = math.exp(-w * period)
        reached = -math.expm1(-w * period) / w
        moved = np.array([[1.0, reached], [0.0, left]])
        return moved, np.array([period - reached, 1.0 - left])
    w, drop = axis.frequency, axis.damping * axis.frequency
    apart = (axis.damping**2 - 1.0) * (w * period) ** 2  # square of half the poles' difference
    root, fade = math.sqrt(abs(apart)), drop * period
    left = math.exp(-fade)
    if apart > 1.0:  # where its hyperbolic sine could overflow
        fast, slow = math.exp(-fade - root), math.exp(root - fade)
        even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / root
    elif apart >= 0.0:
        even, odd = left * math.cosh(root), left * (math.sinh(root) / root if root else 1.0)
    else:
        even, odd = left * math.cos(root), left * math.sin(root) / root
    turned = np.array([[drop, 1.0], [-(w**2), -drop]]) * period
    moved = even * np.eye(2) + odd * turned
    return moved, np.array([1.0 - moved[0, 0], -moved[1, 0]])


def _fill(block: NDArray[np.float64], axis: AttitudeAxis | YawAxis, period: float) -> None:
    """Write an axis's numbers into its block of the settings."""
    moved, by = command_model(axis, period)
    block[ATTITUDE.model_aa : ATTITUDE.model_bb + 1] = moved.ravel()
    block[ATTITUDE.model_a : ATTITUDE.model_b + 1] = by
    block[ATTITUDE.filters] = len(axis.filters)
    for name, value in vars(axis).items():
        if name in ATTITUDE._fields and name != "filters":
            block[getattr(ATTITUDE, name)] = value
    for k, one in enumerate(axis.filters):
        first = ATTITUDE.first_filter + 5 * k
        block[first : first + 5] = one.coefficients(period)


@dataclass(frozen=True, eq=False)
class AttitudeLinear(Value):
    """An attitude command law at its ticks, linear: its responses in closed form.

    Attributes:
        law: whose limits are not reached.
        period: s.
    """

    law: AttitudeCommand
    period: float

    @property
    def inputs(self) -> tuple[str, ...]:
        """What it sees, by the names of `Seen`."""
        return (*_SEEN, *(("az",) if self.law.col.k_velocity else ()), *_STICKS)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Its commands: col, lon, lat, ped."""
        return IN1

    def response(self, frequency: NDArray[np.float64]) -> Response:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        z = np.exp(1j * np.asarray(frequency, dtype=np.float64) * self.period)
        law, place = self.law, {name: k for k, name in enumerate(self.inputs)}
        rows = {name: np.zeros((len(place), z.size), dtype=np.complex128) for name in IN1}
        for name in _SENSED:
            for signal, value in _axis(law, name, z, self.period).items():
                rows[name][place[signal]] += value
        cosine, sine = np.cos(law.phase), np.sin(law.phase)
        lat, lon = rows["lat"], rows["lon"]
        rows["lat"], rows["lon"] = cosine * lat + sine * lon, -sine * lat + cosine * lon
        rows["ped"][place["COL"]] += law.col.to_ped
        rows["col"][place["COL"]] += law.col.stick
        if law.col.k_velocity:
            share = -np.expm1(-self.period / law.col.washout)
            slow = share / (z - 1.0 + share)
            rows["col"][place["az"]] += law.col.k_velocity * law.col.washout * slow * (1.0 - slow)
        return np.stack([rows[name] for name in IN1]) * z ** -round(law.delay / self.period)

    @cached_property
    def sampled(self) -> LinearSystem:
        """The compiled law's matrices, without states that nothing moves, such as trims."""
        settings, states = self.law.numbers(self.period)
        return probed(kernel.COMPILED, settings, states, self.period, self.inputs)


def _axis(law: AttitudeCommand, name: str, z: Response, period: float) -> dict[str, Response]:
    """Return an axis's command, before it is mixed, over what it sees, (n_freq,) each."""
    axis: AttitudeAxis | YawAxis = getattr(law, name)
    angle, rate = _SENSED[name]
    through = np.ones_like(z)
    for one in axis.filters:
        b0, b1, b2, a1, a2 = one.coefficients(period)
        through = through * (b0 + (b1 + b2 / z) / z) / (1.0 + (a1 + a2 / z) / z)
    integral = axis.k_integral * 0.5 * period * (z + 1.0) / (z - 1.0)
    back_angle, back_rate = through * axis.k_angle + integral, through * axis.k_rate
    modelled, late = _model(axis, z, period)
    given = {
        angle: -back_angle,
        rate: -back_rate,
        name.upper(): late * (back_angle * modelled[0] + back_rate * modelled[1])
        + (z - 1.0) / period * (axis.ff_rate * modelled[0] + axis.ff_acceleration * modelled[1]),
    }
    if isinstance(axis, AttitudeAxis) and (axis.k_angle_cross or axis.k_rate_cross):
        other = _OTHER[name]
        crossed, crossed_late = _model(getattr(law, other), z, period)
        over_angle, over_rate = through * axis.k_angle_cross, through * axis.k_rate_cross
        other_angle, other_rate = _SENSED[other]
        given |= {other_angle: -over_angle, other_rate: -over_rate}
        given[other.upper()] = crossed_late * (over_angle * crossed[0] + over_rate * crossed[1])
    return given


def _model(
    axis: AttitudeAxis | YawAxis, z: Response, period: float
) -> tuple[tuple[Response, Response], Response]:
    """Return a command model's angle and rate over its stick, and how it waits."""
    ((aa, ab), (ba, bb)), (a, b) = command_model(axis, period)
    ahead = (z - aa) * (z - bb) - ab * ba
    angle = axis.stick * ((z - bb) * a + ab * b) / ahead
    rate = axis.stick * ((z - aa) * b + ba * a) / ahead
    return (angle, rate), z ** -round(axis.ff_delay / period)
