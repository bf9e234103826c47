"""Commands about control laws: design one, measure the margins of one that flew, tune one."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.cli.logs import describe, located, read_logs, records_of, reports
from helisim.cli.options import (
    Options,
    coloured,
    numbers_by_name,
    opened,
    print_written,
    progress,
    replace_parameter_file,
    wrapped,
    write_data,
)

if TYPE_CHECKING:
    from helisim.handling.measured.margins import Cut, MeasuredMargins
    from helisim.look.loops import FlownLoops

GUST = "gust.rrd"  # How a gust is rejected, before and after


def design(o: Options) -> int:
    """Design a control law on identified models, and prove it in flight.

    Identify a vehicle from records, find the parameters of a control law that meet specifications
    in the worst of the possible models, fly it on the nonlinear vehicle, and print what was asked,
    predicted, exact and flown.

    Options:
        source RUN <any>  folder of helisim reproduce (default: reproduction), or flight records of
            sweeps
        --vehicle FOLDER <text>  that flew, name or folder (default: as the records say)
        --specs FILE  specifications, TOML (default: 45 deg, 6 dB, scaled ADS-33, and rejection)
        --law FILE  law to tune, TOML (default: attitude command with the inverse model)
        --out DIR <=design>  folder (default: design)
        --no-proof  don't fly the law
        --margin M <float =0.1>  share of the distance between Levels 1 and 2 (default: 0.1)
        --models N <=20>  samples to design with (default: 20)
        @seed: of draws and flights
        @quiet

    examples:
      helisim reproduce
      helisim design                              all of it, into design/
      helisim design --specs specs.toml --no-proof
      helisim fly --controller design/law.toml

    Exit status 1: a level is missed. 2: a specification can't be met.
    """
    from helisim.base.files import make_folder
    from helisim.design.laws import read_law
    from helisim.handling.spec import read_specs
    from helisim.records.storage import read_record
    from helisim.show import tables
    from helisim.show.design_page import REPORT, verdict, write_design_page
    from helisim.show.table import as_text, filled
    from helisim.study.design_chain import (
        LAW,
        PROOF,
        RESULT,
        run_design,
        write_design,
    )
    from helisim.vehicle import load

    paths: list[Path] = o.source or [Path("reproduction")]
    folder = len(paths) == 1 and (paths[0].is_dir() or not paths[0].suffix)
    with progress(None, o.quiet) as advance:
        run = run_design(
            paths[0] if folder else [read_record(path) for path in paths],
            vehicle=None if o.vehicle is None else load(o.vehicle),
            law=None if o.law is None else read_law(o.law),
            specs=None if o.specs is None else read_specs(o.specs),
            seed=o.seed,
            proof=not o.no_proof,
            margin=o.margin,
            models=o.models,
            on_step=advance,
        )
        make_folder(o.out)
        write_design(run, o.out)
        write_design_page(
            o.out / REPORT,
            run.result,
            proof=run.proof,
            predicted=run.loop(run.result.law),
            before=run.loop(run.result.before),
        )
        if run.proof is not None:
            record_gust(run, o.out / GUST)
    print(f"{filled(verdict(run.result, run.proof))}\n")
    print(coloured(as_text(tables.design(run.result))))
    if run.proof is not None:
        print(as_text(tables.proof(run.proof)))
    for miss in (*run.result.misses, *(run.proof.misses if run.proof else ())):
        print(f"- {miss}")
    print_written(o, f"{o.out / LAW}: helisim fly --controller {o.out / LAW}", o.out / RESULT)
    print_written(o, f"{o.out / REPORT}: charts with levels, loops, steps")
    if run.proof is not None:
        print_written(o, f"{o.out / PROOF}: the flights of the proof", opened(o.out / GUST))
    return 0 if run.met else 1


def record_gust(run: Any, path: Path) -> None:
    """Write how the vehicle's own gyro and the designed law reject one gust."""
    from helisim.show.recording import write_recording

    flights = {"shipped gyro": run.proof.before["gust"], "designed law": run.proof.events["gust"]}
    write_recording(path, flights, model=run.vehicle.visual_model())


