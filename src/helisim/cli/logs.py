"""Commands that read flight logs: look at them, estimate their frequency responses, draw them."""

import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import IdentificationError, InputError
from helisim.base.settings import grouped
from helisim.cli.options import (
    Options,
    names,
    print_rows,
    print_written,
    progress,
    worded_note,
    wrapped,
    write_data,
    write_recording,
)

if TYPE_CHECKING:
    from helisim.ident import FrequencyResponse
    from helisim.logs import Log, Map
    from helisim.look import Proposal
    from helisim.records.record import FlightRecord

Band = tuple[float, float]


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
) -> "tuple[Log, ...]":
    """Read all logs: uniform, with all wanted channels, by default those that options name."""
    from helisim.logs import Column, read_logs
    from helisim.records.record import ATTITUDES, IN2

    given = given_columns(options)
    channels: Any = given if given.channels or options.names or options.log else None
    if wanted is not None:
        # angles tell wrong rates, and sticks are outside the loop
        beside = [name for name in (*ATTITUDES, *IN2) if name in given.channels]
        own = {name: given.channels.get(name, Column(name)) for name in (*wanted, *beside)}
        said = options.map is not None or options.channel or options.names
        channels = replace(given, channels=own) if said else given if options.log else tuple(wanted)
    return read_logs(
        options.logs,
        channels=channels,
        wanted=wanted or (),
        time=given.time,
        min_duration=options.min_duration,
        use_ended=options.use_ended,
        on_progress=advance,
        **read_options(options),
    )


def records_of(logs: "Sequence[Log]") -> "tuple[FlightRecord, ...]":
    """Return the records of all logs in one row."""
    return tuple(record for log in logs for record in log.records)


@contextmanager
def located(logs: "Sequence[Log]") -> Iterator[None]:
    """Add files, columns and rows to an error about the channels that its message names."""
    try:
        yield
    except IdentificationError as error:
        text = str(error)
        places = [log.where(name) for log in logs for name in log.headings if repr(name) in text]
        if not places:
            files = grouped((log.report for log in logs), lambda one: str(one.path))
            places = [
                f"{path}, "
                + ", ".join(
                    f"{one.counts}s {one.parts[0].first_row} to {one.parts[-1].last_row}"
                    for one in mine
                )
                for path, mine in files.items()
            ]
        raise IdentificationError(f"{'; '.join(places)}: {text}", remedy=error.remedy) from None


def describe(logs: "Sequence[Log]") -> str:
    """Return how the logs were read."""
    return "\n".join(wrapped(log.report.worded(worded_note), indent=2) for log in logs)


def reports(logs: "Sequence[Log]") -> list[dict[str, Any]]:
    """Return how the logs were read, as plain data."""
    return [log.report.to_dict() for log in logs]


def given_columns(options: Options) -> "Map":
    """Return the map that the options say, with the clock; empty if they say none."""
    from helisim.base.settings import placed
    from helisim.logs import Clock, Map
    from helisim.logs.mapping import named_column

    given = Map() if options.map is None else Map.from_toml(options.map)
    if options.time is not None:
        given = replace(given, time=Clock.of(options.time))
    if options.names or options.log:
        given = replace(
            given,
            file=replace(
                given.file,
                names=options.names or given.file.names,
                log=options.log or given.file.log,
            ),
        )
    with placed("--channel"):
        return given.with_channels(dict(map(named_column, options.channel)))


def read_roles(
    options: Options,
    inputs: Sequence[str],
    outputs: Sequence[str],
    advance: Callable[[str], None],
) -> "tuple[Log, ...]":
    """Return the logs with inputs, outputs, and what else options say of an estimate."""
    told = [name for name in options.reference if name != "none"]
    wanted = (*inputs, *options.conditioning, *told, *outputs)
    return read_logs(options, tuple(dict.fromkeys(wanted)), advance)


def estimate(
    logs: "Sequence[Log]",
    options: Options,
    inputs: Sequence[str],
    outputs: Sequence[str],
    advance: Callable[[str], None],
) -> "FrequencyResponse":
    """Return the frequency response of logs, whose flags say what to doubt.

    Where the inputs' sticks are recorded and excite them, they are the reference.
    """
    from helisim.ident.frf import estimated

    with located(logs):
        response = estimated(
            records_of(logs),
            inputs=inputs,
            outputs=outputs,
            conditioning=options.conditioning,
            reference=options.reference,
            band=options.band and tuple(options.band),
            use_ended=options.use_ended,
            estimator=options.estimator or "local",
        )
    advance("frequency responses")
    return response


