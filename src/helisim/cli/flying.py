"""The commands that fly: manoeuvres, missions, weather, ground and limits as options say them."""

import math
import re
import sys
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from helisim.base.errors import DivergedError, InputError
from helisim.cli.options import (
    Options,
    imported,
    loaded,
    print_written,
    progress,
    write_recording,
)

if TYPE_CHECKING:
    from helisim.records.record import FlightRecord
    from helisim.sim import Excitation, FlightPlan, Ground, Weather
    from helisim.vehicle import Vehicle


_GENERAL = ("axis", "at", "duration", "amplitude")
_WEATHER = ("turbulence", "wind", "wind_from_deg")
_BY_HAND = ("mode", "assist", "order", "out")


def plan_of(o: Options) -> "FlightPlan":
    """Return the plan that the options of `helisim fly` say. Raises InputError."""
    from helisim.base.settings import parse_notation
    from helisim.sim import FAULTS, FlightPlan, read_plan
    from helisim.sim.missions import Mission, missions_by_name

    excitation = manoeuvre(o)
    faults = tuple(parse_notation(text, FAULTS, what="fault") for text in o.fault)
    if o.plan is not None:
        own = ("mission", "ground", "duration", *_WEATHER)
        if excitation or faults or any(getattr(o, name) is not None for name in own):
            raise InputError("--plan says all that is flown: leave out manoeuvre, weather and such")
        return read_plan(o.plan)
    flown = None
    if o.mission is not None:
        word, kinds = o.mission.split(",")[0].strip(), missions_by_name()
        kinds = {word: imported("--mission", word)} if ":" in word else kinds
        for kind in kinds.values():
            if not (isinstance(kind, type) and issubclass(kind, Mission)):
                raise InputError(f"--mission {word} is no subclass of helisim.Mission")
        flown = parse_notation(o.mission, kinds, what="mission")
        flown = flown if o.duration is None else replace(flown, duration=o.duration)
    elif excitation is None:
        raise InputError(
            "say what is flown: --axis col|lon|lat|ped, --excitation KIND, --mission NAME, or "
            "--plan FILE"
        )
    return FlightPlan(
        excitation=excitation,
        mission=flown,
        faults=faults,
        weather=weather(o),
        ground=ground(o),
    )


def manoeuvre(o: Options) -> "Excitation | None":
    """Return the manoeuvre that the options say, None if they name none. Raises InputError."""
    from helisim.base.settings import parse_notation
    from helisim.sim.excitation import EXCITATIONS

    given = {name: value for name in _GENERAL if (value := getattr(o, name)) is not None}
    given |= {"axis": _commands(o.axis)} if o.axis else {}
    if o.excitation is None and o.axis is None:
        for name in given.keys() - {"duration"}:
            raise InputError(f"--{name} is of a manoeuvre: say which, by --axis or --excitation")
        return None
    kinds = {
        name.lower(): kind
        for name, kind in EXCITATIONS.items()
        if not {"parts", "values"} & set(kind.__dataclass_fields__)
    }
    return parse_notation(_commands(o.excitation or "sweep"), kinds, what="excitation", given=given)


def _commands(text: str) -> str:
    """Return a text with the commands of the axes that it names by their motion: roll is lat."""
    from helisim.handling.loop import axis_of

    return re.sub(r"\b(heave|pitch|roll|yaw)\b", lambda word: axis_of(word[0]).name, text)


def weather(o: Options) -> "Weather":
    """Return the weather that the options say. Raises InputError."""
    from helisim.sim import Weather

    turbulence: Any = o.turbulence
    with suppress(TypeError, ValueError):
        turbulence = float(turbulence)
    wind_from = None if o.wind_from_deg is None else math.radians(o.wind_from_deg)
    given = {"turbulence": turbulence, "wind": o.wind, "wind_from": wind_from}
    return Weather(**{name: one for name, one in given.items() if one is not None})


