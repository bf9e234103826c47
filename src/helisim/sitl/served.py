"""What a backend has served: how far it flew, and what went wrong on the way to the autopilot."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Served:
    """The frames of an autopilot, as they came.

    Attributes:
        frames: that were flown.
        seconds: that were flown, all starts of the autopilot together, s.
        clock: that it took from the first frame to the last, s.
        starts: of the autopilot.
        answers: that were sent.
        repeated: frames that came again, answered with the same bytes.
        dropped: frames that never came.
        late: frames that came after their successor, not answered.
        ahead: frames without an answer of their own, as the autopilot was ahead of its answers.
        cut: packets of which a part was missing.
        strangers: packets of others than the autopilot.
        silences: how often no frame came for seconds.
    """

    frames: int = 0
    seconds: float = 0.0
    clock: float = 0.0
    starts: int = 0
    answers: int = 0
    repeated: int = 0
    dropped: int = 0
    late: int = 0
    ahead: int = 0
    cut: int = 0
    strangers: int = 0
    silences: int = 0

    @property
    def factor(self) -> float:
        """How many times real time it flew."""
        return self.seconds / self.clock if self.clock > 0.0 else 0.0

    def __str__(self) -> str:
        flown = (
            f"{self.seconds:.1f} s in {self.clock:.3g} s, {self.factor:.2g} times real time, "
            f"{self.frames} frames"
        )
        trouble = ((getattr(self, name), what) for name, what in _TROUBLE.items())
        seen = [what.format(number) for number, what in trouble if number]
        again = [f"{self.starts} starts of the autopilot"] if self.starts > 1 else []
        return "; ".join([flown, ", ".join([*again, *seen]) or "none lost, none repeated"])


_TROUBLE = {
    "repeated": "{} came again and got the same answer",
    "dropped": "{} never came",
    "late": "{} came late",
    "ahead": "{} came before the answer of the one before",
    "cut": "{} packets cut short",
    "strangers": "{} packets of others",
    "silences": "silent for seconds: {}",
}
"""Attribute -> how it is said."""
