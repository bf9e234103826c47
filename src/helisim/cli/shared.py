"""What commands share: options, the vehicle that they name, progress, what they wrote."""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.cli.options import Options, imported

if TYPE_CHECKING:
    from helisim.base.units import UserUnits
    from helisim.vehicle import Vehicle

SHARED = {
    "vehicle": """
vehicle VEHICLE <=jr700>  jr700 (default), blade360 or lynx, or the path of a vehicle's folder of
    your own
""",
    "quiet": "--quiet  no progress bar, and no word of what is written",
    "set": """
--set NAME=VALUE <many>  replace a physical parameter, such as main_rotor.hub_stiffness=100 (SI)
    or drive.governor=ideal; may be given again
""",
    "jobs": "--jobs J <int>  threads (default: all processors)",
    "seed": "--seed S <int =1>  {} (default: 1)",
    "rerun": "--rerun FILE <.rrd>  write a Rerun recording too, .rrd",
    "write": "--write  replace the vehicle's {}",
    "controller": """
--controller LAW  fly by this control law in place of the gyro: a file, law.toml, or MODULE:NAME,
    a function of (seen, state, settings) or a helisim.Controller of module.py, here or installed;
    none: the servos stay at the trim
""",
    "units": """
--units deg,ft,percent  {} in degrees, feet and percent of a control's range, or some of them
    (default: SI); frequencies stay in rad/s, and JSON in SI
""",
    "weather": """
--turbulence LEVEL|M/S  light, moderate or severe (Dryden, MIL-F-8785C), or the wind at 20 ft that
    makes it, m/s (default: calm)
--wind M/S  steady wind, m/s (default: 0)
--wind-from-deg DEG  where it comes from; flights head north: 0 is a headwind, 90 from the right
""",
    "ground": """
--ground flat|SETTING=VALUE[,...]|off  fly above a ground that can be landed on: flat, a slope, or
    a deck that moves; see below
""",
    "about_ground": """
a ground is flat, or SETTING=VALUE[,...], to take off from and to land on:
  --ground slope=0.1,uphill=1.57         rad, rising to the east
  --ground flat,parked                   start on it, not in the hover above it
  --ground flat,parked,rotor=0           and a motor spins the rotor up
  --ground deck,length=8,heave=0.3/6     m, and m over s; also surge, sway, and
                                         roll, pitch in rad over s
""",
    "manoeuvre": """
--excitation/flown KIND[,NAME=VALUE...] <ordered>  what is flown on purpose, see below: sweep
    (default), step, multisine, ...; may be given again
--history/flown FILE[,NAME=VALUE...] <ordered>  fly the columns of this file, .csv or .parquet; may
    be given again
--sequence S <float maybe=0>  fly them one after the other, S seconds of trimmed flight between
    (default: 0)
--kinds <prints=flown.kinds_in_words>  list all kinds with their settings
--axis AXIS  col|lon|lat|ped{}
--at PLACE  sticks (default), servos, actuators or sensors (axis p, q, r, phi, theta, psi)
--duration S  of the flight, s (default: a sweep's is 90)
--amplitude A <float>  of the stick, unitised (default: the axis's own)
""",
    "about_manoeuvres": """
a manoeuvre is KIND[,NAME=VALUE...], several numbers are joined as 3:42; or
MODULE:FUNCTION, a Python function of time in s. --kinds lists all:
  --excitation step,axis=ped,amplitude=0.02
  --excitation chirp,axis=lat,band=1:30,spacing=linear
  --excitation multisine,period=20,duration=46        all four axes at once
  --excitation doublet,axis=tail,at=actuators,amplitude=0.05
  --history steps.csv,axis=lat+ped,method=hold        time, LAT and PED
several are flown together, with --sequence one after the other.
""",
    "logs": """
logs LOG <many>  helisim record, CSV, Parquet, ULog (PX4) or DataFlash (ArduPilot)
how to read the logs:
--map FILE  which column is which channel, TOML; see below
--channel NAME=COLUMN:UNIT <many>  the same for one channel, with sign=-1, trim=X, range=X after
    further colons; may be given again
--time COLUMN[:UNIT]  column of times, in s, ms, us, ...
--rate HZ  of a log without times
--resample HZ  make the samples uniform (with a filter where the log is faster)
--repair NAME,... <many>  allow repairs: duplicates (average rows that have the same stamp); frozen
    (leave out stretches in which measured motion is frozen, and split the log there as at gaps);
    gaps (split the log at its gaps); missing (interpolate cells without a number); order (sort
    rows by time); resets (split the log where the clock goes back); spikes (interpolate single
    samples, or two, that stick out); tail (leave out an incomplete last line)
--max-gap S  longest time between samples that is no gap (default: 4.5 median steps)
--min-duration S <=0>  leave out shorter parts of a log that is split
--use-ended  use logs of simulated flights that were terminated early, too
--from/from_time S  leave out what is before, s after the log's first sample
--to/to_time S  leave out what is after, s after the log's first sample
""",
    "about_maps": """
a map is a TOML file, such as
  [time]
  column = "t"
  unit = "us"

  [channels.p]
  column = "gyro_x"
  unit = "deg/s"
  sign = -1

  [channels.lat]
  column = "rc1"
  unit = "us"          # pulse width: (pulse - trim) / range
  trim = 1520
  range = 800

  [file]               # only where it can't be found out, CSV
  delimiter = ";"
  decimal = ","
""",
    "estimator": """
--estimator <{windows,local}>  local: a polynomial or rational function in each narrow band, which
    no window smears and no transient biases (default); windows: CIFER's composite of Hann windows
--windows S,S,... <numbers>  CIFER's windows with these lengths, s: long ones for low frequencies,
    short ones for less scatter (with --estimator windows alone five, by the band and the records)
--overlap SHARE  with windows: of a window that the next one covers (default: 0.75)
""",
}
"""Options that several commands have, and texts below them, by the names that docstrings say."""


