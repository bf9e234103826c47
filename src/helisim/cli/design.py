"""Commands about control laws: design one, look at one, measure the margins of one that flew."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.logs import Bands, describe, located, read_logs, reports
from helisim.cli.options import (
    Options,
    Progress,
    print_json,
    print_recording,
    print_written,
    wrapped,
)

if TYPE_CHECKING:
    from helisim.handling.measured.margins import Cut, MeasuredMargins
    from helisim.look.loops import FlownLoops

GUST = "gust.rrd"
"""How a gust is rejected, before and after."""
_STICKS = {"theta": "LON", "phi": "LAT", "r": "PED"}
_GAINS = {"theta": 0.6, "phi": 0.6, "r": 3.0}
_ERRORS = {"theta": 0.1, "phi": 0.1, "r": 0.3}
_RATES = {"p": 0.4, "q": 0.4}
_DISTURBANCE = {"lon": 0.05, "lat": 0.05, "ped": 0.02}


def design(o: Options) -> int:
    """Design a control law on identified models, and prove it in flight.

    Identify a vehicle from the records of helisim reproduce, find the parameters of a control law
    that meet specifications in the worst of the models that the records leave possible, fly it on
    the nonlinear vehicle, and hold what was asked, predicted, exact and flown side by side.

    Options:
        source RUN <any>  folder of helisim reproduce (default: reproduction), or flight records of
            sweeps
        --vehicle FOLDER <text>  that flew the records, a shipped one's name or a folder (default:
            as they say)
        --specs FILE  specifications, TOML (default: margins of 45 deg and 6 dB; ADS-33 and
            disturbance rejection, scaled; 1.3 times the rejection bandwidth of the gyro in roll
            and pitch)
        --law FILE  law whose parameters are moved, TOML (default: attitude command with the
            inverse of the identified model)
        --out DIR <=design>  folder (default: design)
        --no-proof  don't fly the law
        --margin M  design margin, as a share of the distance between Levels 1 and 2 (default: 0.1)
        --models N  drawn to design with (default: 20)
        --drawn N  drawn to judge by (default: 200)
        @seed: of draws and flights
        --json  print the result as JSON, no table
        @quiet

    examples:
      helisim reproduce
      helisim design                              all of it, into design/
      helisim design --specs specs.toml --no-proof
      helisim fly --controller design/law.toml

    Exit status 1: a level is missed, in a model drawn or in flight. 2: a
    specification can't be met, or the input is at fault.
    """
    from helisim.base.files import make_folder
    from helisim.design.laws import read_law
    from helisim.handling.spec import read_specs
    from helisim.records.storage import read_record
    from helisim.show.design_page import REPORT, write_design_page
    from helisim.study.design_chain import DesignOptions, run_design, write_design
    from helisim.vehicle import load

    given = {name: getattr(o, name) for name in ("margin", "models", "drawn")}
    given = {name: value for name, value in given.items() if value is not None}
    paths: list[Path] = o.source or [Path("reproduction")]
    folder = len(paths) == 1 and (paths[0].is_dir() or not paths[0].suffix)
    specs = None if o.specs is None else read_specs(o.specs)
    law = None if o.law is None else read_law(o.law)
    vehicle = None if o.vehicle is None else load(o.vehicle)
    with Progress(None, o.quiet) as advance:
        run = run_design(
            paths[0] if folder else [read_record(path) for path in paths],
            vehicle=vehicle,
            law=law,
            specs=specs,
            options=DesignOptions(seed=o.seed, proof=not o.no_proof, **given),
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
    if o.json:
        print_json({"design": run.result.to_dict(), "proof": run.proof and run.proof.to_dict()})
    else:
        _print_design(o, run, o.out / REPORT)
    return 0 if run.met else 1


def _print_design(o: Options, run: Any, report: Path) -> None:
    from helisim.show import tables
    from helisim.show.table import as_text
    from helisim.show.terminal import wants_color
    from helisim.study.design_chain import LAW, PROOF, RESULT, flown_figures

    flown = None if run.proof is None else flown_figures(run.proof)
    print(as_text(tables.design(run.result, flown), color=wants_color(sys.stdout)))
    for miss in (*run.result.misses, *(run.proof.misses if run.proof else ())):
        print(f"- {miss}")
    print_written(o, f"{o.out / LAW}: helisim fly --controller {o.out / LAW}", o.out / RESULT)
    print_written(o, f"{report}: charts with levels, loops, steps")
    if run.proof is not None:
        print_written(o, f"{o.out / PROOF}: the flights of the proof")
        print_recording(o.out / GUST, o.quiet)


def record_gust(run: Any, path: Path) -> None:
    """Write how the vehicle's own gyro and the designed law reject one gust, side by side."""
    from helisim.show.recording import write_recording

    flights = {"shipped gyro": run.proof.before["gust"], "designed law": run.proof.flights.gust}
    model, roles = run.vehicle.visual_model(), run.vehicle.roles
    write_recording(path, flights, model=model, roles=roles, side_by_side=True)


