"""What is flown, as options say it: manoeuvres, missions, weather, ground and limits."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.options import Options, imported, is_number, wrapped
from helisim.cli.shared import numbers_by_name

if TYPE_CHECKING:
    from helisim.sim import Excitation, FlightEnvelope, FlightPlan, Ground, Weather
    from helisim.sim.missions import Mission

_GENERAL = ("axis", "at", "duration", "amplitude")
"""Options that are settings of every manoeuvre that takes them and doesn't say its own."""
_UNASKED = ("digest", "samples", "source")
"""What a `History` knows by itself."""
_GROUND_WORDS = ("flat", "deck", "parked")


def plan_of(o: Options) -> "FlightPlan":
    """Return the plan that the options of `helisim fly` say. Raises InputError."""
    from helisim.sim import FlightPlan, parse_fault, read_plan

    faults = tuple(parse_fault(text) for text in o.fault)
    plan = None if o.plan is None else read_plan(o.plan)
    flown = mission(o, None if plan is None else plan.mission)
    planned = None if plan is None else plan.excitation
    if plan is None and flown is None and not is_asked(o):
        raise InputError(
            "say what is flown: --axis col|lon|lat|ped, --excitation KIND, --mission NAME, or "
            "--plan FILE"
        )
    alone = flown is not None and planned is None and not is_asked(o)
    excitation = None if alone else manoeuvre(o, planned)
    plan = plan or FlightPlan(excitation=excitation, mission=flown)
    return replace(
        plan,
        excitation=excitation,
        mission=flown,
        faults=(*plan.faults, *faults),
        weather=weather(o, plan.weather),
        ground=ground(o, plan.ground),
        envelope=_envelope(o.envelope, plan.envelope),
    )


def is_asked(o: Options) -> bool:
    """Return whether the options name a manoeuvre."""
    if o.flown or o.axis is not None:
        return True
    for name in ("at", "amplitude", "sequence"):
        if getattr(o, name) is not None:
            raise InputError(f"--{name} is of a manoeuvre: say which, by --axis or --excitation")
    return False


def manoeuvre(o: Options, planned: "Excitation | None" = None) -> "Excitation":
    """Return the manoeuvre that the options say, beside that of a plan."""
    from helisim.sim import Sequence, Together

    given = {name: value for name in _GENERAL if (value := getattr(o, name, None)) is not None}
    usual = given if planned is None else {"axis": planned.axis, **given}
    asked = [
        _history(text, given) if option.startswith("--h") else _excitation(text, given, usual)
        for option, text in o.flown
    ]
    if not asked:
        asked = [_changed(o, planned, given) if planned else _excitation("sweep", given, given)]
    if o.sequence is not None:
        if len(asked) < 2:
            raise InputError("--sequence joins two manoeuvres or more: give --excitation again")
        return Sequence(parts=tuple(asked), pause=o.sequence)
    return asked[0] if len(asked) == 1 else Together(parts=tuple(asked))


def _changed(o: Options, planned: "Excitation", given: Mapping[str, Any]) -> "Excitation":
    """Return a plan's manoeuvre with the settings that are given."""
    from helisim.base.settings import from_plain, to_plain

    axis = given.get("axis", planned.axis)
    fixed = [one for one in planned.left_open if getattr(planned, one) is not None]
    if axis != planned.axis and fixed:
        raise InputError(
            f"{o.plan}: {' and '.join(fixed)} of the {planned.axis} axis: take them out "
            f"for --axis {axis}, or leave out --axis"
        )
    return from_plain(type(planned), {**to_plain(planned), **given}, "the excitation")


def _excitation(text: str, given: Mapping[str, Any], usual: Mapping[str, Any]) -> "Excitation":
    """Return the manoeuvre of one --excitation, `usual` what it doesn't say."""
    from helisim.base.settings import parse_notation
    from helisim.sim import Manoeuvre
    from helisim.sim.excitation import EXCITATIONS

    word, *items = text.split(",")
    if ":" in word:
        option = "--excitation MODULE:FUNCTION"
        settings = _settings(option, items, {"axis": str, "at": str, "duration": float}, given)
        return Manoeuvre(imported("--excitation", word), **settings)
    kinds = {name.lower(): kind for name, kind in EXCITATIONS.items()}
    kind = kinds.get(word.strip().lower())
    if kind is not None and "parts" in kind.__dataclass_fields__:
        raise InputError(
            f"--excitation {word}: give --excitation for each part, and --sequence to fly them "
            "one after the other; a plan file nests them"
        )
    if kind is not None and "samples" in kind.__dataclass_fields__:
        raise InputError(f"--excitation {word}: give its file, --history FILE[,NAME=VALUE...]")
    return parse_notation(text, kinds, what="excitation", given=usual)


def _history(text: str, given: Mapping[str, Any]) -> "Excitation":
    """Return the manoeuvre of one --history."""
    from helisim.sim import History

    path, *items = text.split(",")
    known = {"axis": str, "at": str, "method": str, "duration": float}
    return History.read(Path(path), **_settings("--history", items, known, given))


def _settings(
    option: str, items: Sequence[str], known: Mapping[str, type], given: Mapping[str, Any]
) -> dict[str, Any]:
    """Return NAME=VALUE items by name, beside those that are given. Raises InputError."""
    found = dict(given)
    for item in items:
        name, equals, text = (one.strip() for one in item.partition("="))
        if not (name and equals and text) or (known.get(name) is float and not is_number(text)):
            raise InputError(f"{option} takes NAME=VALUE, got {item!r}")
        found[name] = known.get(name, str)(text)
    for name in found:
        if name not in known:
            raise UnknownNameError(f"setting of {option}", name, known)
    return found


