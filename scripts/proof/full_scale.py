"""A full-scale helicopter beside two prints: trim and derivatives of a Lynx from 0 to 120 kn.

models/lynx has Padfield's configuration; nothing of it is fitted to a derivative. Beside it:

- Padfield's derivatives at 0, 20, 40 and 60 kn, whose inflow follows the mean thrust at once, as
  helisim's does by default;
- the trims and derivatives up to 120 kn that a thesis prints of the same configuration, whose
  inflow over the disc answers the blades, as helisim's does with a reduced Lock number.

Each difference of more than 15 % must have an explanation, and explanations are tried: the model
flies again with what is named switched, and must be within 15 %. Where the two prints differ as
much, neither is more than that. Sources: lynx.toml here and models/lynx/README.md.

    python scripts/proof/full_scale.py
"""

from collections import namedtuple
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import common
import numpy as np
from common import CLOSE, KNOT, PUSH, small, weighed, within

import helisim as hs
from helisim.base.files import read_toml

STATES = ("u", "w", "q", "theta", "v", "p", "phi", "r")
INPUTS = ("theta_0", "theta_1s", "theta_1c", "theta_0T")
RATE_OF = dict(zip("XYZLMN", "uvwpqr"))  # a force or moment -> the state whose rate it is of
LYNX = read_toml(Path(__file__).with_name("lynx.toml"))
"""Prints by airspeed, kn; products of inertia are in the thesis's L and N."""
BOOK = {
    int(knots): dict(zip(STATES, np.hstack([one["a"], one["b"]])))
    for knots, one in LYNX["padfield"].items()
}
"""Airspeed, kn -> state -> what its rate is by each of `STATES` and `INPUTS`, Padfield's."""
THESIS_KNOTS, THESIS_TRIMS = LYNX["thesis_knots"], LYNX["thesis_trims"]
PADFIELD, THESIS = "Padfield", "thesis"
_AS_THESIS = (("main_rotor.hub_x", 0.0198),)  # what it reads otherwise from Padfield's data

Changes = tuple[tuple[str, float | str], ...]

_WORDS = read_toml(Path(__file__).with_suffix(".toml"))
DERIVATIVES, EXPLANATIONS = _WORDS["derivatives"], _WORDS["explanation"]
ANGLES = ("theta_0", "theta_1s", "theta_1c", "theta_0T", "theta", "phi")


Flight = namedtuple("Flight", "knots values power")
"""Trim angles and derivatives by name, and the power of both rotors, W."""


class Row(NamedTuple):
    source: str
    name: str
    knots: int
    printed: float
    found: float
    small: float

    @property
    def off(self) -> float:
        return self.found / self.printed - 1.0 if self.printed else np.inf

    @property
    def close(self) -> bool:
        return within(self.found, self.printed, self.small)


@cache
def flights(source: str, changes: Changes = ()) -> tuple[Flight, ...]:
    changes = (*_AS_THESIS, *changes) if source == THESIS else changes
    vehicle, found = hs.load("lynx", parameters=dict(changes)), []
    for knots in THESIS_KNOTS:
        vehicle = vehicle.trimmed(speed=knots * KNOT)  # each from the one before
        found.append(Flight(knots, {**angles(vehicle), **derivatives(vehicle)}, vehicle.power))
    return tuple(found)


def travel(vehicle: hs.Vehicle) -> dict[str, tuple[str, float]]:
    own = vehicle.parameters
    cyclic, hand = own["geometry.cyclic_range"], own["main_rotor.direction"]
    return {
        "theta_0": ("col", own["main_rotor.pitch_range"]),
        "theta_1s": ("lon", cyclic),
        "theta_1c": ("lat", -cyclic),  # right is minus theta_1c under these blades
        "theta_0T": ("ped", hand * own["tail_rotor.pitch_range"]),
    }


def angles(vehicle: hs.Vehicle) -> dict[str, float]:
    own, trim = vehicle.parameters, vehicle.trim
    blades = {
        name: unit * getattr(trim, control) for name, (control, unit) in travel(vehicle).items()
    }
    blades["theta_0"] += own["main_rotor.pitch_trim"] - 0.75 * own["main_rotor.twist"]
    blades["theta_0T"] += own["tail_rotor.pitch_trim"]
    return {**blades, "theta": trim.theta, "phi": trim.phi}


def derivatives(vehicle: hs.Vehicle) -> dict[str, float]:
    linear, by_control = vehicle.linearize("IN1").rigid_body(), travel(vehicle)
    found = {}
    for name in DERIVATIVES:
        axis, _, cause = name.partition("_")
        control, unit = by_control.get(cause, (cause, 1.0))
        found[name] = linear.derivative(RATE_OF[axis], control) / unit
    return without_kinematics(found, vehicle.trim.speed, vehicle.trim.theta)


