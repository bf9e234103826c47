"""Commands that fly: plans into records, and in a window, by hand too."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from helisim.base.errors import DivergedError, InputError
from helisim.cli.flown import ground, is_asked, manoeuvre, plan_of, weather
from helisim.cli.options import Options
from helisim.cli.shared import Progress, loaded, print_written, write_recording

if TYPE_CHECKING:
    from helisim.records.record import FlightRecord
    from helisim.sim import FlightPlan
    from helisim.vehicle import Vehicle

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
        --missions <prints=flown.missions_in_words>  list all missions with settings
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
    from helisim.sim.fly import write_flight

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
