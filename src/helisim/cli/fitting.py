"""Commands that fit models: identify one from logs, verify it on others, list structures."""

import math
import os
import re
import sys
from collections.abc import Callable, Sequence, Set
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.cli.logs import (
    Band,
    describe,
    estimate,
    given_columns,
    located,
    read_logs,
    read_options,
    read_roles,
    records_of,
    reports,
)
from helisim.cli.options import (
    Options,
    coloured,
    numbers_by_name,
    print_rows,
    print_written,
    progress,
    worded,
    worded_note,
    wrapped,
    write_data,
)

if TYPE_CHECKING:
    from helisim.ident import Fit, FrequencyResponse, Structure, Verification
    from helisim.logs import Log
    from helisim.look.systemid import Inferred, InferredFit

_GENERIC = {
    "tf:ZEROS/POLES": "transfer function with delay, such as tf:1/2, of any input and output",
}
_STATUS = {"sound": 0, "wrong": 1, "doubtful": 3}  # 2 is of a command that was not understood
_OF_ONE = ("inputs", "outputs", "fix", "start", "bounds", "responses")


class Work(NamedTuple):
    """One fit in a band; `said` is printed ahead of it, `label` is for names of files.

    `response` says why there is none where the data support none.
    """

    structure: "Structure"
    logs: "tuple[Log, ...]"
    response: "FrequencyResponse | IdentificationError"
    band: Band | None = None
    said: str = ""
    label: str = ""
    fit: "Fit | None" = None


def identify(o: Options) -> int:
    """Identify a model from flight logs.

    Fit a structure to frequency responses; print values with Cramér-Rao bounds.

    Options:
        @logs
        options:
        --structure NAME <text>  of helisim structures, tf:ZEROS/POLES, or a TOML file (default:
            what ArduPilot's sweeps allow)
        how frequency responses are estimated:
        --inputs A,B <names =>  channels that drive (default: the structure's)
        --outputs P,Q <names =>  channels that respond (default: the structure's)
        --conditioning C,D <names =>  further inputs that moved: effect removed
        @reference
        --band LO HI  rad/s (default: what the records resolve)
        @estimator
        how parameters are fitted (names: helisim structures NAME):
        --start NAME=VALUE <many>  start, SI: an order of magnitude is enough
        --fix NAME=VALUE <many>  keep it; +- its standard error: omega=62+-0.5
        --bounds NAME=LO:HI <many>  limits; a side may be open: tau=0:
        --responses A/B,... <names>  responses to fit, such as p/lat (default: all)
        --searches N <=12>  most starts to try (default: 12)
        options:
        @json: the model, for verify
        --report FILE <.html>  page with figures, .html
        @quiet

    example:
      helisim identify flight.bin
      helisim identify lat.csv lon.csv --structure rollpitch_speeds --map h.toml \\
          --resample 100 --band 1 40 --json model.json
      helisim identify yaw.parquet --structure tf:1/2 --inputs PED --outputs r

    A log of ArduPilot's mode SystemID says what was swept; options overrule it.
    Several axes give several models: model-rollpitch_speeds.json and so on.

    Exit status 1: the verdict on a fit is "wrong"; 3: on none, but on one
    "doubtful"; 2: the data support none, or one of several is refused.
    """
    found = _inferred_work(o) if _infers(o) else [_asked(o)]
    status = []
    for work in found:
        label = f"-{work.label}" if len(found) > 1 else ""
        json, report = (
            path and path.with_name(f"{path.stem}{label}{path.suffix}")
            for path in (o.json, o.report)
        )
        try:
            status.append(_fitted(o, work, json, report))
        except IdentificationError as error:
            if len(found) == 1:
                raise
            status.append(2)
            said = f"{work.label} isn't identified: {error}{worded(error.remedy)}"
            print(f"{o.parser.prog}: {said}", file=sys.stderr)
    return next(one for one in (2, 1, 3, 0) if one in status)


def _asked(o: Options) -> Work:
    """Return the fit that the options name. Raises HelisimError."""
    structure = _adapted(o, find_structure(o.structure, o.inputs, o.outputs))
    inputs, outputs = o.inputs or structure.inputs, o.outputs or structure.outputs
    with progress(len(o.logs) + 1, o.quiet) as advance:
        logs = read_roles(o, inputs, outputs, advance)
        fit = _likely(o, structure, logs)
        response = fit.data if fit else estimate(logs, o, inputs, outputs, advance)
    return Work(structure, logs, response, said=describe(logs), fit=fit)