def without_kinematics(values: Mapping[str, float], speed: float, theta: float) -> dict[str, float]:
    down = speed * float(np.sin(theta))
    return {**values, "X_q": values["X_q"] + down, "Y_p": values["Y_p"] - down}


def printed(source: str, knots: int) -> dict[str, float]:
    """Return a source's derivatives, then trim angles."""
    if source == THESIS:
        k = THESIS_KNOTS.index(knots)
        curves = {**LYNX["thesis_derivatives"], **{name: THESIS_TRIMS[name] for name in ANGLES}}
        return {name: curve[k] for name, curve in curves.items()}
    by, rates = (*STATES, *INPUTS).index, BOOK[knots]
    angle = by("theta")  # the trims are those of which the elements of gravity are
    theta = float(np.arctan2(-rates["w"][angle], -rates["u"][angle]))
    derived = {name: float(rates[RATE_OF[name[0]]][by(name[2:])]) for name in DERIVATIVES}
    trims = {"theta": theta, "phi": -float(np.arcsin(rates["theta"][by("r")]))}
    return without_kinematics(derived, knots * KNOT, theta) | trims


@cache
def rows(source: str) -> dict[tuple[str, int], Row]:
    found = {}
    for flight in flights(source):
        values = printed(source, flight.knots) if source == THESIS or flight.knots in BOOK else {}
        for name, value in values.items():
            own, least = flight.values[name], small(name, values, PUSH)
            found[name, flight.knots] = Row(source, name, flight.knots, value, own, least)
    return found


def tried(one: Mapping[str, Any], row: Row) -> Row:
    """Return a row as an explanation has it."""
    k, name = THESIS_KNOTS.index(row.knots), row.name
    figures = flights(row.source, tuple(one.get("switch", {}).items()))[k].values
    weights = one.get("rows", {}).get(name, {name: 1.0})
    return row._replace(found=weighed(weights, {**figures, "knots": row.knots}, k))


def verdict(row: Row) -> str:
    if row.close:
        return "" if abs(row.off) <= CLOSE else "."
    for one in EXPLANATIONS:
        names = one.get("names") or one["rows"]
        if row.source in one["sources"] and row.name in names and tried(one, row).close:
            return one["letter"]
    other = rows(THESIS if row.source == PADFIELD else PADFIELD).get((row.name, row.knots))
    if other is not None and abs(row.found / other.printed - 1.0) <= CLOSE:
        return "="  # the prints are apart
    if row.source == THESIS and row.knots > max(BOOK):
        book, thesis = (rows(source).get((row.name, 60)) for source in (PADFIELD, THESIS))
        if book and thesis and abs(book.off) <= CLOSE < abs(thesis.printed / book.printed - 1.0):
            return "~"
    return "?"


def unexplained() -> list[Row]:
    every = [*rows(PADFIELD).values(), *rows(THESIS).values()]
    return [row for row in every if verdict(row) == "?"]


def table(source: str) -> None:
    mine = rows(source)
    speeds = dict.fromkeys(knots for _, knots in mine)
    print(f"{source:<12}{'kn':>4}" + "".join(f"{knots:>10}" for knots in speeds))
    for name in dict.fromkeys(name for name, _ in mine):
        own = [mine[name, knots] for knots in speeds if (name, knots) in mine]
        scale, unit = (float(np.degrees(1.0)), ", deg") if name in ANGLES else (1.0, "")
        for head, of in (f"{name + unit:<12}    ", "printed"), (f"{'':<9}model: ", "found"):
            print(head + "".join(f"{scale * getattr(row, of):>9.4g} " for row in own))
        off = [f"{100.0 * row.off:.0f}" if abs(row.off) < 9.995 else "-" for row in own]
        print(f"{'':<10}off, %" + "".join(f"{o:>9}{verdict(row):1}" for o, row in zip(off, own)))
    print()


def main() -> None:
    table(PADFIELD)
    table(THESIS)
    power = " ".join(f"{flight.knots} kn {1e-3 * flight.power:.0f}" for flight in flights(PADFIELD))
    print(f"Power of both rotors, kW, which neither prints: {power}\n")
    print(f"Without a sign: within {100 * CLOSE:.0f} %.")
    common.legend(_WORDS["sign"] | {one["letter"]: one["words"] for one in EXPLANATIONS})
    every = len(rows(PADFIELD)) + len(rows(THESIS))
    print(f"?  {len(unexplained())} of {every} unexplained")


if __name__ == "__main__":
    common.run(main)
