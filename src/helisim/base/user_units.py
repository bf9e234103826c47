"""Units that people read results in: angles, lengths and control in theirs, SI inside.

A unit is taken apart into powers of its parts, "rad/(s m)" into rad^1 s^-1 m^-1, and put together
again with others. Frequencies stay in rad/s: they are no angular rates of a body.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from helisim.base.errors import InputError
from helisim.base.units import METRE_PER_FOOT, RAD_PER_DEG

CONTROL = "1 of range"
"""The part of a unit that counts control: 1 is the whole range of an input that is unitised."""

_CHOICES: Mapping[str, tuple[str, str, float]] = {
    "rad": ("rad", "rad", 1.0),
    "deg": ("rad", "deg", 1.0 / RAD_PER_DEG),
    "m": ("m", "m", 1.0),
    "ft": ("m", "ft", 1.0 / METRE_PER_FOOT),
    "1": (CONTROL, "1", 1.0),
    "percent": (CONTROL, "%", 100.0),
}
"""Choice -> the part that it stands for, how it is written, and how many of it are one in SI."""

_PART = re.compile(r"([A-Za-z%]+)(?:\^(-?\d+))?")

Powers = dict[str, int]
"""Part of a unit -> its power; empty for a pure number."""


@dataclass(frozen=True)
class UserUnits:
    """Which units to show results in; see `UserUnits.of`.

    Attributes:
        chosen: part in SI -> how it is written, and how many of it are one in SI.
    """

    chosen: tuple[tuple[str, str, float], ...]

    @classmethod
    def of(cls, text: str) -> "UserUnits":
        """Return the units that a list such as "deg,ft,percent" chooses; the others stay SI.

        Raises:
            InputError: an unknown unit, or two for the same.
        """
        chosen = {}
        for name in filter(None, (one.strip() for one in text.split(","))):
            if name not in _CHOICES:
                raise InputError(f"results can't be in {name!r}; available: {', '.join(_CHOICES)}")
            part, *rest = _CHOICES[name]
            if part in chosen:
                raise InputError(f"{name!r} is a second unit of the same as {chosen[part][0]!r}")
            chosen[part] = rest
        return cls(tuple((part, label, factor) for part, (label, factor) in chosen.items()))

    def shown(self, powers: Powers) -> tuple[str, float]:
        """Return how a unit is written, and how many of it are one in SI."""
        labels = {part: (label, factor) for part, label, factor in self.chosen}
        factor, written = 1.0, {}
        for part, power in powers.items():
            label, many = labels.get(part, ("" if part == CONTROL else part, 1.0))
            factor *= many**power
            if label not in ("", "1"):
                written[label] = power
        return unit_text(written), factor

    def of_signal(self, unit: str, *, control: bool) -> tuple[str, float]:
        """Return how a channel's unit is written, and how many of it are one in SI.

        Args:
            unit: SI, such as "rad/s"; one that can't be taken apart stays as it is.
            control: a unit of "1" counts a control's range.
        """
        powers = parts(unit)
        if powers is None or (not powers and not control):
            return unit, 1.0
        label, factor = self.shown(powers or {CONTROL: 1})
        return label or unit, factor


def parts(unit: str) -> Powers | None:
    """Return the powers of a unit's parts, such as {"rad": 1, "s": -1}; None if it has none."""
    above, _, below = unit.strip().partition("/")
    powers: Powers = {}
    for text, sign in ((above, 1), (below.strip("()"), -1)):
        for word in text.split():
            match = _PART.fullmatch(word)
            if word == "SI" or (match is None and not (word == "1" and sign == 1)):
                return None
            if match is not None:
                power = powers.get(match[1], 0) + sign * int(match[2] or 1)
                powers[match[1]] = power
    return {part: power for part, power in powers.items() if power} if unit.strip() else None


def unit_text(powers: Powers) -> str:
    """Return a unit of such powers as it is written: "deg/(s^2 %)", and "1" for none."""

    def words(sign: int) -> list[str]:
        return [
            part if abs(power) == 1 else f"{part}^{abs(power)}"
            for part, power in powers.items()
            if power * sign > 0
        ]

    above, below = words(1), words(-1)
    if not below:
        return " ".join(above) or "1"
    under = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{under}"
