"""Commands that fit models: identify one from logs, verify it on others, list structures."""

import math
import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import (
    HelisimError,
    IdentificationError,
    InputError,
    LogError,
    UnknownNameError,
)
from helisim.cli.logs import (
    Band,
    Bands,
    Estimated,
    Read,
    Signals,
    command_line,
    describe,
    estimate,
    estimator_options,
    given_columns,
    given_response,
    located,
    look_at,
    read_logs,
    read_options,
    reports,
    resolved_band,
)
from helisim.cli.options import (
    Options,
    Progress,
    chosen_units,
    joined_band,
    names,
    numbers_by_name,
    print_written,
    worded_note,
    wrapped,
)

if TYPE_CHECKING:
    from helisim.ident import Fit, FittedParameter, Parameter, Reduction, Structure
    from helisim.logs import Log
    from helisim.look.systemid import Inferred, InferredFit

_TRANSFER = re.compile(r"tf:(\d{1,2})/(\d{1,2})$")
_GENERIC = {
    "first_order_delay": "b0 e^(-tau s) / (s + a0), of any input and output",
    "second_order_delay": "b0 e^(-tau s) / (s^2 + a1 s + a0), of any input and output",
    "tf:ZEROS/POLES": "transfer function with delay, such as tf:1/2, of any input and output",
    "tf:FACTORS": "the same in factors, such as 'tf:(a)/[zeta,omega](0)': (a) = s + a, (1/T), "
    "[zeta,omega] = s^2 + 2 zeta omega s + omega^2, (0) = s; a number in a name's place is a start",
}
_IMPLAUSIBLE = ("unit", "sign", "axes", "scale", "unit of time")
"""Findings in a log that may be why a fit of it fails."""
_FILES = ("json", "latex", "matlab", "report")
_OF_ONE = ("fix", "start", "bounds", "known", "rename", "responses", "keep")
"""Options that name what one structure has."""
_OF_THE_LOOK = {"logs", "channel", "map", "time", "rate", "resample", "repair", "max_gap"}
_OF_THE_LOOK |= {"from_time", "to_time"}
"""Options that a look at logs has taken, and its command has again."""


class Work(NamedTuple):
    """One fit that is to be made: of which structure, to what, and what is said ahead of it.

    Attributes:
        structure: with what the options fix and bound.
        estimated: the responses that it is fitted to.
        said: how logs were read.
        fit: what logs of SystemID say of it; None for other logs.
    """

    structure: "Structure"
    estimated: Estimated
    said: str
    fit: "InferredFit | None" = None

    @property
    def label(self) -> str:
        """For the names of files."""
        if self.fit is None or not self.fit.structure.startswith("tf:"):
            return self.structure.name if self.fit is None else self.fit.structure
        return "_".join((*self.fit.outputs, *self.fit.inputs))


