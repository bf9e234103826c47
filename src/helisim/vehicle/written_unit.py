"""Units as people write them: a wrong one is met with what the value is in the right one."""

import math
import re
from collections import Counter
from dataclasses import dataclass

from helisim.base.units import METRE_PER_FOOT, RAD_PER_DEG, RAD_S_PER_RPM

_WATT = {"kg": 1, "m": 2, "s": -3}
_BASE: dict[str, tuple[float, dict[str, int]]] = {
    "1": (1.0, {}),
    "-": (1.0, {}),
    "%": (0.01, {}),
    "percent": (0.01, {}),
    "rad": (1.0, {"rad": 1}),
    "deg": (RAD_PER_DEG, {"rad": 1}),
    "degree": (RAD_PER_DEG, {"rad": 1}),
    "degrees": (RAD_PER_DEG, {"rad": 1}),
    "°": (RAD_PER_DEG, {"rad": 1}),
    "rpm": (RAD_S_PER_RPM, {"rad": 1, "s": -1}),
    "hz": (2.0 * math.pi, {"rad": 1, "s": -1}),
    "s": (1.0, {"s": 1}),
    "sec": (1.0, {"s": 1}),
    "ms": (1e-3, {"s": 1}),
    "us": (1e-6, {"s": 1}),
    "µs": (1e-6, {"s": 1}),
    "min": (60.0, {"s": 1}),
    "m": (1.0, {"m": 1}),
    "cm": (1e-2, {"m": 1}),
    "mm": (1e-3, {"m": 1}),
    "in": (METRE_PER_FOOT / 12.0, {"m": 1}),
    "inch": (METRE_PER_FOOT / 12.0, {"m": 1}),
    "ft": (METRE_PER_FOOT, {"m": 1}),
    "kg": (1.0, {"kg": 1}),
    "g": (1e-3, {"kg": 1}),
    "n": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "w": (1.0, _WATT),
    "kw": (1e3, _WATT),
    "hp": (745.7, _WATT),
    "a": (1.0, {"a": 1}),
    "v": (1.0, _WATT | {"a": -1}),
    "ohm": (1.0, _WATT | {"a": -2}),
    "ω": (1.0, _WATT | {"a": -2}),
    "mohm": (1e-3, _WATT | {"a": -2}),
    "mω": (1e-3, _WATT | {"a": -2}),
}
_GLUED = {"kgm": "kg m", "nm": "n m", "nmm": "n mm", "gm": "g m", "rads": "rad s"}
_FACTOR = re.compile(r"([a-zµ°%]+|1|-)(?:\^?(-?\d+))?")


@dataclass(frozen=True)
class WrittenUnit:
    """A unit that was written: one of it in SI, and the powers of what it is made of."""

    factor: float
    powers: tuple[tuple[str, int], ...]

    @classmethod
    def of(cls, text: str) -> "WrittenUnit | None":
        """Return the unit that a text such as "kg mm^2" or "N m/rad" means, None if none is."""
        plain = text.strip().lower().replace("²", "^2").replace("³", "^3").replace("μ", "µ")
        over, *under = re.sub(r"[*·⋅()]", " ", plain).split("/")
        factor, powers = 1.0, Counter[str]()
        for part, sign in ((over, 1), *((part, -1) for part in under)):
            for word in part.split():
                found = _FACTOR.fullmatch(word)
                if found is None:
                    return None
                names = _GLUED.get(found[1], found[1]).split()
                exponents = [*[1] * (len(names) - 1), int(found[2] or 1)]
                for name, exponent in zip(names, exponents):
                    if name not in _BASE:
                        return None
                    each, made_of = _BASE[name]
                    factor *= each ** (sign * exponent)
                    for what, power in made_of.items():
                        powers[what] += sign * exponent * power
        return cls(factor, tuple(sorted((what, n) for what, n in powers.items() if n)))


def unit_fault(unit: str, value: float, expected: str) -> str:
    """Return what is wrong with the unit of a value, and what to write; "" if nothing is.

    Args:
        unit: as it was written.
        value: in it.
        expected: the unit that is read.
    """
    if unit == expected:
        return ""
    written, wanted = WrittenUnit.of(unit), WrittenUnit.of(expected)
    if written is None or wanted is None or written.powers != wanted.powers:
        return f"is in {expected!r}, not in {unit!r}"
    factor = written.factor / wanted.factor
    if math.isclose(factor, 1.0, rel_tol=1e-12):
        return f"has its unit written {expected!r}, not {unit!r}"
    return (
        f"is in {expected!r}, not in {unit!r}: {value:g} {unit} are value = {value * factor:.6g}, "
        f'unit = "{expected}"'
    )
