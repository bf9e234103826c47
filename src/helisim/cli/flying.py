"""The commands that fly: manoeuvres, missions, weather, ground and limits as options say them."""

import math
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import DivergedError, InputError, UnknownNameError
from helisim.cli.options import (
    Options,
    Progress,
    imported,
    is_number,
    loaded,
    numbers_by_name,
    print_written,
    wrapped,
    write_recording,
)

if TYPE_CHECKING:
    from helisim.records.record import FlightRecord
    from helisim.sim import Excitation, FlightEnvelope, FlightPlan, Ground, Weather
    from helisim.sim.missions import Mission
    from helisim.vehicle import Vehicle


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


_WEATHER = ("turbulence", "wind", "wind_from_deg")
_FEEL = ("rate", "expo", "deadband")
_ONLY_BY_HAND = ("mode", "assist", *_FEEL, "order", "map", "out", *_WEATHER)


def fly(o: Options) -> int:
    """Fly sweeps, missions and other plans and record them.

    Fly one frequency sweep, a mission or another plan, once or many times, and write what the
    flight computer records.

    Options:
        @vehicle
        --plan FILE  fly this plan, .toml
        --print-plan  print the whole plan as TOML, which --plan reads, and fly nothing
        @manoeuvre
        --mission NAME[,NAME=VALUE...]  fly this script, see below: take_off_hover_land, forward,
            pirouette, autorotation
        --missions <prints=flying.missions_in_words>  list all missions with settings
        --count N  fly N times into the folder DIR, or go on where an earlier run stopped
        @jobs
        --out FILE|DIR  record to write, .parquet or .csv; with --count a folder of them
        --fault FAULT <many>  of servo, gyro, sensor or recorder, see below; may be given again
        --rotor  record the rotor's true tilt and loads too, which a recording then shows as arrows
            and a tilting disc (implied by --rerun)
        @controller
        @weather
        @ground
        --envelope LIMIT=VALUE|off <many>  another limit, see below, or none: tilt=off; off alone:
            none at all
        --integrator NAME  RK4, fourth order (default), or Euler, staggered: a third of the time,
            and still within a few parts in a thousand
        @seed: of pilot and sensors
        --rerun FILE  write a Rerun recording too, .rrd
        @set
        @quiet

    examples:
      helisim fly --axis lat --duration 90 --seed 1 --out lat.parquet
      helisim fly --axis lat --count 40 --out flights
      helisim fly --axis ped --turbulence light --amplitude 0.04 --out gusty.parquet
      helisim fly --axis lat --excitation doublet,width=0.5 --out doublet.parquet
      helisim fly --axis lat --turbulence light --print-plan > gusty.toml
      helisim fly --plan gusty.toml --seed 2 --out lat.parquet
      helisim fly --axis ped --controller my_laws:yaw --out ped.parquet
      helisim fly --mission forward,speed=20 --out forward.parquet

    a plan is a TOML file with all that is flown: excitation, mission, pilot,
    recorder, weather, ground, faults, envelope. Options beside --plan change what
    it says, but --fault adds to its faults.

    @about_manoeuvres

    a mission is NAME[,NAME=VALUE...], or MODULE:CLASS, a Mission of your own;
    --missions lists all with their settings:
      --mission forward,speed=20             out at 20 m/s, and back
      --mission take_off_hover_land          with --excitation, flown on top of it

    @about_ground

    a fault is PART:KIND[@SECONDS][,NAME=VALUE...]:
      servo_front:stuck@30                   where it is; with position=P, at P
      servo_tail:weak@30,rate_limit=1        slow; with travel=T, short
      gyro:restart@30,lasts=0.3              output=neutral or held meanwhile
      gyro:dropout@30,lasts=0.2,rates=p+q    reads=zero or held
      p:spikes,size=5,per_minute=6           of recorded channels: p, or p+q
      r:dropout@30,lasts=0.5                 reads=held or zero
      recorder:loss,share=0.01,burst=3
      recorder:gap@30,lasts=0.5
      recorder:drift,ppm=200                 channels=p+q+r: of these only

    A flight is terminated early where it leaves what the model is valid for. Its
    record says so and the identification refuses it; last_second/ beside it keeps
    how it came. Exit status 3. The limits of --envelope are
      tilt=1.2, rate=20                      rad, rad/s
      clearance=0                            m above the ground; with --ground that
                                             of the rotors alone
      touchdown=2.5                          m/s, on a ground that can be landed on
      flapping=1                             of the head's stop
      descent=2                              of the hover's induced velocity
      advance=0.3                            ratio of airspeed and tip speed
      saturation=1, saturation_window=10     s at a limit, out of s
    """
    plan = plan_of(o)
    if not o.print_plan:
        _check_fly(o)
    vehicle = loaded(o, integrator=o.integrator)
    plan = plan.on(vehicle)
    if (o.rotor or o.rerun is not None) and plan.recorder is not None:
        plan = replace(plan, recorder=replace(plan.recorder, rotor=True))
    if o.print_plan:
        print(plan.to_toml(), end="")
        return 0
    return _fly_once(o, vehicle, plan) if o.count is None else _fly_many(o, vehicle, plan)