def identify(o: Options) -> int:
    """Identify a model from flight logs.

    Estimate frequency responses from flight logs, by anyone, fit a structure's parameters to them,
    and print values with Cramér-Rao bounds and insensitivities. Frequency responses that exist
    already are taken in place of logs: the JSON or CSV of `helisim frf`, or columns of text by
    anyone, as p/lat=FILE where they name no response.

    Options:
        @logs
        options:
        --structure NAME|FILE <text>  built-in name, tf:ZEROS/POLES, or a TOML file; `helisim
            structures` lists them (default: with logs of ArduPilot's mode SystemID as its sweeps
            allow, one or several; with those of PX4 as a look at them says)
        how frequency responses are estimated:
        --inputs A,B <names>  channels that drive the vehicle (default: the structure's)
        --outputs P,Q <names>  channels that answer, such as rates (default: the structure's)
        --conditioning C,D <names>  further inputs that moved too: their effect is taken out
        --reference A,B <names>  signals outside the loop, such as the sticks: joint input-output
            method, which feedback and gusts don't bias
        --band LO HI <many>  lowest and highest frequency, rad/s (default: what the records
            resolve); p/lat=LO:HI for one response, separated by commas
        @estimator
        how frequency responses in files are read:
        --columns WHAT:UNIT,...  what the columns of text hold, in their order, where the headings
            don't say it, such as frequency:Hz,magnitude:dB,phase:deg,coherence; - is not used
        parameters of the structure:
        | Names, units and starts are in `helisim structures NAME`. Values are in SI.
          Each option may be given again.
        --start NAME=VALUE <named>  where the search begins: an order of magnitude is enough
        --fix NAME=VALUE[+-ERROR] <many>  what is known already: keep it, and fit the others; its
            standard error, as from a bench, goes on into theirs: omega=62+-0.5
        --bounds NAME=LO:HI <many>  values that are possible; without LO or HI that side is open,
            as in tau=0:
        --known SIGNAL,...=BLOCK <many>  a servo before an input or a filter behind an output, as
            one knows it from a bench: lat,lon=second_order:omega=62+-1,zeta=0.7 or
            p=low_pass:corner=40,order=2, SI; what is left out is fitted (first_order,
            second_order, low_pass, inflow, delay)
        --rename OLD=NEW,...  the structure's channels by other names, as lat=LAT for the stick
        how the parameters are fitted:
        --responses A/B,... <names>  responses to fit, such as p/lat (default: all)
        --points N <=20>  frequencies that are fitted in each response, log-spaced (default: 20)
        --searches N <=12>  starts to try at most, scattered around the structure's; two that end
            alike suffice (default: 12)
        --seed S <int =0>  of the scattered starts (default: 0)
        --weighting <{error,coherence} =error>  what a point counts by: its own random error
            (default), or CIFER's weight, by coherence
        parameters that the data don't support:
        --reduce  set them to zero, worst first, as long as the cost hardly rises
        --keep NAME,... <names>  with --reduce: those that must stay
        --rise J <float>  with --reduce: by how much the average cost may rise in all (default: 1)
        --drop-delays  with --reduce: delays may be dropped too
        what is written:
        --json FILE <.json>  the model, for verify, .json
        --latex FILE <.tex>  the table, .tex
        --matlab FILE <.mat>  the model, .mat
        --report FILE <.html>  a page with figures, .html
        options:
        @units: the parameters, also in --latex and --report,
        @quiet

    example:
      helisim identify flight.bin
      helisim identify lat.csv lon.csv --structure rollpitch --map heli.toml \\
          --resample 100 --band 1 40 --json model.json
      helisim identify yaw.parquet --structure tf:1/2 --inputs PED --outputs r
      helisim identify frf.json --structure rollpitch
      helisim identify p/lat=p.txt q/lon=q.txt --structure rollpitch \\
          --responses p/lat,q/lon

    A log of ArduPilot's mode SystemID says itself what was swept and when, what
    the vehicle was commanded and answered; what is taken is printed, and every
    option below overrules it. The sweeps of several axes give several models:
    --json model.json then writes model-rollpitch.json and so on.

    The model in --json is what `helisim verify` reads. Exit status 1: the search
    didn't converge, the fit's cost is beyond the guidelines, or the fit is
    degenerate.

    @about_maps
    """
    chosen_units(o)  # refused before any work
    o = _looked(o) or o
    if not _infers(o):
        return _fitted(o, *_asked(o), {})
    found, work, searches = _inferred_work(o)
    print(wrapped(str(found), indent=4))
    status = 0
    for one, search in zip(work, searches):
        label = f"-{one.label}" if len(work) > 1 else ""
        paths = {name: getattr(o, name) for name in _FILES if getattr(o, name) is not None}
        files = {k: path.with_name(f"{path.stem}{label}{path.suffix}") for k, path in paths.items()}
        status |= _fitted(o, one, search, files)
    _print_loops(o)
    return status