def law(o: Options) -> int:
    """Show a control law's file, or make an LQG law from flights.

    Show what a control law's file says, as words or matrices, and make LQG laws of what flights
    identify.

    examples:
      helisim reproduce --out reproduction
      helisim law lqg reproduction --out lqg.toml
      helisim law show lqg.toml
      helisim fly --axis lat --controller lqg.toml --out lat.parquet
    """
    raise NotImplementedError(o.part)


def law_show(o: Options) -> int:
    """What a law sees, commands and keeps.

    Print a law's inputs, commands, poles and parameters, or its matrices.

    Options:
        law LAW <path>  its file, .toml
        --period S  of its ticks, s (default: its own, or 0.002)
        --json  its sampled matrices and names as JSON

    example: helisim law show law.toml --json > matrices.json
    """
    from helisim.design.laws import StateSpaceLaw, read_law
    from helisim.show.terminal import law_text

    law = read_law(o.law)
    own = law.period if isinstance(law, StateSpaceLaw) else 0.002
    period = own if o.period is None else o.period
    if not period > 0.0:
        raise InputError(f"--period must be above 0 s, got {period:g}")
    if not o.json:
        print(law_text(law, period))
        return 0
    known: Any = law.linear(period)
    linear = known.sampled
    matrices = {name: getattr(linear, name).tolist() for name in ("a", "b", "c", "d")}
    facts = {"period": period, "inputs": list(linear.inputs), "outputs": list(linear.outputs)}
    print_json({**facts, **matrices})
    return 0


def law_lqg(o: Options) -> int:
    """Make an LQG law of what sweeps identify.

    Identify the aircraft from sweeps, make an LQG law of it that commands roll and pitch attitude
    and yaw rate, and print the margins that the models predict. Each number is a size of what
    counts as much as any other's.

    Options:
        source FOLDER  of helisim reproduce, or of sweeps
        --out FILE <must .toml>  the law, .toml
        --gain NAME=X,... <named>  of a whole stick, rad, of r rad/s (default:
            theta=0.6,phi=0.6,r=3)
        --error NAME=X,... <named>  that is borne, rad, of r rad/s (default:
            theta=0.1,phi=0.1,r=0.3)
        --rate NAME=X,... <named>  that is borne, rad/s (default: p=0.4,q=0.4)
        --effort NAME=X,... <named>  that is borne, unitised (default: lat=0.1)
        --disturbance NAME=X,... <named>  of a command that is expected, rms, unitised (default:
            lon=0.05,lat=0.05,ped=0.02)
        --noise NAME=X,... <named>  of what is sensed, rms, SI (default: p=0.01)
        --frequency W <float =6>  of the command models, rad/s (6)
        @quiet

    example: helisim law lqg reproduction --error phi=0.05 --out lqg.toml
    """
    from helisim.design.lqg import LqgWeights, Tracked, lqg
    from helisim.handling.closed_loop import ClosedLoop
    from helisim.show.table import as_text
    from helisim.show.tables import loop_margins
    from helisim.study.design_chain import identify_for_design

    for option, given in (("gain", o.gain), ("error", o.error)):
        for name in given:
            if name not in _STICKS:
                raise UnknownNameError(f"output of --{option}", name, _STICKS)
    gains, errors = _GAINS | o.gain, _ERRORS | o.error
    tracked = tuple(
        Tracked(
            output=name, stick=stick, gain=gains[name], frequency=o.frequency, error=errors[name]
        )
        for name, stick in _STICKS.items()
    )
    weights = LqgWeights(
        output=_RATES | o.rate,
        effort=o.effort,
        disturbance=_DISTURBANCE | o.disturbance,
        noise=o.noise,
    )
    plant = identify_for_design(o.source, axes=("lon", "lat", "ped"))
    law = lqg(plant, tracked, weights)
    print(as_text(loop_margins(ClosedLoop(plant, law.linear(plant.period)))))
    law.write(o.out)
    print_written(o, o.out)
    return 0


