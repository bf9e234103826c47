"""Commands that read flight logs: look at them, estimate their frequency responses, draw them."""

import re
import shlex
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.cli.options import (
    Options,
    Progress,
    chosen_units,
    is_number,
    names,
    print_recording,
    print_written,
    worded_note,
    wrapped,
)

if TYPE_CHECKING:
    from helisim.ident import FrequencyResponse
    from helisim.logs import Clock, Log, Map
    from helisim.look import Look, Proposal
    from helisim.records.record import FlightRecord

Band = tuple[float, float]
_FORMS = "--band takes LO HI, or for one response p/lat=LO:HI, in rad/s"
_SAMPLES_A_PERIOD = 10.0
"""The default band ends where a period still has so many samples."""
_NAMED = re.compile(r"([^=/]+/[^=/]+)=(.+)")


class Bands(NamedTuple):
    """What --band says, rad/s.

    Attributes:
        common: of all responses that have none of their own; None leaves it to the records.
        own: by response.
    """

    common: Band | None
    own: Mapping[str, Band]

    @classmethod
    def of(cls, options: Options) -> "Bands":
        """Return what the options say. Raises InputError."""
        common, own = None, {}
        for item in [one for text in options.band for one in names(text)]:
            response, equals, edges = item.rpartition("=")
            low, _, high = edges.partition(":")
            if not (is_number(low) and is_number(high)):
                raise InputError(f"{_FORMS}; got {item!r}")
            if not equals and common is not None:
                raise InputError(f"{_FORMS}; LO HI was given twice")
            if equals:
                own[response.strip()] = float(low), float(high)
            else:
                common = float(low), float(high)
        return cls(common, own)

    def common_only(self) -> Band | None:
        """Return the common band. Raises InputError: a response has its own."""
        if self.own:
            raise InputError(
                "--band LO HI is one for all responses here; identify takes others by one"
            )
        return self.common

    def around(self, common: Band) -> Band:
        """Return the band that holds `common` and all responses' own."""
        edges = [common, *self.own.values()]
        return min(low for low, _ in edges), max(high for _, high in edges)

    def check(self, fitted: Sequence[str]) -> None:
        """Raise UnknownNameError if a band's response is not one of those fitted."""
        for response in self.own:
            if response not in fitted:
                raise UnknownNameError("response of --band", response, fitted)


class Read(NamedTuple):
    """Logs that were read, and their records in one row."""

    logs: "tuple[Log, ...]"
    records: "tuple[FlightRecord, ...]"


class Signals(NamedTuple):
    """Which channels play which part."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditioning: tuple[str, ...]
    reference: tuple[str, ...]

    @classmethod
    def of(cls, options: Options) -> "Signals":
        """Return what the options say."""
        return cls(*(getattr(options, part) or () for part in cls._fields))


class Estimated(NamedTuple):
    """Logs as they were read, their records, and the frequency response of all together.

    `band` is that of a response for which --band says nothing, rad/s.
    """

    logs: "tuple[Log, ...]"
    records: "tuple[FlightRecord, ...]"
    response: "FrequencyResponse"
    band: Band


def read_options(options: Options) -> dict[str, Any]:
    """Return what the options say of reading logs, as the library's functions take it."""
    return {
        "repair": [name for item in options.repair for name in names(item)],
        "resample_hz": options.resample,
        "max_gap": options.max_gap,
        "start": options.from_time,
        "stop": options.to_time,
    }


def read_logs(
    options: Options,
    wanted: Sequence[str] | None,
    advance: Callable[[str], None],
    *,
    moving: bool = False,
) -> Read:
    """Read all logs: uniform, with all wanted channels, which must move somewhere if `moving`.

    None wants all that the options name, or else all that state their units.
    """
    from helisim.logs import Column, read_logs

    given, time = given_columns(options)
    channels: Any = given if given.channels else None
    if wanted is not None:
        own = {name: given.channels.get(name, Column(name)) for name in wanted}
        said = options.map is not None or options.channel
        channels = replace(given, channels=own) if said else tuple(wanted)
    logs = read_logs(
        options.logs,
        channels=channels,
        wanted=wanted or (),
        moving=moving,
        time=time,
        min_duration=options.min_duration,
        use_ended=options.use_ended,
        on_progress=advance,
        **read_options(options),
    )
    return Read(logs, tuple(record for log in logs for record in log.records))


def look_at(options: Options) -> "Look":
    """Return what a look at the logs shows, by what the options say. Raises HelisimError."""
    from helisim.look import look

    channels, time = given_columns(options)
    return look(options.logs, channels=channels, time=time, **read_options(options))