def _asked(o: Options) -> tuple[Work, dict[str, Any]]:
    """Return the fit that the options name, and how it is searched. Raises HelisimError."""
    signals = Signals.of(o)
    structure = _adapted(o, find_structure(o.structure, signals.inputs, signals.outputs))
    signals = signals._replace(
        inputs=signals.inputs or structure.inputs, outputs=signals.outputs or structure.outputs
    )
    for what in ("inputs", "outputs"):
        needed, given = getattr(structure, what), getattr(signals, what)
        missing = [name for name in needed if name not in given]
        if missing:
            raise InputError(
                f"the structure {structure.name!r} has the {what} {', '.join(needed)}, and "
                f"--{what} gives {', '.join(given)}; add {', '.join(missing)}, or --rename "
                f"{missing[0]}=NAME"
            )
    search = _search_options(o, structure)
    with Progress(len(o.logs) + 1, o.quiet) as advance:
        response = given_response(o, structure.inputs, structure.outputs)
        if response is None:
            estimated = estimate(o, signals, advance)
            return Work(structure, estimated, describe(estimated.logs)), search
    low, high = response.frequency[[0, -1]]
    held = f"{', '.join(response.outputs)} over {', '.join(response.inputs)}"
    said = f"{', '.join(map(str, o.logs))}: {held}, {response.frequency.size} frequencies"
    estimated = Estimated((), (), response, (float(low), float(high)))
    return Work(structure, estimated, wrapped(said, indent=2)), search


def _fitted(o: Options, work: Work, search: dict[str, Any], files: Mapping[str, Path]) -> int:
    """Fit a structure, print it under what is said, and write it. Return the exit status."""
    from helisim.ident import identify, reduce
    from helisim.ident.in_units import fit_in

    structure, estimated, said, _ = work
    frf, units = estimated.response, chosen_units(o)
    search["band"] = _fitted_bands(o, structure, work.fit.band if work.fit else estimated.band)
    reduction = None
    with Progress(None, o.quiet, unit="search") as advance, located(estimated.logs):
        if o.reduce:
            reduction = reduce(frf, structure, on_progress=advance, **search)
        fit = (
            identify(frf, structure, on_progress=advance, **search)
            if reduction is None
            else reduction.fit
        )
    print(said)
    low, high = frf.frequency[[0, -1]]
    how = ", ".join(filter(None, (fit.method, frf.estimator)))
    print(f"band {low:.4g} to {high:.4g} rad/s, {how}\n")
    if reduction is not None:
        print(wrapped(str(reduction), indent=2))
    shown, notes = fit_in(fit, units) if units else (tuple(fit.parameters.values()), ())
    print(wrapped("\n".join([fit.text(shown, worded_note), *notes]), indent=2))
    _print_suspicions(o, fit, estimated.logs)
    _write(o, estimated, fit, reduction, shown, files)
    return 0 if fit.converged and fit.acceptable and not fit.degenerate else 1


def _write(
    o: Options,
    estimated: Estimated,
    fit: "Fit",
    reduction: "Reduction | None",
    shown: "Sequence[FittedParameter]",
    files: Mapping[str, Path],
) -> None:
    """Write what was asked for, the parameters in tables as they are shown, and say so."""
    from helisim.base.files import atomic_write, write_json
    from helisim.ident.fitted import latex_table

    json, latex, matlab, report = (files.get(name) or getattr(o, name) for name in _FILES)
    if json is not None:
        log = {} if reduction is None else {"reduction": reduction.log()}
        write_json({**fit.to_dict(), **log, "logs": reports(estimated.logs)}, json)
    if latex is not None:
        with atomic_write(latex) as temporary:
            text = latex_table(shown, cost=fit.cost, provenance=fit.provenance)
            temporary.write_text(text, encoding="utf-8")
    if matlab is not None:
        fit.to_matlab(matlab)
    if report is not None:
        from helisim.show.report import write_fit_report

        records = {f"record {k + 1}": record for k, record in enumerate(estimated.records)}
        with Progress(len(records), o.quiet, unit="record") as advance:
            write_fit_report(report, fit, records=records, parameters=shown, on_progress=advance)
    print_written(o, json, latex, matlab, report)


def _print_suspicions(o: Options, fit: "Fit", logs: "Sequence[Log]") -> None:
    """Print what may be wrong where a fit isn't acceptable: by the data, and by the logs."""
    if fit.acceptable and not fit.dropped:
        return
    from helisim.ident import suspicions

    known = set(fit.notes)
    lines = [worded_note(one) for one in suspicions(fit) if one not in known]
    lines += [line for line in dict.fromkeys(_implausible(o) if logs else ()) if line not in lines]
    if lines:
        print("likely causes, by what the data show:")
        print(wrapped("\n".join(f"  {line}" for line in lines), indent=4))