def ground(o: Options) -> "Ground | None":
    """Return the ground that the option says, None for none. Raises InputError."""
    from helisim.base.settings import from_plain, setting_names
    from helisim.sim import Deck, Ground

    if o.ground is None:
        return None
    parts = [item.partition("=") for item in o.ground.split(",")]
    given = {name.strip(): _size(text) if equals else True for name, equals, text in parts}
    of_deck = {name: one for name, one in given.items() if name in setting_names(Deck)}
    of_ground = {name: one for name, one in given.items() if name not in {"flat", *of_deck}}
    if of_deck or "deck" in given:
        of_ground["deck"] = of_deck
    return from_plain(Ground, of_ground, "--ground")


def _size(text: str) -> Any:
    """Return NUMBER, or AMPLITUDE/PERIOD as the settings of a swing."""
    try:
        amplitude, *period = map(float, text.split("/", 1))
    except ValueError:
        raise InputError(
            "--ground takes flat, deck, parked, NAME=NUMBER and NAME=AMPLITUDE/PERIOD, got "
            f"{text!r}"
        ) from None
    return {"amplitude": amplitude, "period": period[0]} if period else amplitude


def fly(o: Options) -> int | None:
    """Fly sweeps, missions and other plans and record them.

    Fly a sweep, mission or other plan, and write the flight computer's record.

    Options:
        @vehicle
        --plan FILE  fly this plan, .toml
        --print-plan  print the plan as TOML for --plan, fly nothing
        @manoeuvre
        --mission NAME  take_off_hover_land, forward, autorotation, or MODULE:CLASS, with
            settings ,NAME=VALUE
        --count N  fly N times into the folder DIR
        @jobs
        --out FILE|DIR  record, .parquet or .csv; with --count a folder
        --fault KIND,... <many>  of servo or recorder, see below; repeatable
        --rotor  record the rotor's true tilt and loads too
        @controller
        @slung
        @weather
        @ground
        --integrator NAME  RK4 (default), or Euler, three times as fast
        @seed: of pilot and sensors
        @rerun
        @set
        @quiet

    examples:
      helisim fly --axis lat --count 40 --out flights
      helisim fly --axis lat --turbulence light --print-plan > gusty.toml
      helisim fly --plan gusty.toml --seed 2 --out lat.parquet
      helisim fly --mission forward,speed=20 --out forward.parquet

    @about_manoeuvres

    @about_ground

    a fault is KIND,NAME=VALUE...:
      servostuck,servo=servo_front,at=30     where it is; with position=P, at P
      sampleloss,share=0.01,burst=3          of the recorder
      recordgap,at=30,lasts=0.5

    Exit status 3: a flight left the model's validity and was terminated early.
    """
    plan = plan_of(o)
    vehicle = loaded(o, integrator=o.integrator)
    plan = plan.on(vehicle)
    if (o.rotor or o.rerun is not None) and plan.recorder is not None:
        plan = replace(plan, recorder=replace(plan.recorder, rotor=True))
    if o.print_plan:
        print(plan.to_toml(), end="")
        return 0
    _check_fly(o)
    return _fly_once(o, vehicle, plan) if o.count is None else _fly_many(o, vehicle, plan)


def _check_fly(o: Options) -> None:
    from helisim.base.files import SUFFIXES, check_destination

    if o.out is None:
        raise InputError("say where to write: --out FILE, or --out DIR with --count")
    if o.count is None:
        check_destination(o.out)
    elif o.rerun is not None:
        raise InputError("--rerun shows one flight: leave out --count")
    elif o.out.suffix.lower() in SUFFIXES:
        raise InputError(f"with --count, --out is a folder, and {o.out} is the name of a record")


