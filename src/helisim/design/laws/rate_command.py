"""Rate command, attitude hold: the law of the gyros that the vehicles come with, as plain data.

Its laws are those of `helisim.physics.gyro`, with numbers of its own: one made by `of` a vehicle
flies as that does, to the last bit.
"""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import LinearSystem
from helisim.design.laws.law import TabledLaw, not_negative, number, positive, probed, register
from helisim.physics.gyro import CYCLIC, YAW, gyro_law, rotate, unmix
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.layout import NEVER, PARAM, SWASH_STATES, TAIL_STATES
from helisim.records.record import IN2, RATES
from helisim.vehicle.assembly import write_gyro_filters
from helisim.vehicle.swashplate import as_it_is
from helisim.vehicle.trim import addresses, gyro_integrals

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

_STATES = SWASH_STATES + TAIL_STATES


@known
class Trimmed(NamedTuple):
    """Behind the gyro's settings: servos in the trim, and the integrals that command it."""

    front: float
    left: float
    right: float
    tail: float
    p_integral: float
    q_integral: float
    r_integral: float


TRIMMED = len(PARAM)
"""Where it stands in the settings."""
SETTINGS = TRIMMED + len(Trimmed._fields)
_AT = Trimmed(*range(TRIMMED, SETTINGS))


@kernel()
def rate_start(seen, state, settings):
    """Begin with integrals that command where the servos stand; in the trim, to the last bit."""
    trimmed = seen.front == settings[_AT.front] and seen.left == settings[_AT.left]
    trimmed = trimmed and seen.right == settings[_AT.right] and seen.tail == settings[_AT.tail]
    if trimmed:
        state[CYCLIC.p_integral] = settings[_AT.p_integral]
        state[CYCLIC.q_integral] = settings[_AT.q_integral]
        state[SWASH_STATES + YAW.r_integral] = settings[_AT.r_integral]
        return
    _, lon, lat = unmix(settings, seen.front, seen.left, seen.right, PARAM.mix_front_col)
    cosine, sine = settings[PARAM.gyro_phase_cosine], settings[PARAM.gyro_phase_sine]
    lat, lon = rotate(cosine, -sine, lat, lon)
    state[CYCLIC.p_integral] = lat / settings[PARAM.gyro_ki_lat]
    state[CYCLIC.q_integral] = lon / settings[PARAM.gyro_ki_lon]
    state[SWASH_STATES + YAW.r_integral] = seen.tail / settings[PARAM.gyro_k_i]


COMPILED = KnownLaw(gyro_law, rate_start)


@dataclass(frozen=True, kw_only=True)
class RateAxis:
    """Roll or pitch: a rate is commanded.

    Attributes:
        stick: rate that a whole stick asks for, rad/s.
        stick_cross: rate that the other axis's whole stick asks for, rad/s.
        k_p: command over the rate's error, s/rad.
        k_i: command over its integral, 1/rad.
        k_d: command over the rate's derivative, s^2/rad.
    """

    stick: float = number()
    k_p: float = number()
    k_i: float = positive()
    k_d: float = number(0.0)
    stick_cross: float = number(0.0)


@dataclass(frozen=True, kw_only=True)
class YawRateAxis:
    """Yaw: ped = k_p e + k_i times e's integral, e = k_delta PED - k_a r, the rate led.

    Attributes:
        k_p: command over the error.
        k_i: command over its integral, 1/s.
        k_delta: gain of the pedals.
        k_a: gain of the rate, s/rad.
        lead: of the rate, s.
        lead_filter: time constant that makes the lead proper, s.
        heading_lock: 1 integrates the error, which keeps the heading; 0 doesn't.
    """

    k_p: float = number()
    k_i: float = positive()
    k_delta: float = number()
    k_a: float = number()
    lead: float = not_negative(0.0)
    lead_filter: float = positive(0.0025)
    heading_lock: float = not_negative(1.0)


@dataclass(frozen=True, kw_only=True)
class CollectiveAxis:
    """Heave: the stick moves the collective.

    Attributes:
        stick: collective of a whole stick, unitised.
    """

    stick: float = number(1.0)