def _implausible(o: Options) -> Iterator[str]:
    """Yield what is implausible in the logs, also by channels that weren't asked for."""
    try:
        found = look_at(o)
    except HelisimError:
        return
    for log in found.logs:
        for finding in log.findings:
            if finding.kind in _IMPLAUSIBLE:
                yield f"{log.path}: {worded_note(finding)}"


def _print_loops(o: Options) -> None:
    """Print the loops as flown, of logs that say them too."""
    from helisim.cli.design import print_loops
    from helisim.look.loops import flown_loops

    print("\nloops as flown")
    try:
        with Progress(1, o.quiet) as advance:
            found = flown_loops(o.logs, start=o.from_time, stop=o.to_time)
            measured = found.margins()
            advance("margins")
    except (LogError, IdentificationError) as error:
        print(wrapped(f"not measured: {error}", indent=2))
    else:
        print_loops(found, measured)


def _adapted(o: Options, structure: "Structure") -> "Structure":
    """Return a structure with the options' channels, bounds, starts and fixed values."""
    if o.rename is not None:
        pairs = [item.partition("=") for item in names(o.rename)]
        for old, equals, new in pairs:
            if not equals or not old.strip() or not new.strip():
                given = f"{old}{equals}{new}"
                raise InputError(f"--rename takes OLD=NEW, such as lat=LAT, got {given!r}")
        structure = structure.renamed({old.strip(): new.strip() for old, _, new in pairs})
    if o.known:
        from helisim.ident.blocks import with_blocks

        structure = with_blocks(structure, _blocks(o.known))
    bounds = dict(_bounds(item) for item in o.bounds)
    apart = [re.split(r"\+-|\+/-|±", item, maxsplit=1) for item in o.fix]
    fixed = numbers_by_name("--fix", [value for value, *_ in apart])
    named = [f"{value.partition('=')[0]}={error}" for value, *errors in apart for error in errors]
    errors = numbers_by_name("--fix NAME=VALUE+-ERROR:", named)
    within = {name: _start(structure.parameter(name), *bounds[name]) for name in bounds}
    structure = structure.with_bounds(dict.fromkeys(bounds))
    structure = structure.with_starts(within | o.start).with_bounds(bounds)
    return structure.with_fixed(fixed, errors)


def _blocks(items: Sequence[str]) -> dict[str, str]:
    """Return the blocks of SIGNAL,...=BLOCK by their signals. Raises InputError."""
    series: dict[str, str] = {}
    for item in items:
        signals, equals, block = item.partition("=")
        if not equals or not names(signals):
            raise InputError(
                f"--known takes SIGNAL=BLOCK, such as lat=delay:tau=0.02, got {item!r}"
            )
        if signals in series:
            raise InputError(f"--known {signals} was given twice: a signal has one block")
        series[signals] = block
    return series


def _start(parameter: "Parameter", low: float, high: float) -> float:
    """Return where a parameter starts within new bounds: as before, or in between."""
    if low <= parameter.start <= high:
        return parameter.start
    if math.isfinite(low) and math.isfinite(high):
        return 0.5 * (low + high)
    return low + parameter.magnitude if math.isfinite(low) else high - parameter.magnitude


def _bounds(item: str) -> tuple[str, Band]:
    """Return NAME=LO:HI as a name and bounds, infinite where a side is left out."""
    name, _, edges = item.partition("=")
    low, colon, high = edges.partition(":")
    try:
        if name.strip() and colon:
            return name.strip(), (float(low or -math.inf), float(high or math.inf))
    except ValueError:
        pass
    raise InputError(f"--bounds takes NAME=LO:HI, such as tau=0:0.5 or tau=0:, got {item!r}")


def _responses(o: Options, structure: "Structure") -> tuple[str, ...]:
    """Return the names of the responses that are fitted."""
    pairs = tuple(
        f"{output}/{input_}" for output in structure.outputs for input_ in structure.inputs
    )
    return o.responses or pairs