_SILENT, _INTERVAL = 3.0, 10.0
"""s, before the first line in a log file, and between two: most commands are done by then."""


class Progress:
    """Show how many steps of a command are done, on standard error, unless it shall be quiet.

    A bar on a terminal, a line now and then in a log file.

    Args:
        steps: in all; None if that is not known.
        quiet: True shows nothing.
        unit: what a step is called.
    """

    def __init__(self, steps: int | None, quiet: bool, unit: str = "step") -> None:
        from tqdm import tqdm  # not above: it takes a while

        self._of_all, self._unit, self._done = "" if steps is None else f" of {steps}", unit, 0
        self._bar = tqdm(total=steps, disable=quiet or None, unit=unit, leave=False)
        self._writes_lines = not quiet and not sys.stderr.isatty()
        self._start = time.monotonic()
        self._next = self._start + _SILENT

    def __enter__(self) -> Callable[[str], None]:
        return self._advance

    def _advance(self, label: str) -> None:
        self._done += 1
        self._bar.set_description(label)
        self._bar.update()
        now = time.monotonic()
        if self._writes_lines and now >= self._next:
            self._next = now + _INTERVAL
            done = f"{self._unit} {self._done}{self._of_all}, {now - self._start:.0f} s"
            print(f"{label}: {done}", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        self._bar.close()


def loaded(options: Options, **more: Any) -> "Vehicle":
    """Return the vehicle that the options say, with --set and --controller. Raises InputError."""
    from helisim.vehicle import load

    vehicle = load(options.vehicle, parameters=parameters(options), **more)
    asked = getattr(options, "controller", None)
    if asked is None:
        return vehicle
    if asked.lower().endswith(".toml"):
        from helisim.design.laws.law import read_law

        law: Any = read_law(asked)
    else:
        law = None if asked == "none" else imported("--controller", asked)
    try:
        return vehicle.with_controller(law)
    except InputError as error:
        raise InputError(f"--controller {asked}: {error}") from None


def parameters(options: Options) -> dict[str, float | str]:
    """Return what --set gives: numbers, and words where a parameter is a choice."""
    from helisim.vehicle.parameters import number_of, words_of

    given: dict[str, float | str] = {}
    for item in options.set:
        name, _, text = map(str.strip, item.partition("="))
        if words_of(name):
            try:
                number_of(name, text)
            except InputError as error:
                raise InputError(f"--set {error}") from None
            given[name] = text
        else:
            given |= numbers_by_name("--set", [item])
    return given


def numbers_by_name(option: str, items: list[str]) -> dict[str, float]:
    """Return NAME=VALUE items as numbers by name. Raises InputError."""
    values = {}
    for item in items:
        name, equals, text = item.partition("=")
        try:
            values[name.strip()] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"{option} takes NAME=VALUE with a number, got {item!r}")
    return values


def chosen_units(options: Options) -> "UserUnits | None":
    """Return the units that --units asks for, None for SI. Raises InputError."""
    if options.units is None:
        return None
    from helisim.base.units import UserUnits

    return UserUnits.of(options.units)


def print_json(data: Any) -> None:
    """Print plain data as strict JSON."""
    print(json.dumps(data, indent=2, allow_nan=False))


def print_written(options: Options, *texts: object) -> None:
    """Print what was written where, each that is not None, unless --quiet."""
    for text in texts:
        if text is not None and not options.quiet:
            print(f"Written: {text}")


def replace_parameter_file(options: Options, name: str, text: str) -> None:
    """Write a vehicle's parameter file of that name anew, its MJCF too, and print where."""
    from helisim.base.files import atomic_write
    from helisim.vehicle.build import write_numbers
    from helisim.vehicle.folder import model_folder

    path = model_folder(options.vehicle) / name
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_written(options, path, *write_numbers(options.vehicle))


def write_recording(
    path: Path, records: Any, *, vehicle: str | Path = "jr700", run: Any = None, quiet: bool = False
) -> None:
    """Write a Rerun recording of flights, and of what a run found from them, and print where."""
    from helisim.show.recording import write_recording
    from helisim.vehicle import load

    with Progress(len(records), quiet, unit="flight") as advance:
        drawn = load(vehicle)
        model, roles = drawn.visual_model(), drawn.roles
        write_recording(path, records, model=model, roles=roles, run=run, on_progress=advance)
    print_recording(path, quiet)


def print_recording(path: Path, quiet: bool) -> None:
    """Print where a recording was written and what opens it, unless `quiet`."""
    if not quiet:
        print(f"Written: {path}; open it with: rerun {path}")