def _likely(o: Options, structure: "Structure", logs: "Sequence[Log]") -> "Fit | None":
    """Return the fit to the records themselves; None where a spectral estimate is to be fitted.

    Raises InputError for options that are of a spectral estimate.
    """
    from helisim.ident.likelihood import falls_short, identify_records

    records = records_of(logs)
    own = {"inputs": structure.inputs, "outputs": structure.outputs}
    spectral = [
        f"--{name}"
        for name in ("inputs", "outputs", "conditioning", "reference", "responses")
        if getattr(o, name) and {*getattr(o, name)} != {*own.get(name, ())}
    ]
    if o.estimator != "likelihood" and (
        o.estimator or spectral or not falls_short(records, o.band)
    ):
        return None
    if spectral:
        raise InputError(
            f"{', '.join(spectral)}: the likelihood is of all inputs and outputs of the structure, "
            "and of no others; leave that out, or take another structure or --estimator local"
        )
    with progress(None, o.quiet, unit="search") as advance, located(logs):
        return identify_records(
            records,
            structure,
            band=o.band and tuple(o.band),
            searches=o.searches,
            use_ended=o.use_ended,
            on_progress=advance,
        )


def _fitted(o: Options, work: Work, json: Path | None, report: Path | None) -> int:
    from helisim.ident import identify, suspicions

    logs, frf = work.logs, work.response
    if isinstance(frf, IdentificationError):
        raise frf
    with progress(None, o.quiet, unit="search") as advance, located(logs):
        fit = work.fit or identify(
            frf, work.structure, band=work.band, on_progress=advance, **_search(o)
        )
    print(work.said)
    low, high = frf.frequency[[0, -1]]
    how = ", ".join(filter(None, (fit.method, frf.estimator)))
    print(f"band {low:.4g} to {high:.4g} rad/s, {how}\n")
    print(coloured(wrapped(fit.text(worded_note), indent=2)))
    if frf.direct:
        print(wrapped(_beside(fit, frf.direct, o), indent=2))
    if fit.verdict.word == "wrong" or fit.dropped:
        causes = [f"  {worded_note(one)}" for one in suspicions(fit) if one not in fit.notes]
        if causes:
            print(wrapped("\n".join(["likely causes, by what the data show:", *causes]), indent=4))
    write_data(o, {**fit.to_dict(), "logs": reports(logs)}, json)
    _report(o, report, fit, logs)
    return _STATUS[fit.verdict.word]


def _report(
    o: Options,
    path: Path | None,
    fit: "Fit",
    logs: "Sequence[Log]",
    verification: "Verification | None" = None,
) -> None:
    """Write a fit's page, if one is asked for, and print where."""
    if path is None:
        return
    from helisim.show.report import write_fit_report

    named = {f"record {k}": record for k, record in enumerate(records_of(logs), 1)}
    with progress(len(named), o.quiet, unit="record") as advance:
        write_fit_report(path, fit, records=named, verification=verification, on_progress=advance)
    print_written(o, path)


def _beside(fit: "Fit", direct: "FrequencyResponse", o: Options) -> str:
    """Return by how much the direct estimate's parameters differ, in words."""
    from helisim.ident import identify

    structure = fit.structure.with_starts(
        {one.name: fit[one.name].value for one in fit.structure.free}
    )
    other = identify(
        direct,
        structure,
        band=fit.options["band_rad_s"],
        responses=o.responses or None,
        searches=1,
    )
    shift = {
        name: (other[name].value - one.value) / one.standard_error
        for name, one in fit.parameters.items()
        if not one.fixed and 0.0 < one.standard_error < math.inf
    }
    most = sorted(shift, key=lambda name: -abs(shift[name]))[:3]
    said = ", ".join(f"{name} {other[name].value:.4g} ({shift[name]:+.2g} errors)" for name in most)
    return f"the direct estimate beside it, which feedback biases, differs most in {said}"


def _search(o: Options) -> dict[str, Any]:
    return {"responses": o.responses or None, "searches": o.searches}


