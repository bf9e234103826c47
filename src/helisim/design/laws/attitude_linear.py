"""The attitude command law about a trim: its responses in closed form, and its matrices."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import LinearSystem
from helisim.base.value import Value
from helisim.design.laws import attitude_kernel as kernel
from helisim.design.laws.attitude_command import (
    AttitudeAxis,
    AttitudeCommand,
    YawAxis,
    command_model,
)
from helisim.design.laws.probe import probed
from helisim.records.channels import IN1

Response = NDArray[np.complex128]
_SEEN = ("p", "q", "r", "phi", "theta", "psi")
_STICKS = ("COL", "LON", "LAT", "PED")
_SENSED = {"lat": ("phi", "p"), "lon": ("theta", "q"), "ped": ("psi", "r")}
_OTHER = {"lat": "lon", "lon": "lat"}


@dataclass(frozen=True, eq=False)
class AttitudeLinear(Value):
    """An attitude command law at its ticks, linear.

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

    @property
    def sampled(self) -> LinearSystem:
        """The compiled law's matrices, without states that nothing moves, such as trims."""
        return self._sampled

    @cached_property
    def _sampled(self) -> LinearSystem:
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