def mission(o: Options, planned: "Mission | None" = None) -> "Mission | None":
    """Return the mission that the options say, else that of a plan; None for none."""
    from helisim.base.settings import parse_notation
    from helisim.sim.missions import Mission, missions_by_name

    flown = planned
    if o.mission is not None:
        word, kinds = o.mission.split(",")[0].strip(), missions_by_name()
        if ":" in word:
            kinds = {word: imported("--mission", word)}
        for kind in kinds.values():
            if not (isinstance(kind, type) and issubclass(kind, Mission)):
                raise InputError(
                    f"--mission {word}: it is no subclass of helisim.Mission, but {kind!r:.80}"
                )
        flown = parse_notation(o.mission, kinds, what="mission")
    return flown if flown is None or o.duration is None else replace(flown, duration=o.duration)


def kinds_in_words() -> str:
    """Return every kind of manoeuvre: what it is, its settings and their defaults."""
    from helisim.sim.excitation import EXCITATIONS

    def words(kind: Any, one: Field[Any]) -> str:
        if one.name in kind.left_open:
            return f"{one.name}=the vehicle's own"
        return one.name if one.default in (MISSING, "") else f"{one.name}={one.default}"

    return _listed({name.lower(): kind for name, kind in EXCITATIONS.items()}, words)


def missions_in_words() -> str:
    """Return every mission: what it is, its settings and their defaults."""
    from helisim.sim.missions import missions_by_name

    def words(_: Any, one: Field[Any]) -> str:
        return one.name if one.default is MISSING else f"{one.name}={one.default}"

    return _listed(missions_by_name(), words)


def _listed(kinds: Mapping[str, Any], words: Any) -> str:
    lines = []
    for name, kind in sorted(kinds.items()):
        settings = [words(kind, one) for one in fields(kind) if one.name not in _UNASKED]
        lines.append(wrapped(f"{name}: {str(kind.__doc__).splitlines()[0]}", indent=4))
        lines.append(wrapped(f"    {', '.join(settings)}", indent=4))
    return "\n".join(lines) + "\n"


def weather(o: Options, planned: "Weather | None" = None) -> "Weather":
    """Return the weather that the options say, beside that of a plan. Raises InputError."""
    from helisim.sim import Weather

    turbulence: Any = o.turbulence
    with suppress(TypeError, ValueError):
        turbulence = float(turbulence)
    wind_from = None if o.wind_from_deg is None else math.radians(o.wind_from_deg)
    given = {"turbulence": turbulence, "wind": o.wind, "wind_from": wind_from}
    changes = {name: one for name, one in given.items() if one is not None}
    return replace(planned or Weather(), **changes)


def ground(o: Options, planned: "Ground | None" = None) -> "Ground | None":
    """Return the ground that the option says, else that of a plan; None for none."""
    if o.ground is None or o.ground.strip() == "off":
        return planned if o.ground is None else None
    from helisim.base.settings import setting_names
    from helisim.sim import Deck, Ground

    own, deck = setting_names(Ground), setting_names(Deck)
    of_ground: dict[str, Any] = {}
    of_deck: dict[str, Any] = {}
    items = [item.strip() for item in o.ground.split(",")]
    for item in items:
        name, equals, text = (part.strip() for part in item.partition("="))
        if not equals and name in _GROUND_WORDS:
            continue
        if name in deck:
            of_deck[name] = _size(item, text, swing=name in Deck.motions)
        elif name in own and name not in ("deck", "parked"):
            of_ground[name] = _size(item, text, swing=False)
        else:
            known = dict.fromkeys([*_GROUND_WORDS, *own, *deck])
            raise UnknownNameError("setting of --ground", name, known)
    if of_deck or "deck" in items:
        of_ground["deck"] = Deck(**of_deck)
    return Ground(parked="parked" in items, **of_ground)


def _size(item: str, text: str, *, swing: bool) -> Any:
    """Return a number, or a swing of AMPLITUDE/PERIOD."""
    from helisim.sim import Swing

    numbers: list[float] = []
    with suppress(ValueError):
        numbers = [float(part) for part in text.split("/")]
    if len(numbers) != 1 + swing:
        takes = "AMPLITUDE/PERIOD" if swing else "a number"
        raise InputError(f"--ground takes {takes}, got {item!r}")
    return Swing(amplitude=numbers[0], period=numbers[1]) if swing else numbers[0]


def _envelope(items: Sequence[str], envelope: "FlightEnvelope") -> "FlightEnvelope":
    """Return an envelope with the limits of --envelope. Raises InputError."""
    if "off" in items:
        if len(items) > 1:
            raise InputError("--envelope off has no limits: leave out the others")
        return envelope.off()
    limits: dict[str, Any] = {}
    for item in items:
        off = item.endswith("=off")
        one = (
            {item.partition("=")[0].strip(): None} if off else numbers_by_name("--envelope", [item])
        )
        limits |= one
    for name in limits:
        if name not in envelope.__dataclass_fields__:
            raise UnknownNameError("limit of --envelope", name, envelope.__dataclass_fields__)
    return replace(envelope, **limits)