def _adapted(o: Options, structure: "Structure") -> "Structure":
    bounds = dict(map(_bounds, o.bounds))
    apart = [re.split(r"\+-|\+/-|±", item, maxsplit=1) for item in o.fix]
    fixed = numbers_by_name("--fix", [value for value, *_ in apart])
    named = [f"{value.partition('=')[0]}={error}" for value, *errors in apart for error in errors]
    errors = numbers_by_name("--fix NAME=VALUE+-ERROR:", named)
    freed = structure.with_bounds(dict.fromkeys(bounds)).with_starts(
        numbers_by_name("--start", o.start)
    )
    return freed.with_bounds(bounds).with_fixed(fixed, errors)


def _bounds(item: str) -> tuple[str, Band]:
    name, _, edges = item.partition("=")
    low, colon, high = edges.partition(":")
    try:
        if name.strip() and colon:
            return name.strip(), (float(low or -math.inf), float(high or math.inf))
    except ValueError:
        pass
    raise InputError(f"--bounds takes NAME=LO:HI, such as tau=0:0.5 or tau=0:, got {item!r}")


def _infers(o: Options) -> bool:
    from helisim.logs.dataflash import is_dataflash

    if o.structure is None:
        others = [path for path in o.logs if not is_dataflash(path)]
        if others:
            raise InputError(
                f"{others[0]}: not a log of ArduPilot's system identification, so --structure has "
                "to be said; helisim structures lists them, and helisim look LOG says what to run"
            )
        return True
    structure = find_structure(o.structure, o.inputs, o.outputs)
    return _says_sweeps(o, {*(o.inputs or structure.inputs), *(o.outputs or structure.outputs)})


def _says_sweeps(o: Options, wanted: Set[str]) -> bool:
    """Return whether the logs themselves say which channels they have, and what was swept."""
    from helisim.look.sweeps import own_sweeps

    said = wanted <= set(given_columns(o).channels)
    return not said and all(path.is_file() and own_sweeps(path) for path in o.logs)


def _inferred(o: Options) -> "Inferred":
    """Return what logs of SystemID say, read as the options want. Raises HelisimError."""
    from helisim.look.systemid import infer

    if o.time is not None:
        raise InputError("--time is of logs without a clock; an autopilot's has one")
    own = {"channels": given_columns(o), "min_duration": o.min_duration}
    return infer(o.logs, **own, **read_options(o))


def _inferred_work(o: Options) -> list[Work]:
    """Print what logs of SystemID say; return the fits, their responses estimated."""
    from helisim.ident.frf import resolved_band
    from helisim.look.systemid import estimate_fits, followed_band

    with progress(2 * len(o.logs) + 1, o.quiet) as advance:
        found = _inferred(o)
        fits = _fits(o, found)
        structures = [_adapted(o, find_structure(f.structure, f.inputs, f.outputs)) for f in fits]
        roles = [(*f.inputs, *f.outputs, *f.conditioning, *f.reference) for f in fits]
        logs = found.read(chain(*roles), on_progress=advance)
        records = records_of(logs)
        least = resolved_band(records)[0]
        fits = tuple(
            replace(fit, band=tuple(o.band or (max(fit.band[0], least), fit.band[1])))
            for fit in fits
        )
        works, used = [], []
        for fit, structure in zip(fits, structures):
            band = fit.band
            try:
                with located(logs):
                    (response,) = estimate_fits(records, [fit], o.estimator or "local")
                    if not o.band:
                        band = followed_band(response, structure, band, **_search(o))
            except IdentificationError as error:
                response = error
            if band != fit.band:
                why = f"{fit.why}; below {band[0]:.3g} rad/s the structure doesn't follow"
                fit = replace(fit, band=band, why=why)
            name = fit.structure
            label = "_".join((*fit.outputs, *fit.inputs)) if name.startswith("tf:") else name
            works.append(Work(structure, logs, response, band, label=label))
            used.append(fit)
        advance("frequency responses")
    print(wrapped(str(replace(found, fits=tuple(used))), indent=4))
    return works


def _fits(o: Options, found: "Inferred") -> "tuple[InferredFit, ...]":
    """Return the fits that the logs allow and the options want. Raises InputError."""
    fits = found.fits
    if o.structure is not None:
        one = find_structure(o.structure, o.inputs, o.outputs)
        inputs, outputs = o.inputs or one.inputs, o.outputs or one.outputs
        fits = (found.fit(o.structure, inputs, outputs),)
    elif not fits or any(getattr(o, name) for name in _OF_ONE):
        have = "; ".join(
            f"{fit.structure} ({', '.join(fit.outputs)} over {', '.join(fit.inputs)})"
            for fit in fits
        )
        raise InputError(
            f"{', '.join(f'--{name}' for name in _OF_ONE)} are of one structure, and the sweeps "
            f"allow {have}; choose one by --structure"
            if fits
            else f"{found.logs[0].path}: no structure fits what was swept with the channels that "
            f"it has, {', '.join(sorted(found.channels))}; choose one by --structure"
        )
    given = {name: getattr(o, name) for name in ("conditioning", "reference") if getattr(o, name)}
    return tuple(replace(fit, **given) for fit in fits)


