"""What is known of the flights that a response or a model is of: full commands, and the hover."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean

import numpy as np

from helisim.base.settings import Checked, from_plain, setting
from helisim.records.record import IN1, IN2, FlightRecord

FACTS: Mapping[str, str] = {
    "rotor_speed": "rotor speed",
    "hover": "hover collective",
    "lean": "hover lean",
    "wind": "wind",
}
"""What flights say besides full travel, and its words."""
_OURS = {name: 1.0 if name.lower() == "col" else 0.5 for name in (*IN1, *IN2)}
_UNSAID = "its records don't say"


@dataclass(frozen=True)
class Conditions(Checked):
    """Full travel of the commands, and the hover; None, or left out, where it is unknown.

    Attributes:
        full: command -> its value at full travel from the middle (collective: from the lowest), in
            the unit of its channel.
        rotor_speed: rad/s.
        hover: collective, a share of its range from 0 to 1.
        lean: bank, rad, to the right.
        wind: m/s, of which the derivatives by speeds are.
        known_by: name in `FACTS`, or "full" -> where it is from, or why it is unknown.
    """

    full: Mapping[str, float] = setting(factory=dict, above=0.0)
    rotor_speed: float | None = setting(None, unit="rad/s", above=0.0)
    hover: float | None = setting(None, low=0.0, high=1.0)
    lean: float | None = setting(None, unit="rad")
    wind: float | None = setting(None, unit="m/s", low=0.0)
    known_by: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, records: Sequence[FlightRecord]) -> "Conditions":
        """Return the mean of what records say, and the full travel that they agree on."""
        found = [_of_one(record) for record in records]
        known = {
            name: [x for one in found if (x := getattr(one, name)) is not None] for name in FACTS
        }
        values = {name: fmean(of) for name, of in known.items() if of}
        said = {
            name: text
            for one in reversed(found)
            for name, text in one.known_by.items()
            if name not in values or getattr(one, name) is not None
        }
        full = [one.full for one in found]
        agreed = {n: x for n, x in full[0].items() if all(one.get(n) == x for one in full)}
        return cls(full=agreed, known_by=said, **values)

    def why(self, name: str) -> str:
        """Return where a fact, or "full", is from, or why it is unknown."""
        return self.known_by.get(name, _UNSAID)

    def words(self, name: str) -> str:
        """Return a fact and where it is from in words, such as "hover lean 4.1 deg (...)"."""
        value = getattr(self, name)
        if value is None:
            return f"{FACTS[name]} unknown ({self.why(name)})"
        shown = {
            "rotor_speed": f"{value:.5g} rad/s",
            "hover": f"{value:.3g} of its range",
            "lean": f"{math.degrees(value):.3g} deg",
            "wind": f"{value:.2g} m/s",
        }
        return f"{FACTS[name]} {shown[name]} ({self.why(name)})"

    def __str__(self) -> str:
        full = ", ".join(f"{name} {value:g}" for name, value in self.full.items()) or "unknown"
        return "; ".join([f"full travel {full} ({self.why('full')})", *map(self.words, FACTS)])


def _of_one(record: FlightRecord) -> Conditions:
    facts = record.provenance
    if "conditions" in facts:
        return from_plain(Conditions, facts["conditions"], "the record's conditions")
    if "model_digest" not in facts:
        return Conditions()
    middle = {n: float(np.median(record[n])) for n in ("rotor_speed", "col", "phi") if n in record}
    nominal = facts.get("parameters", {}).get("main_rotor.speed")
    measured = "rotor_speed" in middle
    values = {
        "rotor_speed": middle.get("rotor_speed", nominal),
        "hover": min(max(middle["col"] + 0.5, 0.0), 1.0) if "col" in middle else None,
        "lean": middle.get("phi"),
        "wind": facts["weather"].get("wind", 0.0) if "weather" in facts else None,
    }
    said = {
        "rotor_speed": "rotor_speed, median" if measured else "the vehicle's main_rotor.speed",
        "hover": "col, median",
        "lean": "phi, median",
        "wind": "the flight's weather",
    }
    known = {name: text for name, text in said.items() if values[name] is not None}
    return Conditions(full=_OURS, known_by={"full": "helisim's own record", **known}, **values)
