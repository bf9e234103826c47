"""Weather that an environment draws anew for every episode."""

import math
from dataclasses import asdict, dataclass

import numpy as np

from helisim.base.errors import InputError
from helisim.base.settings import is_number
from helisim.sim import Gust, Weather


@dataclass(frozen=True, kw_only=True)
class WeatherRange:
    """The weathers of which each episode has one; every strength up to these is as likely.

    Attributes:
        wind: m/s, steady, from any direction.
        turbulence: m/s of wind at 20 ft above the ground, which makes it (see `Weather`).
        gust: m/s at its full strength, level, to any direction; it starts within the first
            `gust_within` seconds and rises in 0.5 to 2 s.
        gust_within: s.
        height: m above the ground, of the flight.
    """

    wind: float = 0.0
    turbulence: float = 0.0
    gust: float = 0.0
    gust_within: float = 8.0
    height: float = 20.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (is_number(value) and 0.0 <= value < math.inf):
                raise InputError(f"weather: {name} must be 0 or more, got {value!r}")
        Weather(turbulence=self.turbulence, height=self.height)  # which says if it can't be

    def draw(self, random: np.random.Generator) -> Weather:
        """Return one of the weathers."""
        wind, turbulence, gust, start, rise = random.uniform(size=5)
        wind_from, gust_to = random.uniform(-math.pi, math.pi, 2)
        blow = None
        if self.gust > 0.0:
            blow = Gust(
                north=gust * self.gust * math.cos(gust_to),
                east=gust * self.gust * math.sin(gust_to),
                start=start * self.gust_within,
                rise=0.5 + 1.5 * rise,
                hold=1.0,
            )
        return Weather(
            wind=wind * self.wind,
            wind_from=wind_from,
            turbulence=turbulence * self.turbulence,
            gust=blow,
            height=self.height,
        )