def _check_fly(o: Options) -> None:
    """Refuse what can't be written, before any time is spent."""
    from helisim.base.files import SUFFIXES, check_destination

    if o.out is None:
        raise InputError("say where to write: --out FILE, or --out DIR with --count")
    if o.count is None:
        check_destination(o.out)
        if o.rerun is not None:
            check_destination(o.rerun, (".rrd",))
    elif o.rerun is not None:
        raise InputError("--rerun shows one flight: leave out --count")
    elif o.out.suffix.lower() in SUFFIXES:
        raise InputError(f"with --count, --out is a folder, and {o.out} is the name of a record")


def _fly_once(o: Options, vehicle: "Vehicle", plan: "FlightPlan") -> int:
    from helisim.records.storage import write_record
    from helisim.sim import Flight, fly
    from helisim.sim.flight import write_flight

    try:
        with Progress(1, o.quiet) as advance:
            (record,) = fly(vehicle, plan, seed=o.seed, on_flight=lambda: advance("flight"))
    except DivergedError as error:
        if error.record is not None:
            beside = write_flight(Flight(error.record, error.last_second), o.out)
            print_written(o, f"{o.out}, as far as the flight went, and {beside}")
            _print_flown(o, vehicle, plan, error.record)
        for traceback in getattr(error, "__notes__", ()):  # of a controller that raised
            print(traceback, file=sys.stderr)
        raise
    write_record(record, o.out)
    held = f"{len(record)} samples, {len(record.names)} channels"
    print_written(o, f"{o.out} ({record.duration:.2f} s, {held})")
    _print_flown(o, vehicle, plan, record)
    return 0


def _print_flown(
    o: Options, vehicle: "Vehicle", plan: "FlightPlan", record: "FlightRecord"
) -> None:
    """Print what a mission reached, unless --quiet, and write the recording."""
    from helisim.base.settings import from_plain
    from helisim.sim.missions.mission import Reached

    if not o.quiet and "reached" in record.provenance:
        print(f"Reached: {from_plain(Reached, record.provenance['reached'], 'reached')}")
    if o.rerun is not None:
        write_recording(o.rerun, {plan.name: record}, vehicle=vehicle.folder, quiet=o.quiet)


def _fly_many(o: Options, vehicle: "Vehicle", plan: "FlightPlan") -> int:
    from helisim.sim import fly_to

    with Progress(o.count, o.quiet) as advance:
        flown = fly_to(
            o.out,
            vehicle,
            plan,
            count=o.count,
            seed=o.seed,
            jobs=o.jobs,
            on_flight=lambda: advance("flight"),
        )
    there = f", {flown.found} of them there before" if flown.found else ""
    print_written(o, f"{o.out} ({len(flown.paths)} flights of {plan.duration:g} s{there})")
    for path, why in flown.ended.items():
        print(f"helisim fly: {path}: {why}, where the flight was terminated early", file=sys.stderr)
    return 3 if flown.ended else 0


