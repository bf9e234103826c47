"""Specifications: criteria with what each is in a design, as a TOML file that people write.

    scale = 10.7

    [[spec]]
    criterion = "stability_margins"
    axis = "lat"
    kind = "hard"
    gain = [6.0, 3.0]
    phase_deg = [45.0, 22.5]

A limit is a pair, where Level 1 and where Level 2 ends. An angle in degrees ends in `_deg`;
without it, it is in radians. `scale`, at the top or in a specification, is N of `Froude`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike
from typing import Any, get_args, get_type_hints

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.base.settings import Inline, convert, from_plain, placed, to_plain, toml_text
from helisim.base.units import RAD_PER_DEG
from helisim.handling.chart import Border, Limit
from helisim.handling.criteria import (
    TASKS,
    AttitudeBandwidth,
    AttitudeHold,
    AttitudeQuickness,
    Coupling,
    Criterion,
    Damping,
    DiskMargin,
    DisturbanceRejection,
    NicholsExclusion,
    PoleLimits,
    StabilityMargins,
)
from helisim.handling.loop import axis_of

KINDS = ("hard", "soft", "objective", "check")
"""What a criterion is in a design: kept whatever it costs; brought to Level 1; made as good as
the others let it be; looked at only."""
ATTITUDES = ("lat", "lon", "ped")
STANDARDS = ("margins", "disturbance_rejection", *(f"ads33e_{task}" for task in TASKS))
"""`margins`: MIL-DTL-9490E and AS94900, hard; `disturbance_rejection`: the US Army's guidelines;
the rest: ADS-33E-PRF in hover and at low speed, for tasks."""


@dataclass(frozen=True)
class Spec:
    """A criterion, and what it is in a design.

    Attributes:
        criterion: what is asked.
        kind: "hard", "soft", "objective" or "check".

    Raises:
        InputError: the criterion is none, or there is no such kind.
    """

    criterion: Criterion
    kind: str = "soft"

    def __post_init__(self) -> None:
        if not isinstance(self.criterion, Criterion):
            raise InputError(f"a specification is of a criterion, got {self.criterion!r:.60}")
        if self.kind not in KINDS:
            raise UnknownNameError("kind of specification", self.kind, KINDS)

    def scaled(self, scale: float) -> "Spec":
        """Return it for a vehicle that is smaller by a ratio of lengths; see `Froude`."""
        return replace(self, criterion=replace(self.criterion, scale=scale))


def known_criteria() -> dict[str, type[Criterion]]:
    """Return criteria by the name that files call them: all that are defined, own ones too."""
    found: dict[str, type[Criterion]] = {}
    ahead: list[type[Criterion]] = [Criterion]
    while ahead:
        one = ahead.pop()
        ahead += one.__subclasses__()
        if "name" in vars(one):
            found[one.name] = one
    return dict(sorted(found.items()))


def read_specs(path: str | PathLike[str]) -> tuple[Spec, ...]:
    """Read specifications from a TOML file.

    Raises:
        StorageError: it can't be read, or isn't TOML.
        InputError: a specification is not as it must be: which, what was read, what is expected.
    """
    data = read_toml(path)
    with placed(path):
        for name in data:
            if name not in ("scale", "spec"):
                raise UnknownNameError("entry", name, ("scale", "spec"))
        tables = data.get("spec")
        if not (isinstance(tables, list) and tables and all(isinstance(t, dict) for t in tables)):
            raise InputError(
                "no specification: each is a table [[spec]] with a criterion and an axis"
            )
        scale = convert(float, data.get("scale", 1.0), "scale")
        return tuple(_spec(k, {"scale": scale, **one}) for k, one in enumerate(tables, start=1))


def write_specs(specs: Iterable[Spec], path: str | PathLike[str]) -> None:
    """Write specifications as a TOML file that `read_specs` reads. Raises StorageError."""
    with atomic_write(path) as temporary:
        temporary.write_text(specs_to_toml(specs), encoding="utf-8")


def specs_to_toml(specs: Iterable[Spec]) -> str:
    """Return specifications as TOML, numbers that are as they would be anyway left out."""
    return toml_text({"spec": [_table(one) for one in specs]})


def _spec(number: int, table: dict[str, Any]) -> Spec:
    """Return one specification, and say which it is if it can't be."""
    known = known_criteria()
    with placed(f"spec {number}"):
        name, kind = table.pop("criterion", None), table.pop("kind", "soft")
        if not isinstance(name, str):
            said = "says no criterion" if name is None else f"has criterion = {name!r:.60}"
            raise InputError(f"it {said}; there are {', '.join(known)}")
        if name not in known:
            raise UnknownNameError("criterion", name, known)
        made, hints = known[name], get_type_hints(known[name])
        names = {one.name: one.name for one in fields(made)}
        names |= {f"{one}_deg": one for one in made.angles}
        given: dict[str, Any] = {}
        for key, item in table.items():
            if key not in names:
                raise UnknownNameError(f"setting of {name}", key, names)
            field = names[key]
            if field in given:
                raise InputError(f"{field} and {field}_deg say the same: give one of them")
            unit, place = RAD_PER_DEG if field != key else 1.0, f"{name}.{key}"
            if Limit in (get_args(hints[field]) or (hints[field],)):
                if not (isinstance(item, list) and len(item) == 2):
                    raise InputError(
                        f"{place} = {item!r}: expected two numbers, where Levels 1 and 2 end"
                    )
                item = Limit(*(convert(float, one, place) * unit for one in item))
            elif unit != 1.0:
                item = convert(float, item, place) * unit
            given[field] = item
        return Spec(from_plain(made, given, name), kind)