def _search_options(o: Options, structure: "Structure") -> dict[str, Any]:
    """Return what `identify` and `reduce` are given beside responses, structure and bands."""
    Bands.of(o).check(_responses(o, structure))
    search: dict[str, Any] = {
        "responses": o.responses or None,
        "frequencies_per_response": o.points,
        "searches": o.searches,
        "seed": o.seed,
        "weighting": o.weighting,
    }
    if o.reduce:
        search |= {"keep": o.keep or (), "delays": o.drop_delays}
        return search if o.rise is None else search | {"rise": o.rise}
    if o.keep is not None or o.rise is not None or o.drop_delays:
        raise InputError("--keep, --rise and --drop-delays belong to --reduce: add it")
    return search


def _fitted_bands(o: Options, structure: "Structure", default: Band) -> dict[str, Band] | Band:
    """Return the band of all fitted responses or of each, `default` where --band says nothing."""
    bands = Bands.of(o)
    common = bands.common or default
    return (
        dict.fromkeys(_responses(o, structure), common) | dict(bands.own) if bands.own else common
    )


def _looked(o: Options) -> Options | None:
    """Return the options with what a look at ULogs adds, and print what that is.

    PX4 logs no sweeps of its own as ArduPilot does; so what moved is seen by its signals, whether a
    pilot, an offboard program or an autotune moved it.
    """
    from helisim.base.files import first_bytes
    from helisim.cli import parser
    from helisim.logs.ulog import ULOG_MAGIC

    if o.structure is not None or not all(path.is_file() for path in o.logs):
        return None
    if not all(first_bytes(path, len(ULOG_MAGIC)) == ULOG_MAGIC for path in o.logs):
        return None
    found = look_at(o)
    if found.proposal is None:
        where = " ".join(shlex.quote(str(path)) for path in o.logs)
        raise InputError(
            f"{o.logs[0]}: a log of PX4: nothing in it answers coherently to a sweep; log fast "
            "(SDLOG_PROFILE's bit 4, high rate), sweep one axis after the other, or say "
            f"--structure and --map; helisim look {where} says what is in it"
        )
    print(wrapped("a log of PX4, which says of no sweep itself: what moved is told by its signals"))
    for log in found.logs:
        print(wrapped(log.worded(worded_note), indent=4))
    command = command_line(found.proposal)
    print(f"\nso what is run is\n{command}\n")
    words = joined_band(shlex.split(command)[1:])
    chosen = parser(words).parse_args(words)
    usual = vars(parser(["identify"]).parse_args(["identify", *map(str, o.logs)]))
    for name, item in usual.items():
        if name not in _OF_THE_LOOK and getattr(o, name) != item:
            setattr(chosen, name, getattr(o, name))
    return chosen


def _infers(o: Options) -> bool:
    """Return whether logs are to say what the options leave open."""
    from helisim.base.files import first_bytes
    from helisim.logs.dataflash import is_dataflash

    if o.structure is not None and not all(path.is_file() for path in o.logs):
        return False  # which is said where they are read; or they are p/lat=FILE
    others = [path for path in o.logs if not is_dataflash(path)]
    if o.structure is None and others:
        if not first_bytes(others[0], 1):
            raise InputError(f"{others[0]}: the file is empty")
        raise InputError(
            f"{others[0]}: not a log of an autopilot's system identification, so --structure has "
            "to be said; helisim structures lists them, and helisim look LOG says what to run"
        )
    if o.structure is None or others:
        return not others
    signals = Signals.of(o)
    structure = find_structure(o.structure, signals.inputs, signals.outputs)
    wanted = {*(signals.inputs or structure.inputs), *(signals.outputs or structure.outputs)}
    return not wanted <= set(given_columns(o)[0].channels)


def _inferred(o: Options) -> "Inferred":
    """Return what logs of SystemID say, read as the options want. Raises HelisimError."""
    from helisim.look.systemid import infer

    if o.time is not None or o.rate is not None:
        raise InputError("--time and --rate are of logs without a clock; an autopilot's has one")
    channels = given_columns(o)[0]
    return infer(o.logs, channels=channels, min_duration=o.min_duration, **read_options(o))