def view(o: Options) -> int:
    """Watch the helicopter fly in MuJoCo's viewer, or fly it by hand.

    Fly in MuJoCo's viewer, in real time: a hover, or any manoeuvre; or by hand, with keys or a
    joystick. Needs a display; without one, record a flight with helisim fly --rerun.

    Options:
        @vehicle
        @manoeuvre:  (default: a hover, until the window is closed)
        @seed: of the pilot
        --sitl PORT <int maybe=9002>  let ArduPilot fly it from the ground, as helisim sitl does,
            which has more options (default port: 9002)
        @ground
        @controller
        @set
        by hand:
        --keyboard  fly by hand, with keys
        --joystick N|NAME <maybe=>  fly by hand, with a joystick, gamepad or transmitter: its number
            or part of its name (default: the only one)
        --mode 1|2|3|4 <int>  which stick is where (default: 2)
        --assist NAME  hover (default): the sticks command velocities; level: tilt; none: rates, as
            the gyro takes them
        --rate R <float>  share of the travel that a full stick gives
        --expo E <float>  0 linear to 1, soft in the middle
        --deadband D <float>  deflection about the middle that is none
        --order LETTERS  of a transmitter's channels: aileron, elevator, throttle, rudder (default:
            AETR)
        --map FILE  axes of the joystick, .toml
        --out FILE  recordings, .parquet or .csv, further ones numbered (default: by_hand.parquet)
        options:
        @weather

    example: helisim view --axis lat

    by hand:
      helisim view --keyboard --out hand.parquet
      helisim view --joystick --mode 1 --assist level
      helisim view --joystick radio --map radio.toml --turbulence light
    W S A D are the left gimbal of a transmitter and the arrows the right one; what
    each does is the mode's and stands in the window, with all other keys. R starts
    and stops a recording, which helisim identify reads.

    @about_ground

    @about_manoeuvres
    """
    from helisim.show.viewer import check_display, view

    if o.duration is not None and not 0.0 < o.duration < float("inf"):
        raise InputError(f"--duration must be a positive number of seconds, got {o.duration}")
    if o.sitl is not None:
        return _watch_autopilot(o)
    if _is_by_hand(o):
        if is_asked(o):
            raise InputError("a hand flies no manoeuvre: leave out --axis, --excitation, --history")
        return _fly_by_hand(o)
    flown_on_purpose = manoeuvre(o) if is_asked(o) else None
    vehicle = loaded(o)
    check_display()
    flown = view(vehicle, flown_on_purpose, duration=o.duration, ground=ground(o), seed=o.seed)
    print(f"Flown: {flown:.1f} s")
    return 0


def _watch_autopilot(o: Options) -> int:
    """Let an autopilot fly, as `helisim sitl --view` does with what is given here."""
    from helisim.cli import parser

    words = ["sitl", o.vehicle, "--view", "--port", str(o.sitl)]
    words += [f"--seed={o.seed}", *(f"--set={one}" for one in o.set)]
    for name in ("ground", *_WEATHER):
        if getattr(o, name) is not None:
            words.append(f"--{name.replace('_', '-')}={getattr(o, name)}")
            setattr(o, name, None)
    if _is_by_hand(o) or is_asked(o) or o.controller is not None or o.duration is not None:
        raise InputError("--sitl lets ArduPilot fly: leave out manoeuvre, sticks and controller")
    asked = parser(words).parse_args(words)
    return asked.run(asked)


def _is_by_hand(o: Options) -> bool:
    """Return whether a hand flies. Raises InputError: options are given that ask for one."""
    if o.keyboard or o.joystick is not None:
        return True
    for name in _ONLY_BY_HAND:
        if getattr(o, name) is not None:
            flag = f"--{name.replace('_', '-')}"
            raise InputError(f"{flag} is for a flight by hand: add --keyboard or --joystick")
    return False


def _fly_by_hand(o: Options) -> int:
    """Fly and say which records were written. Raises HelisimError."""
    if o.keyboard and o.joystick is not None:
        raise InputError("--keyboard and --joystick exclude each other: give one of them")
    for name in ("order", "map"):
        if o.joystick is None and getattr(o, name) is not None:
            raise InputError(f"--{name} is of a joystick: add --joystick")
    if o.map is not None and o.order is not None:
        raise InputError("--map and --order exclude each other: give one of them")
    from helisim.base.files import check_destination
    from helisim.hand import KEY_FEEL, JoystickMap, StickFeel
    from helisim.hand.flight import check_assist
    from helisim.hand.sticks import check_mode
    from helisim.hand.window import fly_by_hand
    from helisim.show.viewer import check_display

    mode = check_mode(2 if o.mode is None else o.mode)
    assist = check_assist(o.assist or "hover")
    given = {name: one for name in _FEEL if (one := getattr(o, name)) is not None}
    feel = replace(KEY_FEEL if o.keyboard else StickFeel(), **given)
    axes = None if o.map is None else JoystickMap.read(o.map)
    if o.order is not None:
        axes = JoystickMap.transmitter(o.order)
    air, below = weather(o), ground(o)
    out = check_destination(o.out or Path("by_hand.parquet"))
    check_display()
    written = fly_by_hand(
        loaded(o),
        joystick=o.joystick,
        mode=mode,
        assist=assist,
        feel=feel,
        axes=axes,
        weather=air,
        ground=below,
        out=out,
        duration=o.duration,
        seed=o.seed,
    )
    for path in written:
        print(f"Written: {path}")
    return 0
