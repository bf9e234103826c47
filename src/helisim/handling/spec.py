"""Specifications: criteria with their kind in a design, as a TOML file.

    scale = 10.7

    [[spec]]
    criterion = "stability_margins"
    axis = "lat"
    kind = "hard"
    gain = [6.0, 3.0]
    phase_deg = [45.0, 22.5]

A limit is a pair, where Levels 1 and 2 end. Angles are in radians, or in degrees with `_deg`.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from os import PathLike
from typing import Any, get_args, get_type_hints

from helisim.base.errors import InputError, check_known, item_of
from helisim.base.files import read_toml, write_text
from helisim.base.settings import convert, from_plain, placed, toml_text
from helisim.base.units import RAD_PER_DEG
from helisim.handling.criteria import (
    TASKS,
    AttitudeBandwidth,
    AttitudeQuickness,
    Coupling,
    Criterion,
    Damping,
    DisturbanceRejection,
    PoleLimits,
    StabilityMargins,
)
from helisim.handling.criterion import WHOLE
from helisim.handling.limit import Limit
from helisim.handling.loop import axis_of

KINDS = ("hard", "soft", "objective", "check")
"""Constraint; brought to Level 1; made as good as the others allow; only rated."""
ATTITUDES = ("lat", "lon", "ped")
STANDARDS = ("margins", "disturbance_rejection", *(f"ads33e_{task}" for task in TASKS))
"""MIL-DTL-9490E and AS94900, hard; the US Army's guidelines; ADS-33E-PRF for tasks in a hover."""


@dataclass(frozen=True)
class Spec:
    """A criterion and its kind in a design, of `KINDS`. Raises InputError or UnknownNameError."""

    criterion: Criterion
    kind: str = "soft"

    def __post_init__(self) -> None:
        if not isinstance(self.criterion, Criterion):
            raise InputError(f"a specification is of a criterion, got {self.criterion!r:.60}")
        check_known("kind of specification", [self.kind], KINDS)


def known_criteria() -> dict[str, type[Criterion]]:
    """Return all criteria that are defined, own ones too, by their names in files."""
    kinds = list(Criterion.__subclasses__())
    for one in kinds:  # which grows meanwhile
        kinds += one.__subclasses__()
    return {one.name: one for one in kinds if "name" in vars(one)}


def read_specs(path: str | PathLike[str]) -> tuple[Spec, ...]:
    """Read specifications from a TOML file. Raises StorageError, or InputError that says where."""
    data = read_toml(path)
    with placed(path):
        check_known("entry", data, ("scale", "spec"))
        tables = data.get("spec")
        if not (isinstance(tables, list) and tables and all(isinstance(t, dict) for t in tables)):
            raise InputError(
                "no specification: each is a table [[spec]] with a criterion and an axis"
            )
        scale = convert(float, data.get("scale", 1.0), "scale")
        return tuple(_spec(k, {"scale": scale, **one}) for k, one in enumerate(tables, start=1))


def write_specs(specs: Iterable[Spec], path: str | PathLike[str]) -> None:
    """Write specifications as a TOML file. Raises StorageError."""
    write_text(path, specs_to_toml(specs))


def specs_to_toml(specs: Iterable[Spec]) -> str:
    """Return specifications as TOML, defaults left out."""
    return toml_text({"spec": [_table(one) for one in specs]})


def _spec(number: int, table: dict[str, Any]) -> Spec:
    with placed(f"spec {number}"):
        name, kind = table.pop("criterion", None), table.pop("kind", "soft")
        made = item_of(known_criteria(), str(name or ""), "criterion")
        hints = get_type_hints(made)
        names = {one.name: one.name for one in fields(made)}
        names |= {f"{one}_deg": one for one in made.angles}
        given: dict[str, Any] = {}
        for key, item in table.items():
            check_known(f"setting of {name}", [key], names)
            field = names[key]
            if field in given:
                raise InputError(f"{field} and {field}_deg say the same: give one of them")
            unit, place = RAD_PER_DEG if field != key else 1.0, f"{name}.{key}"
            if Limit in (get_args(hints[field]) or (hints[field],)):
                ends = convert(tuple[float, float], item, f"{place}, where Levels 1 and 2 end,")
                item = Limit(*(unit * one for one in ends))
            elif unit != 1.0:
                item = convert(float, item, place) * unit
            given[field] = item
        return Spec(from_plain(made, given, name), kind)


def _table(spec: Spec) -> dict[str, Any]:
    one = spec.criterion
    table: dict[str, Any] = {"criterion": one.name, "kind": spec.kind}
    for each in fields(one):
        item = getattr(one, each.name)
        if each.name == "axis" or item != each.default:
            table[each.name] = [item.level1, item.level2] if isinstance(item, Limit) else item
    return table


def standard(name: str, *, axes: Sequence[str] = ATTITUDES, scale: float = 1.0) -> tuple[Spec, ...]:
    """Return the specifications of a standard in `STANDARDS`, scaled by N of `froude_scale`."""
    check_known("standard", [name], STANDARDS)
    names = [axis_of(axis).name for axis in axes]
    attitudes = [axis for axis in names if axis in ATTITUDES]
    cyclic = ["lat", "lon"] if {"lat", "lon"} <= set(names) else []
    of_task = [
        (partial(AttitudeBandwidth, task=name.removeprefix("ads33e_")), "soft", attitudes),
        (AttitudeQuickness, "soft", attitudes),
        (Coupling, "check", cyclic),
        (Damping, "soft", [WHOLE]),
    ]
    parts: dict[str, list[tuple[Callable[..., Criterion], str, list[str]]]] = {
        "margins": [(PoleLimits, "hard", [WHOLE]), (StabilityMargins, "hard", names)],
        "disturbance_rejection": [(DisturbanceRejection, "soft", names)],
    }
    return tuple(
        Spec(made(axis=axis, scale=scale), kind)
        for made, kind, there in parts.get(name, of_task)
        for axis in there
    )