def _fly_once(o: Options, vehicle: "Vehicle", plan: "FlightPlan") -> None:
    from helisim.records.storage import write_record
    from helisim.sim import fly

    try:
        with progress(1, o.quiet) as advance:
            (record,) = fly(vehicle, plan, seed=o.seed, on_flight=lambda: advance("flight"))
    except DivergedError as error:
        if error.record is not None:
            write_record(error.record, o.out)
            print_written(o, f"{o.out}, as far as the flight went")
            _print_flown(o, vehicle, plan, error.record)
        for traceback in getattr(error, "__notes__", ()):  # of a controller that raised
            print(traceback, file=sys.stderr)
        raise
    write_record(record, o.out)
    held = f"{len(record)} samples, {len(record.names)} channels"
    print_written(o, f"{o.out} ({record.duration:.2f} s, {held})")
    _print_flown(o, vehicle, plan, record)


def _print_flown(
    o: Options, vehicle: "Vehicle", plan: "FlightPlan", record: "FlightRecord"
) -> None:
    from helisim.base.settings import from_plain
    from helisim.sim.missions.mission import Reached

    if not o.quiet and "reached" in record.provenance:
        print(f"Reached: {from_plain(Reached, record.provenance['reached'], 'reached')}")
    if o.rerun is not None:
        write_recording(o, o.rerun, {plan.name: record}, vehicle.folder)


def _fly_many(o: Options, vehicle: "Vehicle", plan: "FlightPlan") -> int:
    from helisim.sim import fly_to

    with progress(o.count, o.quiet) as advance:
        ended = fly_to(
            o.out,
            vehicle,
            plan,
            count=o.count,
            seed=o.seed,
            jobs=o.jobs,
            on_flight=lambda: advance("flight"),
        )
    print_written(o, f"{o.out} ({len(ended)} flights of {plan.duration:g} s)")
    for path, why in ended.items():
        if why:
            early = "where the flight was terminated early"
            print(f"helisim fly: {path}: {why}, {early}", file=sys.stderr)
    return 3 if any(ended.values()) else 0


def view(o: Options) -> int | None:
    """Watch the helicopter fly in MuJoCo's viewer, or fly it by hand.

    Fly in real time: a hover, a manoeuvre, or by hand. Without a display, use helisim fly --rerun.

    Options:
        @vehicle
        @manoeuvre:  (default: a hover)
        @seed: of the pilot
        @ground
        @controller
        @slung
        @set
        by hand:
        --keyboard  fly by hand, with keys
        --joystick N|NAME <maybe=>  joystick or transmitter (default: the only one)
        --mode 1|2|3|4 <int>  which stick is where (default: 2)
        --assist NAME  hover (default): sticks command velocities; level: tilt; none: rates
        --order LETTERS  of a transmitter's channels (default: AETR)
        --out FILE  recordings, numbered (default: by_hand.parquet)
        @weather

    examples:
      helisim view --axis lat
      helisim view --keyboard --out hand.parquet
      helisim view --joystick --mode 1 --assist level

    The window says what each key does. R starts and stops a recording.

    @about_ground

    @about_manoeuvres
    """
    from helisim.show.viewer import view

    if o.duration is not None and not 0.0 < o.duration < float("inf"):
        raise InputError(f"--duration must be a positive number of seconds, got {o.duration}")
    given = {name: one for name in _BY_HAND if (one := getattr(o, name)) is not None}
    if o.keyboard or o.joystick is not None:
        if manoeuvre(o) or (o.keyboard and o.joystick is not None):
            raise InputError("give one of --keyboard, --joystick and a manoeuvre")
        from helisim.hand.window import fly_by_hand

        written = fly_by_hand(
            loaded(o),
            joystick=o.joystick,
            weather=weather(o),
            ground=ground(o),
            duration=o.duration,
            seed=o.seed,
            **given,
        )
        print_written(o, *written)
        return 0
    if given or any(getattr(o, name) is not None for name in _WEATHER):
        raise InputError(
            "weather and the options of sticks are for a flight by hand: add --keyboard or "
            "--joystick"
        )
    flown = view(loaded(o), manoeuvre(o), duration=o.duration, ground=ground(o), seed=o.seed)
    print(f"Flown: {flown:.1f} s")