def _inferred_work(o: Options) -> "tuple[Inferred, list[Work], list[dict[str, Any]]]":
    """Return what logs of SystemID say, the fits, their responses estimated, and their searches.

    Bands begin where a structure follows, unless --band says the band.
    """
    from helisim.look.systemid import estimate_fits, followed_band

    asked = Bands.of(o)
    with Progress(2 * len(o.logs) + 1, o.quiet) as advance:
        found = _inferred(o)
        fits = _fits(o, found)
        structures = [_adapted(o, find_structure(f.structure, f.inputs, f.outputs)) for f in fits]
        parts = [(f.inputs, f.outputs, f.conditioning, f.reference) for f in fits]
        wanted = {name for part in parts for channels in part for name in channels}
        logs = replace(found, fits=fits).read(wanted, on_progress=advance)
        records = tuple(record for log in logs for record in log.records)
        least = resolved_band(records)[0]
        bands = [asked.common or (max(fit.band[0], least), fit.band[1]) for fit in fits]
        fits = tuple(replace(f, band=asked.around(band)) for f, band in zip(fits, bands))
        with located(logs):
            responses = estimate_fits(records, fits, estimator_options(o))
        advance("frequency responses")
    searches = [_search_options(o, structure) for structure in structures]
    work = []
    with Progress(None, o.quiet, unit="band") as advance:
        for fit, structure, response, search in zip(fits, structures, responses, searches):
            band = fit.band
            if not o.band:
                of_reducing = ("keep", "delays", "rise")
                mine = {name: one for name, one in search.items() if name not in of_reducing}
                band = followed_band(response, structure, fit.band, **mine)
                advance(fit.structure)
            if band != fit.band:
                why = f"{fit.why}; below {band[0]:.3g} rad/s the structure doesn't follow"
                fit = replace(fit, band=band, why=why)
            work.append(Work(structure, Estimated(logs, records, response, band), "", fit))
    return replace(found, fits=tuple(one.fit for one in work)), work, searches


def _fits(o: Options, found: "Inferred") -> "tuple[InferredFit, ...]":
    """Return the fits that the logs allow and the options want. Raises InputError."""
    signals = Signals.of(o)
    if o.structure is not None:
        one = find_structure(o.structure, signals.inputs, signals.outputs)
        inputs, outputs = signals.inputs or one.inputs, signals.outputs or one.outputs
        fits = (found.fit(o.structure, inputs, outputs),)
    else:
        fits = tuple(
            fit
            for fit in found.fits
            if (not signals.inputs or set(fit.inputs) & set(signals.inputs))
            and (not signals.outputs or set(fit.outputs) & set(signals.outputs))
        )
        have = "; ".join(
            f"{fit.structure} ({', '.join(fit.outputs)} over {', '.join(fit.inputs)})"
            for fit in found.fits
        )
        if not fits:
            raise InputError(
                f"no fit that the sweeps allow has the signals of --inputs and --outputs; there is "
                f"{have or 'none'}; others take --structure"
            )
        named = [f"--{name}" for name in _OF_ONE if getattr(o, name)]
        named += ["--band of one response"] * bool(Bands.of(o).own)
        if named and len(fits) > 1:
            raise InputError(
                f"{', '.join(named)}: of one structure, and the sweeps allow {have}; choose one "
                "by --structure"
            )
    own = {name: getattr(signals, name) for name in ("conditioning", "reference")}
    given = {name: item for name, item in own.items() if getattr(o, name) is not None}
    return tuple(replace(fit, **given) for fit in fits)


def read_sweeps(
    o: Options, inputs: Sequence[str], outputs: Sequence[str], advance: Callable[[str], None]
) -> Read | None:
    """Return the sweeps of a model's inputs, where logs say them; None of any other logs."""
    from helisim.look.sweeps import SID_AXES, own_sweeps

    wanted = {*inputs, *outputs}
    if wanted <= set(given_columns(o)[0].channels):
        return None
    if not all(path.is_file() and own_sweeps(path) for path in o.logs):
        return None
    found = _inferred(o)
    found.fit("the model", inputs, outputs)  # says what wasn't swept, or isn't there
    logs = tuple(
        log
        for log in found.read(wanted, on_progress=advance)
        if SID_AXES[log.records[0].provenance["sweep"]["axis"]].control in inputs
    )
    return Read(logs, tuple(record for log in logs for record in log.records))