@contextmanager
def located(logs: "Sequence[Log]") -> Iterator[None]:
    """Add files, columns and rows to an error about the channels that its message names."""
    try:
        yield
    except IdentificationError as error:
        if not logs:
            raise
        text = str(error)
        channels = [name for name in logs[0].headings if repr(name) in text]
        places = [log.where(name) for log in logs for name in channels] or [
            f"{log.report.path}, {log.report.counts}s {log.report.parts[0].first_row} to "
            f"{log.report.parts[-1].last_row}"
            for log in logs
        ]
        said = "; ".join(places)
        for log in logs:  # each path once
            before, path, after = said.partition(f"{log.report.path}, ")
            said = before + path + after.replace(path, "") if path else said
        raise IdentificationError(f"{said}: {text}", remedy=error.remedy) from None


def describe(logs: "Sequence[Log]") -> str:
    """Return how the logs were read."""
    return "\n".join(wrapped(log.report.worded(worded_note), indent=2) for log in logs)


def reports(logs: "Sequence[Log]") -> list[dict[str, Any]]:
    """Return how the logs were read, as plain data."""
    return [log.report.to_dict() for log in logs]


def given_columns(options: Options) -> "tuple[Map, Clock | None]":
    """Return the map that the options say, empty if they say none, and the clock."""
    from helisim.logs import Clock, Map
    from helisim.logs.mapping import named_column

    if options.time is not None and options.rate is not None:
        raise InputError("--time and --rate exclude each other: give one")
    time = None if options.rate is None else Clock(rate=options.rate)
    if options.time is not None:
        column, _, unit = options.time.partition(":")
        time = Clock(column, unit or None)
    given = Map() if options.map is None else Map.from_toml(options.map)
    try:
        return given.with_channels(dict(map(named_column, options.channel))), time
    except InputError as error:
        raise InputError(f"--channel: {error}") from None


def estimator_options(options: Options) -> dict[str, Any]:
    """Return which estimator is asked for, and how. Raises InputError."""
    asked: dict[str, Any] = {"estimator": options.estimator}
    if options.windows is not None:
        asked["windows"] = options.windows
    if options.overlap is not None:
        if options.estimator == "local":
            raise InputError("--overlap is of windows, and --estimator local has none")
        asked |= {"estimator": "windows", "overlap": options.overlap}
    return asked


def estimate(options: Options, signals: Signals, advance: Callable[[str], None]) -> Estimated:
    """Return the frequency response of the logs, whose flags say what to doubt."""
    from helisim.ident import CrossControlWarning, RecordQualityWarning, frequency_response

    inputs, outputs, conditioning, reference = signals
    wanted = tuple(dict.fromkeys((*inputs, *conditioning, *reference, *outputs)))
    with warnings.catch_warnings():
        for category in (CrossControlWarning, RecordQualityWarning):  # they are among the flags
            warnings.simplefilter("ignore", category)
        logs, records = read_logs(options, wanted, advance, moving=True)
        bands = Bands.of(options)
        common = bands.common or resolved_band(records)
        with located(logs):
            response = frequency_response(
                records,
                inputs=inputs,
                outputs=outputs,
                band=bands.around(common),
                conditioning=conditioning,
                reference=reference,
                use_ended=options.use_ended,
                **estimator_options(options),
            )
        advance("frequency responses")
    return Estimated(logs, records, response, common)


def resolved_band(records: "Sequence[FlightRecord]") -> Band:
    """Return the band that records resolve, rad/s.

    From one period in the longest window that the rules allow to ten samples a period.
    """
    durations = [record.duration for record in records]
    window = min(min(durations) / 2.0, sum(durations) / 5.0)
    low = 1.0001 * 2.0 * pi / window
    high = 2.0 * pi / (_SAMPLES_A_PERIOD * max(record.sample_time for record in records))
    if not low < high:
        raise IdentificationError(
            f"the records are too short: the shortest lasts {min(durations):.4g} s, which "
            f"resolves frequencies from {low:.4g} rad/s, and its samples up to {high:.4g} rad/s"
        )
    return low, high