def margins(o: Options) -> int:
    """Measure margins, disturbance rejection and bandwidth from flight logs.

    Measure a closed loop from flight logs, by anyone, in which something was injected that the
    control law doesn't know: crossover, phase and gain margin of the broken loop, disturbance
    rejection bandwidth and peak, bandwidth and phase delay of the answer to a stick, all with 95 %
    intervals. No model is fitted.

    Options:
        @logs
        what was injected:
        --axis A,B <names>  lat, lon, ped, col or roll, pitch, yaw, heave (default: all)
        --at PLACE  where the loop was cut: actuators, sensors (an attitude that was turned), or a
            rate that is sensed, p, q or r (default: all that channels' names say; else actuators)
        --injected C,D <names>  channel of what was added there, one each axis
        --returned C,D <names>  channel of what comes back there, before that is added
        --total C,D <names>  channel of their sum; of both, one is enough
        how it is measured:
        --band LO HI <many>  lowest and highest frequency, rad/s (default: where what was injected
            has power)
        --late NAME=S <named>  by how much the record of a channel is late, s; may be given again
            (default: 0, or what a simulation's record says)
        --draws N  of the loop, for the intervals (default: 400)
        options:
        --json FILE <.json>  write the figures, .json
        @quiet

    example:
      helisim margins flight.bin
      helisim fly --axis ped --at actuators --excitation \\
          chirp,amplitude=0.05,band=2:90 --set pilot.k_heading=0 --out loop.parquet
      helisim margins loop.parquet
      helisim margins flight.ulg --map heli.toml --axis lat --injected dither \\
          --total mixer_in --returned rate_out --band 2 60

    Where channels are called lat_disturbance (what was added to lat) and lat_sum
    (what came of it), or phi_disturbance and phi_sum of a sensed angle, nothing
    need be said. Sticks that were swept give bandwidth and phase delay. Nor need
    it of logs of ArduPilot's mode SystemID (SID_AXIS 1 to 12) on a helicopter:
    they say themselves what was injected, and that is printed.

    Exit status 1: none of the figures could be measured.

    @about_maps
    """
    from helisim.base.files import write_json
    from helisim.handling.measured.margins import margins
    from helisim.logs.dataflash import is_dataflash

    band = Bands.of(o).common_only()
    draws = {} if o.draws is None else {"draws": o.draws}
    how = {"axes": o.axis, "at": o.at, "band": band, **draws}
    named = any((o.injected, o.total, o.returned, o.map, o.channel))
    if not named and all(path.is_file() and is_dataflash(path) for path in o.logs):
        found, measured = _flown_loops(o, how)
        said: list[Any] = [one.to_dict() for one in found.logs]
        print_loops(found, measured)
    else:
        cuts = _cuts(o)
        wanted = None if cuts is None else [n for cut in cuts for n in (cut.injected, *cut.outputs)]
        with Progress(len(o.logs) + 1, o.quiet) as advance:
            logs, records = read_logs(o, wanted, advance)
            with located(logs):
                measured = margins(records, cuts=cuts, late=o.late, **how)
            advance("margins")
        said = reports(logs)
        print(f"{describe(logs)}\n")
        print_loops(None, measured)
    if o.json is not None:
        write_json({**measured.to_dict(), "logs": said}, o.json)
        print_written(o, o.json)
    return 0 if measured.figures else 1


def _flown_loops(o: Options, how: dict[str, Any]) -> "tuple[FlownLoops, MeasuredMargins]":
    """Return the loops that logs of SystemID cut, and their margins. Raises InputError."""
    from helisim.look.loops import flown_loops

    of_channels = ("time", "rate", "resample", "repair", "max_gap", "min_duration", "late")
    unused = [f"--{name.replace('_', '-')}" for name in of_channels if getattr(o, name)]
    if unused:
        raise InputError(
            f"{', '.join(unused)}: of channels that --injected, --total and --channel name; sweeps "
            "of an autopilot are read at its own ticks"
        )
    with Progress(2, o.quiet) as advance:
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
    """Return the cuts that the options say; None if the channels' names shall say them."""
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
    at = o.at or "actuators"
    parts = zip(o.axis, o.injected, o.total or nothing, o.returned or nothing)
    return tuple(Cut(axis, at, added, both, back) for axis, added, both, back in parts)
