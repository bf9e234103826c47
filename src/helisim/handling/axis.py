"""The axes of control: which stick asks for what, and which signals show it."""

from dataclasses import dataclass

from helisim.base.errors import UnknownNameError


@dataclass(frozen=True)
class Axis:
    """One axis of control.

    Attributes:
        name: of its servo command, IN1, by which it is called everywhere.
        word: what pilots call it.
        stick: IN2.
        angle: what is held and commanded, rad; of heave the velocity down, m/s.
        rate: its derivative, rad/s; of heave None.
    """

    name: str
    word: str
    stick: str
    angle: str
    rate: str | None


_ALL = (
    Axis("col", "heave", "COL", "w", None),
    Axis("lon", "pitch", "LON", "theta", "q"),
    Axis("lat", "roll", "LAT", "phi", "p"),
    Axis("ped", "yaw", "PED", "psi", "r"),
)
BY_NAME = {one.name: one for one in _ALL}
_BY_WORD = {one.word: one for one in _ALL}


def axis_of(name: str) -> Axis:
    """Return an axis by its command ("lat") or its word ("roll"). Raises UnknownNameError."""
    try:
        return BY_NAME.get(name) or _BY_WORD[name]
    except KeyError:
        raise UnknownNameError("axis", name, [*BY_NAME, *_BY_WORD]) from None