def given_response(
    options: Options, inputs: Sequence[str], outputs: Sequence[str]
) -> "FrequencyResponse | None":
    """Return the frequency response that the files hold; None where they are logs."""
    from helisim.cli import parser
    from helisim.ident.response import is_response, load_response

    named: dict[str, Path] = {}
    bare = []
    for path in options.logs:
        match = None if path.exists() else _NAMED.fullmatch(str(path))
        if match is None:
            bare.append(path)
        elif match[1] in named:
            raise InputError(f"{match[1]} was given twice: {named[match[1]]} and {match[2]}")
        else:
            named[match[1]] = Path(match[2])
    if not named and options.columns is None and not any(map(is_response, bare)):
        return None
    if len(bare) + bool(named) > 1:
        raise InputError(
            f"{bare[0]} is one of several files, and frequency responses come from one file that "
            "holds all, or from one for each, named p/lat=FILE q/lon=FILE; logs can't be beside "
            "them"
        )
    usual = parser(["identify"]).parse_args(["identify", "log"])
    of_logs = ("map", "channel", "time", "rate", "resample", "repair", "max_gap", "min_duration")
    of_logs += ("use_ended", "from_time", "to_time", "conditioning", "reference", "estimator")
    of_logs += ("windows", "overlap")
    changed = [name for name in of_logs if getattr(options, name) != getattr(usual, name)]
    if changed:
        flags = ["--" + name.removesuffix("_time").replace("_", "-") for name in changed]
        raise InputError(
            f"{', '.join(flags)}: of logs, and the files hold frequency responses; estimate them "
            "anew from the logs, or leave it out"
        )
    if named:
        return load_response(named, columns=options.columns)
    alone = f"{outputs[0]}/{inputs[0]}" if len(inputs) == len(outputs) == 1 else None
    return load_response(bare[0], columns=options.columns, unnamed=alone)


def frf(o: Options) -> int:
    """Estimate frequency responses from flight logs.

    Estimate frequency responses with coherence and random error from flight logs, by anyone, other
    inputs' effects removed.

    Options:
        @logs
        how frequency responses are estimated:
        --inputs A,B <must names>  channels that drive the vehicle
        --outputs P,Q <must names>  channels that answer, such as rates
        --conditioning C,D <names>  further inputs that moved too: their effect is taken out
        --reference A,B <names>  signals outside the loop, such as the sticks: joint input-output
            method, which feedback and gusts don't bias
        --band LO HI <many>  lowest and highest frequency, rad/s (default: what the records resolve)
        @estimator
        options:
        --json FILE <.json>  write everything, .json
        --csv FILE <.csv>  write the responses, .csv
        @units: the responses in --csv
        @quiet

    example:
      helisim frf lat.csv --map heli.toml --inputs lat --outputs p,q \\
          --conditioning lon --csv p.csv

    @about_maps
    """
    from helisim.ident.response import save_response

    Bands.of(o).common_only()
    units = chosen_units(o)
    with Progress(len(o.logs) + 1, o.quiet) as advance:
        logs, _, frf, _ = estimate(o, Signals.of(o), advance)
    print(f"{describe(logs)}\n")
    print("\n".join(_table(frf)))
    if o.json is not None:
        save_response(frf, o.json, {"logs": reports(logs)})
    if o.csv is not None:
        save_response(frf.in_units(units) if units else frf, o.csv)
    print_written(o, o.json, o.csv)
    return 0


def _table(frf: "FrequencyResponse") -> list[str]:
    """Return a line for each response: where it is usable and how well it is known."""
    from helisim.ident import USABLE_COHERENCE

    width = max(8, *map(len, frf.pairs))
    lines = [f"{'response':<{width}}  usable band, rad/s   coherence  random error, %"]
    usable = frf.usable()
    for name in frf.pairs:
        at = frf.index(*name.split("/", 1))
        where = usable[at]
        said = f"nowhere: coherence below {USABLE_COHERENCE} at all frequencies"
        if where.any():
            inside, coherence = frf.frequency[where], frf.coherence[at][where].mean()
            error = 100.0 * frf.random_error[at][where].mean()
            said = f"{inside[0]:8.3g} to {inside[-1]:<7.3g}  {coherence:9.3f}  {error:15.2g}"
        lines.append(f"{name:<{width}}  {said}")
    return lines + list(frf.flags)


def look(o: Options) -> int:
    """Look at flight logs of which nothing is known, and say what to run next.

    Print the channels of flight logs with guessed units, rates, gaps and jitter, what was swept and
    when, which channels answer and in which band, closed loops, what can't be as it is declared,
    and the `helisim identify` to run next.

    Options:
        @logs
        options:
        --json FILE <.json>  write what was found, .json
        @quiet

    example:
      helisim look flight.ulg
      helisim look lat.csv lon.csv --channel p=gyro_x:deg/s --json look.json

    Nothing need be known of the logs: what the options don't say is guessed, with
    the reason. Exit status 1: nothing can be identified from them.

    @about_maps
    """
    from helisim.base.files import write_json

    found = look_at(o)
    for log in found.logs:
        print(wrapped(log.worded(worded_note), indent=4))
    print()
    doubts = {one.kind for log in found.logs for one in log.findings}
    command = "" if found.proposal is None else command_line(found.proposal)
    if command and doubts & {"sign", "axes", "scale"}:  # which the command doesn't mend
        print(wrapped("settle first what is marked ! above: what follows takes columns as named\n"))
    # one line, so that it can be pasted
    print(f"run next:\n{command}" if command else "nothing can be identified from this")
    if o.json is not None:
        write_json({**found.to_dict(), "command": command}, o.json)
        print_written(o, o.json)
    return 0 if command else 1


