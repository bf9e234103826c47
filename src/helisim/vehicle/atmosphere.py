"""The international standard atmosphere, as far up as helicopters fly."""

import math

from helisim.base.errors import InputError
from helisim.base.units import STANDARD_GRAVITY

_SEA_LEVEL_K = 288.15
_SEA_LEVEL_PA = 101325.0
_LAPSE_K_M = 0.0065
_GAS_CONSTANT = 287.05287
"""J/(kg K), of dry air."""
_EXPONENT = STANDARD_GRAVITY / (_LAPSE_K_M * _GAS_CONSTANT)
_TOP_M = 11000.0
_ZERO_CELSIUS_K = 273.15


def isa_density(altitude: float, *, temperature: float | None = None) -> float:
    """Return the density of the air, kg/m^3 (ISO 2533, troposphere).

    The parameter `air.density` takes it: `load(parameters={"air.density": isa_density(1500.0)})`.

    Args:
        altitude: pressure altitude, m above sea level.
        temperature: of the air, K; the standard atmosphere's if None.

    Raises:
        InputError: the altitude is outside the troposphere, or the temperature out of range.
    """
    if not (math.isfinite(altitude) and -500.0 <= altitude <= _TOP_M):
        raise InputError(f"altitude must be from -500 to {_TOP_M:g} m, got {altitude}")
    standard = _SEA_LEVEL_K - _LAPSE_K_M * altitude
    kelvin = standard if temperature is None else temperature
    if not 150.0 <= kelvin <= 350.0:
        raise InputError(
            f"temperature must be from 150 to 350 K, got {kelvin:g} K; "
            f"{_ZERO_CELSIUS_K:g} K is 0 degrees Celsius"
        )
    pressure = _SEA_LEVEL_PA * (standard / _SEA_LEVEL_K) ** _EXPONENT
    return pressure / (_GAS_CONSTANT * kelvin)