def _read_sweeps(
    o: Options, inputs: Sequence[str], outputs: Sequence[str], advance: Callable[[str], None]
) -> "tuple[Log, ...]":
    """Return the sweeps of a model's inputs, where logs say them."""
    from helisim.look.sweeps import SID_AXES

    found = _inferred(o)
    found.fit("the model", inputs, outputs)  # says what wasn't swept, or isn't there
    return tuple(
        log
        for log in found.read({*inputs, *outputs}, on_progress=advance)
        if SID_AXES[log.records[0].provenance["sweep"]["axis"]].control in inputs
    )


def verify(o: Options) -> int:
    """Simulate an identified model on other flight logs.

    Simulate a model on flight logs that it was not fitted to, estimating only bias and trim, and
    print J_rms and Theil's inequality coefficient.

    Options:
        model MODEL  model of identify, .json
        @logs
        options:
        --segment S  segments, s, each from a state of its own (default: for unstable models, in
            which errors double three times at most)
        @json: the figures
        --report FILE <.html>  page with the flights and their predictions, .html
        @quiet

    example:
      helisim verify model.json doublet.csv --map heli.toml --resample 100

    Exit status 1: Theil's coefficient is above 0.25, or other controls moved than
    the model's inputs.
    """
    from helisim.ident import load_fit, verify
    from helisim.ident.verify import refuse_seen
    from helisim.records.record import made_by

    given = [path for path in o.logs if path.suffix.lower() == ".json"]
    if given and o.model.suffix.lower() != ".json":
        raise InputError(
            f"{o.model} stands where the model is expected, and {given[0]} among the logs; the "
            f"model comes first: helisim verify {given[0]} {o.model}{'/*' * o.model.is_dir()}"
        )
    fit = load_fit(o.model)
    inputs, outputs = fit.structure.inputs, fit.structure.outputs
    with progress(len(o.logs) + 1, o.quiet) as advance:
        if _says_sweeps(o, {*inputs, *outputs}):
            logs = _read_sweeps(o, inputs, outputs, advance)
        else:
            logs = read_logs(o, (*inputs, *outputs), advance)
        for log in logs:
            for record in log.records:
                refuse_seen(fit, record, log.report.path)
        with located(logs):
            verification = verify(fit, records_of(logs), segment=o.segment, use_ended=o.use_ended)
        advance("simulation")
    print(f"{describe(logs)}\n")
    print(verification)
    said = {
        "model": str(o.model),
        "logs": reports(logs),
        "provenance": made_by("verification", fit=fit.provenance),
    }
    write_data(o, {**verification.to_dict(), **said})
    _report(o, o.report, fit, logs, verification)
    return 0 if verification.acceptable else 1


def structures(o: Options) -> None:
    """List the built-in model structures, or print one.

    List the structures that can be identified; with a name, print that one as TOML.

    Options:
        name NAME <maybe>  built-in name or TOML file

    example: helisim structures rollpitch > mine.toml
    """
    from helisim.ident import structures

    if o.name is not None:
        print(find_structure(o.name, ("input",), ("output",)).to_toml(), end="")
    else:
        built = {
            one.name: f"{', '.join(one.outputs)} over {', '.join(one.inputs)}: {one.meaning}"
            for one in structures.BUILT_IN.values()
        }
        print_rows(built | _GENERIC)


def find_structure(
    name: str, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()
) -> "Structure":
    """Return a structure by its built-in name, as a transfer function, or from a TOML file."""
    from helisim.ident import Structure, structures

    if name not in structures.BUILT_IN and (name.lower().endswith(".toml") or os.path.isfile(name)):
        return Structure.from_toml(name)
    try:
        return structures.named(name, inputs, outputs)
    except UnknownNameError:
        raise UnknownNameError(
            "structure", name, (*structures.BUILT_IN, *_GENERIC, "FILE.toml")
        ) from None