def command_line(proposal: "Proposal") -> str:
    """Return a proposal as a line that works when it is pasted."""
    words = ["helisim", proposal.command, *proposal.logs]
    for name, values in proposal.options:
        words += [f"--{name.replace('_', '-')}", *values]
    return shlex.join(words)


def examples(o: Options) -> int:
    """List recorded logs that come with helisim, or copy them.

    List the recorded logs that come with helisim, or copy them into a folder, where the other
    commands read them as they read anyone's.

    Options:
        --to FOLDER  copy them there
        @quiet

    example:
      helisim examples --to logs
      helisim identify logs/sweep_lat.parquet logs/sweep_lon.parquet \\
          --structure rollpitch --band 3 42 --json rollpitch.json
      helisim verify rollpitch.json logs/doublet_lat.parquet
      helisim identify logs/logger.csv --map logs/logger.toml --structure tf:0/2 \\
          --inputs lat --outputs p --band 3 25
    """
    from helisim.logs.examples import copy_examples, examples

    if o.to is not None:
        copied = copy_examples(o.to)
        print_written(o, f"{len(copied)} files in {o.to}")
        return 0
    found = examples().values()
    width = max(len(one.name) for one in found)
    for one in found:
        print(f"{one.name:<{width}}  {one.meaning}")
    return 0


def record(o: Options) -> int:
    """Turn flight records into a Rerun recording.

    Turn flight records (.parquet or .csv) into a Rerun recording: the helicopter in space and its
    signals over time. A folder that helisim reproduce wrote gives the flights that the run used,
    and what was found from them.

    Options:
        logs LOG <many>  record, or folder of a run
        --out FILE <must .rrd>  recording to write, .rrd
        --vehicle VEHICLE  to draw, a name or the path of a folder (default: the shipped one that
            flew)
        @quiet

    example: helisim record lat.parquet --out lat.rrd
    """
    from helisim.records.storage import read_record
    from helisim.show.recording import write_recording
    from helisim.show.scene import knows_rotor
    from helisim.study.results import FLIGHTS, read_run
    from helisim.vehicle import load

    run, paths = None, []
    for log in o.logs:
        if not log.is_dir():
            paths.append(log)
            continue
        if run is not None:
            raise InputError("give one folder of a run, got several")
        run = read_run(log)
        found = sorted((log / FLIGHTS).glob("[!.]*.parquet"))
        paths += [path for path in found if path.stem not in run.results.left_out]
    twins = [name for name, count in Counter(path.stem for path in paths).items() if count > 1]
    if twins:
        raise InputError(f"two logs are called {twins[0]!r}; rename one")
    flights = {}
    with Progress(2 * len(paths), o.quiet) as advance:
        for path in paths:
            flights[path.stem] = read_record(path)
            advance(f"{path.stem} read")
        drawn = load(o.vehicle or _flown_by(flights))
        model, roles = drawn.visual_model(), drawn.roles
        write_recording(o.out, flights, model=model, roles=roles, run=run, on_progress=advance)
    print_recording(o.out, o.quiet)
    if run is not None and run.results.left_out and not o.quiet:
        left = ", ".join(sorted(run.results.left_out))
        print(
            wrapped(f"Left out by the run, so not recorded: {left}; give their files to see them.")
        )
    plain = [name for name, one in flights.items() if not knows_rotor(one)]
    if plain and not o.quiet:
        which = "the flights have" if len(plain) == len(flights) else f"{', '.join(plain)} has"
        which = "the flight has" if len(flights) == 1 else which
        print(
            wrapped(
                f"Without thrust arrows and disc tilt: {which} no rotor channels; fly with helisim "
                "fly --rotor, or reproduce with --rerun, to record them."
            )
        )
    return 0


def _flown_by(flights: "Mapping[str, FlightRecord]") -> str:
    """Return the vehicle to draw: the one that flew, and the JR700 for other people's logs."""
    from helisim.vehicle.folder import vehicle_names

    named = {record.provenance.get("vehicle") for record in flights.values()}
    flew = sorted(name for name in named if isinstance(name, str))
    if len(flew) > 1:
        raise InputError(f"one recording draws one vehicle, got {', '.join(flew)}")
    if flew and flew[0] not in vehicle_names():
        raise InputError(
            f"flown by {flew[0]!r}, which is not one of the shipped vehicles "
            f"({', '.join(vehicle_names())}): give its folder with --vehicle PATH"
        )
    return flew[0] if flew else "jr700"
