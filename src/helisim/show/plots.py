"""Figures of verifications, flights and trims.

Data come first and wide, lines that explain them thin and on top, words outside: nothing hides
what was measured. Hz and degrees are for people; the value objects stay in rad/s and rad.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.ident import Verification
from helisim.records.channels import (
    ACCELERATIONS,
    AIR,
    ATTITUDES,
    CHANNELS,
    IN1,
    IN2,
    POSITIONS,
    RATES,
    ROTOR,
    ROTOR_SPEED,
    SERVO_POSITIONS,
    SERVOS,
    VELOCITIES,
)
from helisim.records.record import FlightRecord
from helisim.show.figure import Ink, Mark, Panel, less
from helisim.show.svg import Drawing

if TYPE_CHECKING:
    from helisim.sim import Excitation
    from helisim.vehicle import Vehicle

_FAMILIES = {
    "controls": IN1,
    "sticks": IN2,
    "servos": SERVOS,
    "rates": RATES,
    "attitude": ATTITUDES,
    "velocity": VELOCITIES,
    "specific force": ACCELERATIONS,
    "position": POSITIONS,
    "rotor": ROTOR,
    "rotor speed": ROTOR_SPEED,
    "air": AIR,
    "servo positions": SERVO_POSITIONS,
}
"""Channels that are looked at together."""
_UNITISED = ("controls", "sticks", "servos", "servo positions")
_INKS: tuple[Ink, ...] = ("identified", "data", "third", "fourth")
_INSTANTS = 3001
"""Of a manoeuvre that is drawn: more than a figure has columns."""


def draw_verification(name: str, verification: Verification, trace: int, flight: str) -> Drawing:
    """Draw one flight, measured and predicted, below the inputs that drove it.

    Below each output is what the prediction leaves, on a scale of its own.
    """
    shown = verification.traces[trace]
    panels = [
        Panel(
            "inputs, unitised",
            _histories(shown.time, verification.inputs, list(shown.inputs.T)),
            62.0,
        ),
    ]
    for k, (output, unit) in enumerate(zip(verification.outputs, verification.units)):
        measured, seen = values_for_people(output, shown.measured[:, k], unit)
        predicted, _ = values_for_people(output, shown.predicted[:, k], unit)
        begun = np.isin(shown.time, shown.starts)
        marks = (
            Mark("line", "data", shown.time, measured, label="flight", width=2.6),
            Mark("line", "identified", shown.time, predicted, label="identified model"),
            *[Mark("dots", "identified", shown.time[begun], predicted[begun])] * any(begun),
        )
        left = Mark("line", "grey", shown.time, less(measured, predicted))
        panels.append(Panel(labelled(output, seen), marks, 96.0))
        panels.append(Panel(labelled(f"{output}, flight less model", seen), (left,), 42.0))
    tics = ", ".join(f"{output} {tic:.3g}" for output, tic in zip(verification.outputs, shown.tic))
    approach = verification.approach
    brief = approach.in_brief if approach else ""
    title = f"{flight}: {', '.join(verification.outputs)} predicted {brief}".rstrip()
    how = f"; {approach}" if approach else ""
    return Drawing(name, title, f"{flight}: TIC {tics}{how}", tuple(panels), "time, s")


def draw_flight(name: str, title: str, record: FlightRecord, channels: Sequence[str]) -> Drawing:
    """Draw time histories of some channels of a record, one below the other."""
    panels = []
    for channel in channels:
        values, unit = values_for_people(channel, record[channel], record.unit(channel))
        mark = Mark("line", "identified", record.time, values, width=0.6)
        panels.append(Panel(labelled(channel, unit), (mark,), 66.0))
    return Drawing(name, title, f"{title}, {record.duration:g} s", tuple(panels), "time, s")


def draw_groups(name: str, title: str, record: FlightRecord, channels: Sequence[str]) -> Drawing:
    """Draw time histories of some channels, those of one kind and unit in one panel."""
    groups: dict[tuple[str, str], list[str]] = {}
    for one in channels:
        unit = record.unit(one)
        standard = one in CHANNELS and CHANNELS[one].unit == unit
        family = next((name for name, some in _FAMILIES.items() if standard and one in some), "")
        groups.setdefault((family, unit), []).append(one)
    panels = []
    for (family, unit), names in groups.items():
        for k in range(0, len(names), len(_INKS)):
            some = names[k : k + len(_INKS)]
            shown = [values_for_people(one, record[one], unit) for one in some]
            marks = _histories(record.time, some, [values for values, _ in shown])
            thin = tuple(replace(mark, kind="line", width=0.7) for mark in marks)
            unitised = unit == "1" and family in _UNITISED
            panels.append(
                Panel(
                    ", ".join(filter(None, (family, "unitised" if unitised else shown[0][1]))),
                    thin,
                    78.0,
                )
            )
    return Drawing(name, title, f"{title}, {record.duration:g} s", tuple(panels), "time, s")


def draw_excitation(name: str, flown: "Excitation") -> Drawing | None:
    """Draw what a manoeuvre adds over time, at each of its places; None where no one knows yet.

    So it is of one that leaves settings to the vehicle, and of a pilot's sweep, whose wobble each
    flight has anew.
    """
    if any(getattr(flown, setting) is None for setting in flown.left_open):
        return None
    # here, where its manoeuvre is loaded already; a log alone needs no simulator
    from helisim.sim.excitation import is_foreknown
    from helisim.sim.places import PLACES, unit

    if not is_foreknown(flown):
        return None
    time = np.linspace(0.0, flown.duration, _INSTANTS)
    try:
        added = flown.added(time)
    except InputError:
        return None
    panels = []
    for place, values in added.items():
        for axis, one in zip(PLACES[place], values.T):
            if np.any(one):
                mark = Mark("line", "identified", time, one, width=0.6)
                shown = unit(place, axis).replace("1", "unitised")
                panels.append(Panel(f"{axis} at the {place}, {shown}", (mark,), 48.0))
    title = f"{type(flown).__name__}, {flown.axis}"
    return Drawing(name, title, f"{title}, {flown.duration:g} s", tuple(panels), "time, s")


def draw_trims(flights: "Sequence[Vehicle]") -> Drawing:
    """Draw level flight over speed: power, controls, attitude."""
    speeds = np.array([flight.trim.speed for flight in flights])
    power = np.array([flight.power for flight in flights])
    controls = [np.array([getattr(flight.trim, name) for flight in flights]) for name in IN1]
    attitudes = ("theta", "phi")
    angles = [np.rad2deg([getattr(flight.trim, name) for flight in flights]) for name in attitudes]
    line = Mark("line", "identified", speeds, power)
    panels = (
        Panel("power of both rotors, W", (line, Mark("dots", "identified", speeds, power)), 120.0),
        Panel("controls, unitised", _histories(speeds, IN1, controls), 120.0),
        Panel("attitude, deg", _histories(speeds, attitudes, angles), 120.0),
    )
    title = f"{flights[0].name} in level flight"
    caption = f"{title}: power, controls and attitude over speed"
    return Drawing("trim", title, caption, panels, "speed, m/s")


def _histories(
    x: NDArray[np.float64], names: Sequence[str], values: Sequence[NDArray[np.float64]]
) -> tuple[Mark, ...]:
    """Return a line (n,) for each name, every second one dashed."""
    return tuple(
        Mark(("line", "dashes")[k % 2], _INKS[k % len(_INKS)], x, one, label=name)
        for k, (name, one) in enumerate(zip(names, values))
    )


def values_for_people(
    name: str, values: NDArray[np.float64], unit: str
) -> tuple[NDArray[np.float64], str]:
    """Return values and their unit, rates and attitudes in degrees; (n_value,) each."""
    if name in (*RATES, *ATTITUDES) and unit.startswith("rad"):
        return np.rad2deg(values), unit.replace("rad", "deg")
    return values, unit


def labelled(name: str, unit: str) -> str:
    """Return the label of a channel's axis."""
    if name.lower() in IN1:
        return f"{name}, unitised"
    return name if unit in ("", "1") else f"{name}, {unit}"
