"""The weather of a flight: steady wind, Dryden turbulence after MIL-F-8785C, and a gust."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import Checked, check, setting
from helisim.base.units import METRE_PER_FOOT, METRE_S_PER_KNOT
from helisim.physics import air as law
from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses, write_named

LEVELS = {
    "light": 15.0 * METRE_S_PER_KNOT,
    "moderate": 30.0 * METRE_S_PER_KNOT,
    "severe": 45.0 * METRE_S_PER_KNOT,
}  # wind at 20 ft above the ground, m/s (MIL-F-8785C, section 3.7.3)
_LOWEST, _HIGHEST = 10.0 * METRE_PER_FOOT, 1000.0 * METRE_PER_FOOT  # m, of the low-altitude model
_STATES, _STILL = 8, 1e-6  # m/s: less wind is calm air
_STORM = 150.0  # m/s: the strongest winds of tornadoes; the filters' numbers stay in proportion


@dataclass(frozen=True, kw_only=True)
class Gust(Checked):
    """A discrete "1 - cosine" gust (MIL-F-8785C, section 3.7.1.3).

    `north`, `east` and `down` are the air's velocity at full strength, m/s. It begins at `start`,
    s, grows for `rise`, s, stays for `hold`, s, and dies as it grew.
    """

    north: float = setting(0.0, unit="m/s")
    east: float = setting(0.0, unit="m/s")
    down: float = setting(0.0, unit="m/s")
    start: float = setting(5.0, unit="s")
    rise: float = setting(1.0, unit="s", above=0.0)
    hold: float = setting(0.0, unit="s", low=0.0)


@dataclass(frozen=True)
class Dryden:
    """MIL-F-8785C's low-altitude Dryden model; rms, m/s, and lengths, m, are along, across, down.

    The frozen field drifts past at a speed, m/s; the heading, rad, is the path's through the air.
    """

    rms: tuple[float, float, float]
    lengths: tuple[float, float, float]
    speed: float
    heading: float

    def lags(self, span: float) -> NDArray[np.float64]:
        """Return the filters' lags in u, v, w and p, s, (4,)."""
        return np.array([*self.lengths, 4.0 * span / math.pi]) / self.speed

    def levels(self, span: float) -> NDArray[np.float64]:
        """Return the rms, (4,), that the noise of u, v, w, p would give a single lag."""
        along, across, down = self.rms
        length = self.lengths[2]
        power = 0.1 * math.pi**2 / (span * length) * (0.25 * math.pi * length / span) ** (1 / 3)
        half = math.sqrt(0.5)
        return np.array([along, half * across, half * down, down * math.sqrt(power)])

    def filters(self, span: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return A (8, 8) and B (8, 4) of x' = A x + B n for white noise n of unit intensity."""
        lags = self.lags(span)

        def rates(state_and_noise: NDArray[np.float64]) -> NDArray[np.float64]:
            written = np.empty(_STATES)
            law.turbulence_rates(*np.split(state_and_noise, [_STATES]), lags, written)
            return written

        a, b = np.hsplit(np.column_stack([*map(rates, np.eye(_STATES + 4))]), [_STATES])
        return a, b * self.levels(span) * np.sqrt(2.0 * lags)


@dataclass(frozen=True, kw_only=True)
class Weather:
    """Wind, turbulence and a gust, steady wind everywhere the same.

    `wind_from` is the heading, rad, that the wind comes from; flights head north, so 0 is a
    headwind. `turbulence` is "light", "moderate", "severe" or the wind at 20 ft that makes it, m/s.
    `rms`, m/s, along the path, across and down, replaces the standard's. `drift`, m/s, moves the
    frozen field past the vehicle; None: the speed through the air, but not below the wind at 20 ft.
    `height`, m, is that above the ground.
    """

    wind: float = setting(0.0, unit="m/s", low=0.0)
    wind_from: float = setting(0.0, unit="rad")
    turbulence: str | float | None = None
    rms: tuple[float, float, float] | None = setting(None, unit="m/s", above=0.0)
    drift: float | None = setting(None, unit="m/s", above=0.0)
    gust: Gust | None = None
    height: float = setting(20.0, unit="m", above=0.0)

    def __post_init__(self) -> None:
        check(self)
        if isinstance(self.turbulence, str) and self.turbulence not in LEVELS:
            raise UnknownNameError("turbulence", self.turbulence, LEVELS)
        if not 0.0 <= self.low_wind <= _STORM:
            raise InputError(
                f"turbulence must be a wind at 20 ft of 0 to {_STORM:g} m/s, or one of "
                f"{', '.join(LEVELS)}, got {self.turbulence!r}"
            )
        if self.rms is not None and self.turbulence is not None:
            raise InputError("turbulence and rms exclude each other: give one of them")
        if self.low_wind > 0.0 and not _LOWEST <= self.height <= _HIGHEST:
            raise InputError(
                f"the low-altitude turbulence of MIL-F-8785C holds from {_LOWEST:.2f} to "
                f"{_HIGHEST:.0f} m above the ground, got a height of {self.height:g} m"
            )

    @property
    def wind_to(self) -> tuple[float, float, float]:
        """Velocity of the steady wind towards north, east and down, m/s."""
        return -self.wind * math.cos(self.wind_from), -self.wind * math.sin(self.wind_from), 0.0

    @property
    def low_wind(self) -> float:
        """Wind at 20 ft that makes the turbulence, m/s; 0 without turbulence."""
        if self.rms is not None:
            return self.rms[2] / 0.1
        if isinstance(self.turbulence, str):
            return LEVELS[self.turbulence]
        return 0.0 if self.turbulence is None else float(self.turbulence)

    @property
    def dryden(self) -> Dryden | None:
        """The turbulence of a hover over the ground; None if calm."""
        if self.low_wind < _STILL:
            return None
        shape = 0.177 + 0.000823 * self.height / METRE_PER_FOOT
        down = 0.1 * self.low_wind
        level, long = down / shape**0.4, self.height / shape**1.2
        return Dryden(
            rms=self.rms or (level, level, down),
            lengths=(long, long, self.height),
            speed=max(self.wind, self.low_wind) if self.drift is None else self.drift,
            heading=self.wind_from if self.wind > 0.0 else 0.0,
        )

    def trimmed(self, vehicle: Vehicle) -> Vehicle:
        """Return a vehicle trimmed for the wind, and the ground if it is felt. Raises TrimError."""
        par = vehicle.model.actuator_user[addresses(vehicle.model).rotor]
        return (
            vehicle
            if self.wind == 0.0 and par[PARAM.ground_effect] == 0.0
            else vehicle.trimmed(height=self.height, wind=self.wind_to)
        )

    def write(self, par: NDArray[np.float64], vehicle: Vehicle, *, seed: int) -> None:
        """Put gust and turbulence into a vehicle's parameters (n_param,); MuJoCo has the wind."""
        if self.gust is not None:
            write_named(par, **{f"gust_{name}": one for name, one in vars(self.gust).items()})
        if (dryden := self.dryden) is None:
            return
        span = 2.0 * vehicle.parameters["main_rotor.radius"]
        write_named(
            par,
            turbulence_on=1.0,
            turbulence_seed=seed,
            turbulence_cosine=math.cos(dryden.heading),
            turbulence_sine=math.sin(dryden.heading),
            turbulence_span=span,
            turbulence_u=dryden.levels(span),
            turbulence_lag_u=dryden.lags(span),
        )

    def start(self, vehicle: Vehicle, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return a random stationary state of the turbulence, (8,)."""
        if self.dryden is None:
            return np.zeros(_STATES)
        a, b = self.dryden.filters(2.0 * vehicle.parameters["main_rotor.radius"])
        covariance = solve_continuous_lyapunov(a, -b @ b.T)
        return np.linalg.cholesky(covariance) @ rng.standard_normal(_STATES)