def frf(o: Options) -> None:
    """Estimate frequency responses from flight logs.

    Estimate frequency responses with coherence and random error, other inputs' effects removed.

    Options:
        @logs
        how frequency responses are estimated:
        --inputs A,B <must names>  channels that drive
        --outputs P,Q <must names>  channels that respond
        --conditioning C,D <names =>  further inputs that moved: effect removed
        @reference
        --band LO HI  rad/s (default: what the records resolve)
        @estimator
        options:
        @json: everything
        --csv FILE <.csv>  write the responses, .csv
        @quiet

    example:
      helisim frf lat.csv --map heli.toml --inputs lat --outputs p,q \\
          --conditioning lon --csv p.csv
    """
    from helisim.ident.response import response_data
    from helisim.show.table import as_text
    from helisim.show.tables import usable_bands

    with progress(len(o.logs) + 1, o.quiet) as advance:
        logs = read_roles(o, o.inputs, o.outputs, advance)
        frf = estimate(logs, o, o.inputs, o.outputs, advance)
    print(f"{describe(logs)}\n")
    print("\n".join((as_text(usable_bands(frf)), *frf.flags, *map(str, frf.evidence))))
    write_data(o, {**response_data(frf), "logs": reports(logs)})
    if o.csv is not None:
        frf.save(o.csv)
    print_written(o, o.csv)


def look(o: Options) -> int:
    """Look at unknown flight logs, and say what to run next.

    Print channels with guessed units, rates, gaps and jitter, sweeps, channels that respond and
    their bands, closed loops, faults, and the `helisim identify` to run next.

    Options:
        @logs
        options:
        @json: what was found
        @quiet

    example:
      helisim look flight.ulg
      helisim look lat.csv lon.csv --channel p=gyro_x:deg/s --json look.json

    Exit status 1: nothing can be identified from the logs.
    """
    from helisim.look import look

    columns = given_columns(o)
    found = look(o.logs, channels=columns, time=columns.time, **read_options(o))
    for log in found.logs:
        print(wrapped(log.worded(worded_note), indent=4))
    print()
    doubts = {one.kind for log in found.logs for one in log.findings}
    command = "" if found.proposal is None else command_line(found.proposal)
    if command and doubts & {"sign", "axes", "scale"}:  # which the command doesn't mend
        print(wrapped("settle first what is marked ! above: what follows takes columns as named\n"))
    # one line, so that it can be pasted
    print(f"run next:\n{command}" if command else "nothing can be identified from this")
    write_data(o, {**found.to_dict(), "command": command})
    return 0 if command else 1


def command_line(proposal: "Proposal") -> str:
    """Return a proposal as a line that works when it is pasted."""
    given = [[f"--{name.replace('_', '-')}", *values] for name, values in proposal.options]
    return shlex.join(["helisim", proposal.command, *proposal.logs, *chain(*given)])


def examples(o: Options) -> None:
    """List recorded logs that come with helisim, or copy them.

    List the recorded logs that come with helisim, or copy them into a folder.

    Options:
        --to FOLDER  copy them there
        @quiet

    example:
      helisim examples --to logs
      helisim identify logs/sweep_lat.parquet logs/sweep_lon.parquet \\
          --structure rollpitch_speeds --band 3 42 --json rollpitch.json
      helisim verify rollpitch.json logs/doublet_lat.parquet
      helisim identify logs/logger.csv --map logs/logger.toml --structure tf:0/2 \\
          --inputs lat --outputs p --band 3 25
    """
    from helisim.logs.examples import copy_examples, examples

    if o.to is not None:
        print_written(o, f"{len(copy_examples(o.to))} files in {o.to}")
    else:
        print_rows({one.name: one.meaning for one in examples().values()})


def rerun(o: Options) -> None:
    """Turn flight records into a Rerun recording.

    Turn flight records (.parquet or .csv), or those that a run of helisim reproduce used, into a
    Rerun recording: the helicopter in space and its signals over time.

    Options:
        logs LOG <some>  record, or folder of a run
        --out FILE <must .rrd>  recording to write, .rrd
        --vehicle VEHICLE  to draw, name or folder (default: the one that flew)
        @quiet

    example: helisim rerun lat.parquet --out lat.rrd
    """
    from helisim.records.storage import read_record
    from helisim.study.results import FLIGHTS, read_run
    from helisim.vehicle.parameters import vehicle_names

    paths: list[Path] = []
    for log in o.logs:
        if log.is_dir():
            left_out = read_run(log).results.left_out
            found = sorted((log / FLIGHTS).glob("[!.]*.parquet"))
            paths += [path for path in found if path.stem not in left_out]
        else:
            paths.append(log)
    flights = {path.stem: read_record(path) for path in paths}
    if len(flights) < len(paths):
        raise InputError("two logs have the same name; rename one")
    flew = {str(record.provenance.get("vehicle", "jr700")) for record in flights.values()}
    if o.vehicle is None and not (len(flew) == 1 and flew <= {*vehicle_names()}):
        raise InputError(
            f"flown by {', '.join(map(repr, sorted(flew)))}: a recording draws one vehicle, by "
            "default a shipped one; give yours with --vehicle PATH"
        )
    write_recording(o, o.out, flights, o.vehicle or flew.pop())