def margins(o: Options) -> int:
    """Measure margins and disturbance rejection from flight logs.

    Measure a closed loop in which something was injected that the control law doesn't know:
    crossover, margins, disturbance rejection bandwidth and peak, bandwidth and phase delay, with
    95 % intervals and without a model.

    Options:
        @logs
        what was injected:
        --axis A,B <names>  lat, lon, ped, col or roll, ... (default: all)
        --at PLACE  of the cut: actuators, or sensors (attitude; default: as channels' names say,
            else actuators)
        --injected C,D <names>  channel of what was added, one each axis
        --returned C,D <names>  channel of what returns, before the sum
        --total C,D <names>  channel of their sum; of both, one is enough
        how it is measured:
        --band LO HI  rad/s (default: where the injection has power)
        --late NAME=S <many>  lateness of a channel's record, s; repeatable
        options:
        @json: the figures
        --report FILE <.html>  page with the loops, .html
        @quiet

    example:
      helisim margins flight.bin
      helisim fly --axis ped --at actuators --excitation \\
          chirp,amplitude=0.05,band=2:90 --set pilot.k_heading=0 --out loop.parquet
      helisim margins loop.parquet
      helisim margins flight.ulg --map heli.toml --axis lat --injected dither \\
          --total mixer_in --returned rate_out --band 2 60

    Channels lat_disturbance (added to lat) and lat_sum (the sum), or phi_ likewise,
    and logs of ArduPilot's mode SystemID (SID_AXIS 10 to 12) need no options.

    Exit status 1: none of the figures could be measured.
    """
    from helisim.handling.measured.margins import margins
    from helisim.logs.dataflash import is_dataflash

    how = {"axes": o.axis, "at": o.at, "band": o.band and tuple(o.band)}
    named = any((o.injected, o.total, o.returned, o.map, o.channel))
    if not named and all(path.is_file() and is_dataflash(path) for path in o.logs):
        found, measured = _flown_loops(o, how)
        said: list[Any] = [
            {"path": path, "sweeps": [one.to_dict() for one in used]}
            for path, used in found.logs.items()
        ]
        print_loops(found, measured)
    else:
        cuts = _cuts(o)
        wanted = None if cuts is None else [n for cut in cuts for n in (cut.injected, *cut.outputs)]
        with progress(len(o.logs) + 1, o.quiet) as advance:
            logs = read_logs(o, wanted, advance)
            with located(logs):
                late = numbers_by_name("--late", o.late)
                measured = margins(records_of(logs), cuts=cuts, late=late, **how)
            advance("margins")
        said = reports(logs)
        print(f"{describe(logs)}\n")
        print_loops(None, measured)
    write_data(o, {**measured.to_dict(), "logs": said})
    if o.report is not None:
        from helisim.show.report import write_margins_report

        print_written(o, write_margins_report(o.report, measured))
    return 0 if measured.figures else 1


def _flown_loops(o: Options, how: dict[str, Any]) -> "tuple[FlownLoops, MeasuredMargins]":
    """Return the loops that logs of SystemID cut, and their margins. Raises InputError."""
    from helisim.look.loops import flown_loops

    of_channels = ("time", "resample", "repair", "max_gap", "min_duration", "late")
    unused = [f"--{name.replace('_', '-')}" for name in of_channels if getattr(o, name)]
    if unused:
        raise InputError(
            f"{', '.join(unused)}: of channels that --injected, --total and --channel name; sweeps "
            "of an autopilot are read at its own ticks"
        )
    with progress(2, o.quiet) as advance:
        found = flown_loops(o.logs, start=o.from_time, stop=o.to_time)
        advance("logs")
        measured = found.margins(**how)
        advance("margins")
    print(wrapped(str(found), indent=4), end="\n\n")
    return found, measured


def print_loops(found: "FlownLoops | None", measured: "MeasuredMargins") -> None:
    """Print the figures of loops, and what is to be known of them."""
    from helisim.show.table import as_text, filled
    from helisim.show.tables import measured_margins

    if measured.figures:
        print(as_text(measured_margins(measured)))
    for remark in (*measured.remarks, *(found.remarks if found else ())):
        print(filled(remark))


def _cuts(o: Options) -> "tuple[Cut, ...] | None":
    from helisim.handling.measured.margins import Cut

    if not o.injected:
        if o.total or o.returned:
            raise InputError("--total and --returned need --injected: what was added there")
        return None
    for flag, given in (("--axis", o.axis), ("--total", o.total), ("--returned", o.returned)):
        if len(given or ()) != len(o.injected) and (given or flag == "--axis"):
            raise InputError(
                f"--injected names {len(o.injected)} channel(s) and {flag} {len(given or ())}; "
                "expected one of each for every axis"
            )
    nothing = (None,) * len(o.injected)
    parts = zip(o.axis, o.injected, o.total or nothing, o.returned or nothing)
    return tuple(
        Cut(axis, o.at or "actuators", added, both, back) for axis, added, both, back in parts
    )