def _table(spec: Spec) -> dict[str, Any]:
    """Return a specification as a table of TOML."""
    one = spec.criterion
    said = {
        each.name: getattr(one, each.name)
        for each in fields(one)
        if each.name == "axis" or getattr(one, each.name) != each.default
    }
    for name, item in said.items():
        if isinstance(item, Limit):
            said[name] = [item.level1, item.level2]
        elif isinstance(item, Border):
            said[name] = Inline(to_plain(item))
    return {"criterion": one.name, "kind": spec.kind, **said}


def standard(name: str, *, axes: Sequence[str] = ATTITUDES, scale: float = 1.0) -> tuple[Spec, ...]:
    """Return a set of specifications.

    Args:
        name: of a standard; see `STANDARDS`.
        axes: by their commands or words.
        scale: N of `Froude`, for vehicles smaller than those that documents speak of.

    Raises:
        UnknownNameError: there is no such standard or axis.
    """
    if name not in STANDARDS:
        raise UnknownNameError("standard", name, STANDARDS)
    names = [axis_of(axis).name for axis in axes]
    attitudes = [axis for axis in names if axis in ATTITUDES]
    asked: list[tuple[Any, str, Sequence[str]]]
    if name == "margins":
        found = [Spec(PoleLimits(), "hard")]
        asked = [(StabilityMargins, "hard", names)]
        asked += [(kind, "check", names) for kind in (NicholsExclusion, DiskMargin)]
    elif name == "disturbance_rejection":
        found: list[Spec] = []
        asked = [(DisturbanceRejection, "soft", names)]
    else:
        task = name.removeprefix("ads33e_")
        found = [Spec(AttitudeBandwidth(axis=axis, task=task)) for axis in attitudes]
        asked = [(kind, "check", attitudes) for kind in (AttitudeQuickness, AttitudeHold)]
        cyclic = [axis for axis in names if axis in ("lat", "lon")]
        asked += [(Coupling, "check", cyclic)] if len(cyclic) == 2 else []
    found += [Spec(kind(axis=axis), how) for kind, how, on in asked for axis in on]
    if name.startswith("ads33e"):
        found.append(Spec(Damping()))
    return tuple(one.scaled(scale) for one in found)
