"""Rate command, attitude hold: the law of `helisim.physics.gyro` as plain data."""

import math
from collections import namedtuple
from dataclasses import MISSING, dataclass, field
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import LinearSystem
from helisim.design.laws.law import Law, not_negative, number, positive, probed, register
from helisim.physics.gyro import CYCLIC, YAW, gyro_law, rotate, unmix
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.layout import NEVER, PARAM, SWASH_STATES, TAIL_STATES
from helisim.records.record import IN2, RATES
from helisim.vehicle.addresses import addresses, write_named
from helisim.vehicle.assembly import write_gyro_filters
from helisim.vehicle.swashplate import PLATE, as_it_is
from helisim.vehicle.trim import gyro_integrals

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

_STATES = SWASH_STATES + TAIL_STATES


Trimmed = namedtuple("Trimmed", "front left right tail p_integral q_integral r_integral")
"""Numbers behind the gyro's settings: servos in the trim, and the integrals that command it."""
known(Trimmed)

TRIMMED = len(PARAM)
SETTINGS = TRIMMED + len(Trimmed._fields)
_AT = Trimmed(*range(TRIMMED, SETTINGS))


@kernel()
def rate_start(seen, state, settings):
    """Begin with integrals that command where the servos stand, from those of the trim."""
    front, left = seen.front - settings[_AT.front], seen.left - settings[_AT.left]
    right, tail = seen.right - settings[_AT.right], seen.tail - settings[_AT.tail]
    _, lon, lat = unmix(settings, front, left, right, PARAM.mix_front_col)
    cosine, sine = settings[PARAM.gyro_phase_cosine], settings[PARAM.gyro_phase_sine]
    lat, lon = rotate(cosine, -sine, lat, lon)
    p_off, q_off = lat / settings[PARAM.gyro_ki_lat], lon / settings[PARAM.gyro_ki_lon]
    state[CYCLIC.p_integral] = settings[_AT.p_integral] + p_off
    state[CYCLIC.q_integral] = settings[_AT.q_integral] + q_off
    r_off = tail / settings[PARAM.gyro_k_i]
    state[SWASH_STATES + YAW.r_integral] = settings[_AT.r_integral] + r_off


COMPILED = KnownLaw(gyro_law, rate_start)


@dataclass(frozen=True, kw_only=True)
class RateAxis:
    """Roll or pitch: a whole stick, and the other axis's (`stick_cross`), ask for a rate, rad/s.

    Gains are over the rate's error, s/rad, its integral, 1/rad, and the rate's derivative, s^2/rad.
    """

    stick: float = number(MISSING)
    k_p: float = number(MISSING)
    k_i: float = positive(MISSING)
    k_d: float = number(0.0)
    stick_cross: float = number(0.0)


@dataclass(frozen=True, kw_only=True)
class YawRateAxis:
    """Yaw: ped = k_p e + k_i times e's integral, e = k_delta PED - k_a r, the rate led.

    `k_i` in 1/s, `k_a` in s/rad, lead and its filter's time constant in s; `heading_lock` 1
    integrates the error, which keeps the heading, 0 doesn't.
    """

    k_p: float = number(MISSING)
    k_i: float = positive(MISSING)
    k_delta: float = number(MISSING)
    k_a: float = number(MISSING)
    lead: float = not_negative(0.0)
    lead_filter: float = positive(0.0025)
    heading_lock: float = not_negative(1.0)


@dataclass(frozen=True, kw_only=True)
class CollectiveAxis:
    """Heave: collective of a whole stick, unitised."""

    stick: float = number(1.0)


_GAINS = {
    "collective": ("col", "stick"),
    "p_per_lat": ("lat", "stick"),
    "p_per_lon": ("lat", "stick_cross"),
    "q_per_lon": ("lon", "stick"),
    "q_per_lat": ("lon", "stick_cross"),
    **{f"k{one}_{axis}": (axis, f"k_{one}") for axis in ("lat", "lon") for one in "pid"},
    **{name: ("ped", name) for name in ("k_p", "k_i", "k_delta", "k_a", "lead", "heading_lock")},
}  # The gyro's number in `PARAM` -> an axis's table, and its key there


@register
@dataclass(frozen=True, kw_only=True, repr=False)
class RateCommand(Law):
    """Rate command, attitude hold, as the vehicles' gyros have it.

    Integrals and derivatives of (lat, lon) are turned by `phase`, rad, to the swashplate's; filters
    are time constants of low-passes, s; `attitude_lock` is a factor of the cyclic integrals:
    1 keeps the attitude.
    """

    kind: ClassVar[str] = "rate_command"
    not_tuned: ClassVar[tuple[str, ...]] = ("heading_lock", "attitude_lock")
    lat: RateAxis
    lon: RateAxis
    ped: YawRateAxis
    col: CollectiveAxis = field(default_factory=CollectiveAxis)
    phase: float = number(0.0)
    filter: float = positive(0.004)
    derivative_filter: float = positive(0.006)
    attitude_lock: float = not_negative(1.0)
    anti_windup: bool = True

    @classmethod
    def of(cls, vehicle: "Vehicle") -> Self:
        """Return the law of a vehicle's own gyro; it flies as that does, to the last bit."""
        own = vehicle.parameters
        par = vehicle.model.actuator_user[addresses(vehicle.model).rotor]

        axes: dict[str, dict[str, float]] = {"ped": {"lead_filter": own["gyro.lead_filter"]}}
        for slot, (axis, name) in _GAINS.items():
            axes.setdefault(axis, {})[name] = float(par[getattr(PARAM, f"gyro_{slot}")])
        return cls(
            lat=RateAxis(**axes["lat"]),
            lon=RateAxis(**axes["lon"]),
            ped=YawRateAxis(**axes["ped"]),
            col=CollectiveAxis(**axes["col"]),
            phase=own["gyro.phase"],
            filter=own["gyro.filter"],
            derivative_filter=own["gyro.derivative_filter"],
            attitude_lock=float(par[PARAM.gyro_attitude_lock]),
            anti_windup=float(par[PARAM.gyro_hold_above]) != NEVER,
            name=f"gyro of {vehicle.name}",
        )

    def linear(self, period: float) -> LinearSystem:
        """Return the law about a trim, at ticks that are a period (s) apart."""
        settings = self.numbers(period)
        settings[PLATE] = as_it_is().numbers
        return probed(COMPILED, settings, _STATES, period, (*RATES, *IN2))

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle."""
        settings = self.numbers(vehicle.parameters["gyro.period"])
        plate, trim = vehicle.swashplate, vehicle.trim
        settings[PLATE] = plate.numbers
        settings[TRIMMED:] = Trimmed(
            *plate.mix(trim.col, trim.lon, trim.lat), trim.ped, *gyro_integrals(settings, trim)
        )
        return self._flown(COMPILED, _STATES, settings)

    def numbers(self, period: float) -> NDArray[np.float64]:
        """Return the compiled law's settings at a period (s), (n_settings,), trim left out."""
        settings = np.zeros(SETTINGS)
        gains = {
            f"gyro_{slot}": getattr(getattr(self, axis), key)
            for slot, (axis, key) in _GAINS.items()
        }
        write_named(
            settings,
            gyro_period=period,
            gyro_attitude_lock=self.attitude_lock,
            gyro_hold_above=0.5 if self.anti_windup else NEVER,
            gyro_phase_cosine=(math.cos(self.phase), math.sin(self.phase)),
            **gains,
        )
        write_gyro_filters(
            settings,
            period=period,
            lead=self.ped.lead_filter,
            fast=self.filter,
            slow=self.derivative_filter,
        )
        return settings