def tune(o: Options) -> int | None:
    """Find better gains, of an autopilot from its log, or of the gyro.

    From logs of SystemID's sweeps: identify models, print what today's gains give and what better
    ones will, with 95 % intervals; print tones of the gyros and what notches leave of them; write
    gains and notches as parameters. From logs without sweeps: feed-forward and today's loops, by
    stick steps or AutoTune's tests, and vibration. From Blackbox logs of Rotorflight: today's loops
    and better gains by ordinary flying, as text for its command line. Without a log: solve for the
    gyro's settings that give the published models from the sticks (JR700: eq. (8), IN2 of Table 3),
    or the rate command of its parameters; print the loops' margins.

    Options:
        logs LOG <any>  of ArduCopter-heli, .bin, best with sweeps by its mode SystemID, and of a
            hover in wind beside them; or Blackbox of Rotorflight
        --out FILE <.param .parm .txt =tuned.param>  the new parameters (default: tuned.param)
        --report FILE <.html>  page on the flight, .html
        --rpm RPM <float>  of the main rotor (default: RPM messages, or the tones' own)
        --dump FILE <path>  of Rotorflight's command line (diff all), for what its log lacks
        --tail-ratio X <float>  turns of the tail rotor for one of it (default: by the tones)
        @json: of logs, what was found
        without a log:
        @vehicle
        @write: tuned.toml
        options:
        @quiet

    examples:
      helisim tune flight.bin           margins of today, and better gains
      helisim tune --vehicle jr700      the gyro's settings

    A gain is proposed only if gain margin (6 dB), phase margin (45 deg) and peak
    (5 dB) hold for 95 % of the models as likely as the identified one.

    Exit status 1: no axis has better gains, and no notch is needed.
    """
    if o.logs:
        return tune_logs(o)
    from helisim.study.tune import LOOPS, margins, tune
    from helisim.vehicle import load
    from helisim.vehicle.parameters import to_toml

    vehicle = load(o.vehicle, tuned=False)
    with progress(None, o.quiet, unit="trial") as advance:
        settings = tune(vehicle, on_progress=advance)
    text = to_toml(settings, "Written by `helisim tune --write`; not by hand.")
    print(text)
    print("# Margins: loop, gain (dB), phase (deg), crossover (rad/s)")
    tuned = vehicle.with_settings(dict(settings))
    for axis in LOOPS:
        left = margins(tuned, axis)
        print(f"# {axis} {left.gain_db:6.1f} {left.phase_deg:6.1f} {left.crossover:6.1f}")
    if o.write:
        replace_parameter_file(o, "tuned.toml", text)


def tune_logs(o: Options) -> int | None:
    """Print today's figures and better gains of logs, and write what options ask for."""
    from helisim.logs.blackbox import is_blackbox
    from helisim.show import tables
    from helisim.show.report import write_flight_report
    from helisim.show.table import as_text, filled
    from helisim.study.log_tune import tune_log
    from helisim.study.rotorflight_tune import tune_blackbox

    blackbox = all(map(is_blackbox, o.logs))
    with progress(3 if blackbox else 4, o.quiet) as advance:
        if blackbox:
            found = tune_blackbox(o.logs, dump=o.dump, on_step=advance)
        elif o.dump is not None:
            raise InputError("--dump is of Rotorflight's command line; these are other logs")
        else:
            found = tune_log(
                o.logs, rotor_hz=o.rpm and o.rpm / 60.0, tail=o.tail_ratio, on_step=advance
            )
    for one in found.axes:
        print(f"{as_text(tables.tuning(one))}\n")
        if one.why:
            print(f"{filled(f'no new gains: {one.why}')}\n")
    if found.changes:
        print(as_text(tables.changes(found.changes)))
    if found.vibration is not None:
        print(as_text(tables.vibration(found.vibration, found.crossovers)))
    for remark in found.remarks:
        print(filled(remark, "- "))
    write_data(o, found.to_dict())
    if o.report is not None:
        print_written(o, write_flight_report(o.report, found))
    if not found.parameters.settings:
        return 1
    found.parameters.write(o.out)
    use = "paste it into the command line" if blackbox else "load it by a ground station"
    print_written(o, f"{o.out}: {use}, and fly again")