def verify(o: Options) -> int:
    """Simulate an identified model on other flight logs.

    Simulate a model that `helisim identify --json` wrote on flight logs that it was not fitted to,
    estimating only bias and trim, and print J_rms and Theil's inequality coefficient.

    Options:
        model MODEL  model of identify, .json
        @logs
        options:
        --segment S  verify in segments of S seconds, each from a state of its own; by default an
            unstable model's, in which its errors double three times at most
        --ahead S  predict each sample S seconds ahead, from the samples before it alone; --segment
            is then how much of the past gives a state
        --json FILE <.json>  write the figures, .json
        @units: J_rms
        @quiet

    example:
      helisim verify model.json doublet.csv --map heli.toml --resample 100
      helisim verify hover.json flight.csv --map heli.toml --ahead 0.5

    An unstable model diverges from any initial state: it is verified in segments,
    and says so.

    Exit status 1: Theil's coefficient is above 0.25.

    @about_maps
    """
    from helisim.base.files import write_json
    from helisim.ident import load_fit, verify
    from helisim.ident.verify import refuse_seen
    from helisim.records.record import made_by

    units, fit = chosen_units(o), load_fit(o.model)
    inputs, outputs = fit.structure.inputs, fit.structure.outputs
    with Progress(len(o.logs) + 1, o.quiet) as advance:
        swept = read_sweeps(o, inputs, outputs, advance)
        logs, records = swept or read_logs(o, (*inputs, *outputs), advance)
        for log in logs:
            for record in log.records:
                refuse_seen(fit, record, log.report.path)
        how = {"segment": o.segment, "ahead": o.ahead, "use_ended": o.use_ended}
        with located(logs):
            verification = verify(fit, records, **how)
        advance("simulation")
    print(f"{describe(logs)}\n")
    print(verification.in_units(units) if units else verification)
    if o.json is not None:
        data = {
            **verification.to_dict(),
            "model": str(o.model),
            "logs": reports(logs),
            "provenance": made_by("verification", fit=fit.provenance),
        }
        write_json(data, o.json)
        print_written(o, o.json)
    return 0 if verification.acceptable else 1


def structures(o: Options) -> int:
    """List the built-in model structures, or print one.

    List the structures that can be identified. With a name, print that one as TOML: the start of a
    structure of your own.

    Options:
        name NAME <maybe>  built-in name or TOML file

    example: helisim structures rollpitch > mine.toml
    """
    from helisim.ident import structures

    if o.name is not None:
        print(find_structure(o.name, ("input",), ("output",)).to_toml(), end="")
        return 0
    rows = {
        one.name: f"{', '.join(one.outputs)} over {', '.join(one.inputs)}: {one.meaning}"
        for one in structures.BUILT_IN.values()
    } | _GENERIC
    width = max(map(len, rows))
    for name, meaning in rows.items():
        print(wrapped(f"{name:<{width}}  {meaning}", indent=width + 2))
    return 0


def find_structure(
    name: str, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()
) -> "Structure":
    """Return a structure by its built-in name, as a transfer function, or from a TOML file."""
    from helisim.ident import Structure, structures

    if name in structures.BUILT_IN:
        return structures.named(name)
    orders = {"first_order_delay": (0, 1), "second_order_delay": (0, 2)}.get(name)
    match = _TRANSFER.match(name)
    if match is not None:
        orders = (int(match[1]), int(match[2]))
    if orders is not None or name.startswith("tf:"):
        if len(inputs) != 1 or len(outputs) != 1:
            raise InputError(f"{name} needs one input and one output: --inputs A --outputs B")
        ends: Any = {"input": inputs[0], "output": outputs[0]}
        if orders is None:
            return structures.factored(name[3:], **ends)
        return structures.transfer_function(zeros=orders[0], poles=orders[1], **ends)
    if name.lower().endswith(".toml") or os.path.isfile(name):
        return Structure.from_toml(name)
    raise UnknownNameError("structure", name, (*structures.BUILT_IN, *_GENERIC, "FILE.toml"))