@register
@dataclass(frozen=True, kw_only=True, repr=False)
class RateCommand(TabledLaw):
    """Rate command, attitude hold, as the vehicles' gyros have it.

    Attributes:
        lat: roll.
        lon: pitch.
        ped: yaw.
        col: heave.
        phase: angle by which integrals and derivatives of (lat, lon) are turned to what the
            swashplate gets, rad.
        filter: time constant of the low-pass of the cyclic rates, s.
        derivative_filter: of that of their derivatives, s.
        attitude_lock: by which the cyclic integrals are multiplied: 1 keeps the attitude.
        anti_windup: whether an integral stands still while its command is at its limit.
        name: for messages and records; by itself the kind.
        provenance: how it was made, plain data.
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
        """Return the law of a vehicle's own gyro, as it is set."""
        own = vehicle.parameters
        par = vehicle.model.actuator_user[addresses(vehicle.model).rotor]

        def number(name: str) -> float:
            return float(par[getattr(PARAM, f"gyro_{name}")])

        def axis(rate: str, stick: str, other: str) -> RateAxis:
            gains = {f"k_{one}": number(f"k{one}_{stick}") for one in "pid"}
            across = number(f"{rate}_per_{other}")
            return RateAxis(stick=number(f"{rate}_per_{stick}"), stick_cross=across, **gains)

        return cls(
            lat=axis("p", "lat", "lon"),
            lon=axis("q", "lon", "lat"),
            ped=YawRateAxis(
                **{name: number(name) for name in ("k_p", "k_i", "k_delta", "k_a", "lead")},
                lead_filter=own["gyro.lead_filter"],
                heading_lock=number("heading_lock"),
            ),
            col=CollectiveAxis(stick=number("collective")),
            phase=own["gyro.phase"],
            filter=own["gyro.filter"],
            derivative_filter=own["gyro.derivative_filter"],
            attitude_lock=number("attitude_lock"),
            anti_windup=number("hold_above") != NEVER,
            name=f"gyro of {vehicle.name}",
        )

    def linear(self, period: float) -> LinearSystem:
        """Return what it does about a trim, at ticks that are a period (s) apart."""
        settings = self.numbers(period)
        as_it_is().write(settings)
        return probed(COMPILED, settings, _STATES, period, (*RATES, *IN2))

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle."""
        from helisim.vehicle import Controller

        settings = self.numbers(vehicle.parameters["gyro.period"])
        plate, trim = vehicle.swashplate, vehicle.trim
        plate.write(settings)
        settings[TRIMMED:] = Trimmed(
            *plate.mix(trim.col, trim.lon, trim.lat), trim.ped, *gyro_integrals(settings, trim)
        )
        return Controller(COMPILED, states=_STATES, settings=settings, name=self.name, written=self)

    def numbers(self, period: float) -> NDArray[np.float64]:
        """Return the compiled law's settings, (n_settings,), but for swashplate and trim.

        Args:
            period: s, of its ticks.
        """
        settings = np.zeros(SETTINGS)
        by_slot = {
            "period": period,
            "heading_lock": self.ped.heading_lock,
            "attitude_lock": self.attitude_lock,
            "collective": self.col.stick,
            "hold_above": 0.5 if self.anti_windup else NEVER,
            "phase_cosine": math.cos(self.phase),
            "phase_sine": math.sin(self.phase),
            "p_per_lat": self.lat.stick,
            "p_per_lon": self.lat.stick_cross,
            "q_per_lon": self.lon.stick,
            "q_per_lat": self.lon.stick_cross,
        }
        by_slot |= {name: getattr(self.ped, name) for name in _YAW}
        for stick in ("lat", "lon"):
            by_slot |= {
                f"k{one}_{stick}": getattr(getattr(self, stick), f"k_{one}") for one in "pid"
            }
        for name, value in by_slot.items():
            settings[getattr(PARAM, f"gyro_{name}")] = value
        write_gyro_filters(
            settings,
            period=period,
            lead=self.ped.lead_filter,
            fast=self.filter,
            slow=self.derivative_filter,
        )
        return settings


_YAW = ("k_p", "k_i", "k_delta", "k_a", "lead")
