"""Attitude command, attitude hold by explicit model following: a law as plain data.

With single-axis inverse plants: "Multi-Input Multi-Output Model-Following Control Design Methods
for Rotorcraft", Journal of the American Helicopter Society 66, 2021, 032002.
"""

import math
from dataclasses import MISSING, dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.base.settings import setting
from helisim.design.laws.attitude_kernel import (
    ATTITUDE,
    COL,
    COMPILED,
    FILTERED,
    GENERAL,
    LAT,
    LON,
    MOST_FILTERS,
    PED,
    SETTINGS,
)
from helisim.design.laws.law import (
    LIMIT,
    Law,
    Lead,
    number,
    positive,
    probed,
    register,
)
from helisim.records.record import ATTITUDES, IN2, RATES
from helisim.vehicle.swashplate import as_it_is

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle


@dataclass(frozen=True, kw_only=True)
class YawAxis:
    """Yaw: a rate is commanded, and the heading held that it leads to.

    Gains are commands, unitised, over angle, 1/rad, rate, s/rad, integral, 1/(rad s), acceleration,
    s^2/rad; `ff`: of the command model, of first order and of `frequency`, rad/s. A whole `stick`
    and the greatest rate asked for, `most`, are in rad/s; `limit` is of the command, unitised;
    `filters` are of the feedback but for the integral.
    """

    stick: float = number(MISSING)
    frequency: float = positive(MISSING)
    k_angle: float = number(MISSING)
    k_rate: float = number(MISSING)
    k_integral: float = number(0.0)
    most: float = positive(10.0)
    ff_acceleration: float = number(0.0)
    ff_rate: float = number(0.0)
    limit: float = positive(LIMIT)
    filters: tuple[Lead, ...] = setting((), unsaid=True)


@dataclass(frozen=True, kw_only=True)
class AttitudeAxis(YawAxis):
    """Roll or pitch: an attitude is commanded and held.

    As `YawAxis`, but `stick` and `most` in rad from the trim's attitude, and a command model of
    second order; `cross` are gains of the other axis's errors.
    """

    most: float = positive(0.8)
    damping: float = positive(1.0)
    k_angle_cross: float = number(0.0)
    k_rate_cross: float = number(0.0)


@dataclass(frozen=True, kw_only=True)
class HeaveAxis:
    """Heave: the stick moves the collective; whole stick and limit, unitised."""

    stick: float = number(1.0)
    limit: float = positive(LIMIT)


_BLOCKS = {"lon": LON, "lat": LAT, "ped": PED}
_MODEL = ATTITUDE._fields[ATTITUDE.model_aa : ATTITUDE.model_b + 1]


@register
@dataclass(frozen=True, kw_only=True, repr=False)
class AttitudeCommand(Law):
    """Attitude command and hold; (lat, lon) is turned by `phase`, rad, to the swashplate's pair."""

    kind: ClassVar[str] = "attitude_command"
    not_tuned: ClassVar[tuple[str, ...]] = ("most", "limit")
    lat: AttitudeAxis
    lon: AttitudeAxis
    ped: YawAxis
    col: HeaveAxis = field(default_factory=HeaveAxis)
    phase: float = number(0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in _BLOCKS:
            count = len(getattr(self, name).filters)
            if count > MOST_FILTERS:
                raise InputError(f"[{name}] has {count} filters, and at most {MOST_FILTERS} fly")

    def linear(self, period: float) -> LinearSystem:
        """Return the law about a trim, at ticks that are a period (s) apart."""
        settings, states = self.numbers(period)
        return probed(COMPILED, settings, states, period, (*RATES, *ATTITUDES, *IN2))

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle, about its trim's attitude."""
        settings, states = self.numbers(vehicle.parameters["gyro.period"])
        settings[GENERAL.phi], settings[GENERAL.theta] = vehicle.trim.phi, vehicle.trim.theta
        settings[GENERAL.plate : LON] = vehicle.swashplate.numbers
        return self._flown(COMPILED, states, settings)

    def numbers(self, period: float) -> tuple[NDArray[np.float64], int]:
        """Return settings at a period (s), (n_settings,), trim left out, and count of states."""
        settings = np.zeros(SETTINGS)
        settings[: GENERAL.plate] = [  # in the order of `General`; no trim
            *(period, 0.0, 0.0, math.cos(self.phase), math.sin(self.phase)),
            *(self.col.stick, self.col.limit),
        ]
        settings[GENERAL.plate : LON] = as_it_is().numbers
        states = COL + 1
        for name, first in _BLOCKS.items():
            axis = getattr(self, name)
            moved, by = command_model(axis, period)
            known = {**vars(axis), "state": states, "filters": len(axis.filters)}
            known |= zip(_MODEL, (*moved.ravel(), *by))
            block = [known.get(key, 0.0) for key in ATTITUDE._fields[: ATTITUDE.first_filter]]
            block += [number for one in axis.filters for number in one.coefficients(period)]
            settings[first : first + len(block)] = block
            states += FILTERED + len(axis.filters)
        if not np.all(np.isfinite(settings)):
            raise InputError(f"a number of the law is out of all proportion at {period:g} s")
        return settings, states


def command_model(axis: YawAxis, period: float) -> tuple[NDArray[np.float64], ...]:
    """Return the command model over a period (s): (2, 2) of angle and rate, and (2,)."""
    w = axis.frequency
    if not isinstance(axis, AttitudeAxis):
        left = math.exp(-w * period)
        reached = -math.expm1(-w * period) / w
        moved = np.array([[1.0, reached], [0.0, left]])
        return moved, np.array([period - reached, 1.0 - left])
    drop = axis.damping * w
    apart = (axis.damping**2 - 1.0) * (w * period) ** 2  # square of half the poles' difference
    root, fade = math.sqrt(abs(apart)), drop * period
    left, even, odd = (  # cosh and sinh leave their factor e^root, which may be large, to `left`
        (math.exp(root - fade), 0.5 + 0.5 * math.exp(-2.0 * root), -0.5 * math.expm1(-2.0 * root))
        if apart >= 0.0
        else (math.exp(-fade), math.cos(root), math.sin(root))
    )
    turned = np.array([[drop, 1.0], [-(w**2), -drop]]) * period
    moved = left * even * np.eye(2) + left * (odd / root if root else 1.0) * turned
    return moved, np.array([1.0 - moved[0, 0], -moved[1, 0]])
