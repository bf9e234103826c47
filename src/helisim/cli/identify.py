"""`helisim identify`: from logs to a model with bounds."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import IdentificationError, InputError, LogError
from helisim.cli.common import add_quiet, print_written, wrapped
from helisim.cli.fitting import adapted, add_fitting, fitted_bands, search_options
from helisim.cli.given import add_given, given_response
from helisim.cli.inferred import inferred_work, infers, print_inferred, with_followed_bands
from helisim.cli.logs import MAP_HELP, add_log_options, describe, located, reports
from helisim.cli.looked import looked
from helisim.cli.progress import Progress
from helisim.cli.responses import Estimated, Signals, add_responses, estimate
from helisim.cli.structures import find_structure
from helisim.cli.suspicions import print_suspicions
from helisim.cli.units import add_units, chosen_units

if TYPE_CHECKING:
    from helisim.ident import Fit, FittedParameter, FrequencyResponse, Reduction, Structure

_EPILOG = f"""\
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

{MAP_HELP}"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "identify",
        help="identify a model from flight logs",
        description="Estimate frequency responses from flight logs, by anyone, fit a structure's "
        "parameters to them, and print values with Cramér-Rao bounds and insensitivities. "
        "Frequency responses that exist already are taken in place of logs: the JSON or CSV of "
        "`helisim frf`, or columns of text by anyone, as p/lat=FILE where they name no response.",
        epilog=_EPILOG,
    )
    add_log_options(command)
    command.add_argument(
        "--structure",
        metavar="NAME|FILE",
        help="built-in name, tf:ZEROS/POLES, or a TOML file; `helisim structures` lists them "
        "(default: with logs of ArduPilot's mode SystemID as its sweeps allow, one or several; "
        "with those of PX4 as a look at them says)",
    )
    add_responses(command, required=False)
    add_given(command)
    add_fitting(command)
    group = command.add_argument_group("what is written")
    group.add_argument("--json", type=Path, metavar="FILE", help="the model, for verify, .json")
    group.add_argument("--latex", type=Path, metavar="FILE", help="the table, .tex")
    group.add_argument("--matlab", type=Path, metavar="FILE", help="the model, .mat")
    group.add_argument("--report", type=Path, metavar="FILE", help="a page with figures, .html")
    add_units(command, "the parameters, also in --latex and --report,")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    options = looked(options) or options
    if infers(options):
        status = _run_inferred(options)
        _print_loops(options)
        return status
    structure, signals = _asked(options)
    search, units = search_options(options, structure), chosen_units(options)
    _check_destinations(options)
    with Progress(len(options.logs) + 1, options.quiet) as advance:
        estimated = _response(options, structure, signals, advance)
    search["band"] = fitted_bands(options, structure, estimated.band)
    said = describe(estimated.logs) or _described(options, estimated.response)
    return _fitted(options, structure, estimated, search, units, _Files.of(options), said)


def _run_inferred(options: argparse.Namespace) -> int:
    """Identify what logs of SystemID say themselves. Return the exit status, the worst of all."""
    units = chosen_units(options)
    _check_destinations(options)
    with Progress(2 * len(options.logs) + 1, options.quiet) as advance:
        found, work = inferred_work(options, partial(adapted, options=options), advance)
    searches = [search_options(options, one.structure) for one in work]
    with Progress(None, options.quiet, unit="band") as advance:
        found, work = with_followed_bands(options, found, work, searches, advance)
    print_inferred(found)
    status = 0
    for one, search in zip(work, searches):
        search["band"] = fitted_bands(options, one.structure, one.fit.band)
        files = _Files.of(options, one.label if len(work) > 1 else "")
        status |= _fitted(options, one.structure, one.estimated, search, units, files, "")
    return status


def _print_loops(options: argparse.Namespace) -> None:
    """Print the loops as flown, of logs that say them too."""
    from helisim.cli.margins import print_loops
    from helisim.look.loops import flown_loops

    print("\nloops as flown")
    try:
        with Progress(1, options.quiet) as advance:
            found = flown_loops(options.logs, start=options.from_time, stop=options.to_time)
            measured = found.margins()
            advance("margins")
    except (LogError, IdentificationError) as error:
        print(wrapped(f"not measured: {error}", indent=2))
    else:
        print_loops(found, measured)


def _fitted(
    options: argparse.Namespace,
    structure: "Structure",
    estimated: Estimated,
    search: dict[str, Any],
    units: Any,
    files: "_Files",
    said: str,
) -> int:
    """Fit a structure, print it under what is said, and write it. Return the exit status."""
    from helisim.ident import identify, reduce
    from helisim.ident.fitting.export import fit_text
    from helisim.ident.in_units import fit_in

    frf, reduction = estimated.response, None
    with (
        Progress(None, options.quiet, unit="search") as advance,
        located(estimated.logs),
    ):
        if options.reduce:
            reduction = reduce(frf, structure, on_progress=advance, **search)
            fit = reduction.fit
        else:
            fit = identify(frf, structure, on_progress=advance, **search)
    print(said)
    low, high = frf.frequency[[0, -1]]
    how = ", ".join(filter(None, (fit.method, frf.estimator)))
    print(f"band {low:.4g} to {high:.4g} rad/s, {how}\n")
    if reduction is not None:
        print(wrapped(str(reduction), indent=2))
    shown, notes = fit_in(fit, units) if units else (tuple(fit.parameters.values()), ())
    print(wrapped("\n".join([fit_text(fit, shown), *notes]), indent=2))
    print_suspicions(options, fit, estimated.logs)
    _write(options, estimated, fit, reduction, shown, files)
    return 0 if fit.converged and fit.acceptable and not fit.degenerate else 1


class _Files(NamedTuple):
    """What is written where; None for nothing."""

    json: Path | None
    latex: Path | None
    matlab: Path | None
    report: Path | None

    @classmethod
    def of(cls, options: argparse.Namespace, label: str = "") -> "_Files":
        """Return the files of one fit: of several each has its label, model-rollpitch.json."""
        paths = (options.json, options.latex, options.matlab, options.report)
        if not label:
            return cls(*paths)
        return cls(
            *(
                None if path is None else path.with_name(f"{path.stem}-{label}{path.suffix}")
                for path in paths
            )
        )


def _described(options: argparse.Namespace, frf: "FrequencyResponse") -> str:
    """Return which files gave the response, and what it holds."""
    files = ", ".join(map(str, options.logs))
    held = f"{', '.join(frf.outputs)} over {', '.join(frf.inputs)}"
    return wrapped(f"{files}: {held}, {frf.frequency.size} frequencies", indent=2)


def _response(
    options: argparse.Namespace,
    structure: "Structure",
    signals: Signals,
    advance: Callable[[str], None],
) -> Estimated:
    """Return the response that the files hold, or that of the logs. Raises HelisimError."""
    given = given_response(options, structure.inputs, structure.outputs)
    if given is None:
        return estimate(options, signals, advance)
    low, high = given.frequency[[0, -1]]
    return Estimated((), (), given, (float(low), float(high)))


def _asked(options: argparse.Namespace) -> "tuple[Structure, Signals]":
    """Return the structure and the signals that the options name. Raises InputError."""
    signals = Signals.of(options)
    structure = find_structure(options.structure, signals.inputs, signals.outputs)
    structure = adapted(structure, options)
    signals = signals._replace(
        inputs=signals.inputs or structure.inputs, outputs=signals.outputs or structure.outputs
    )
    _check_covered(structure.name, structure.inputs, signals.inputs, "input")
    _check_covered(structure.name, structure.outputs, signals.outputs, "output")
    return structure, signals


def _check_destinations(options: argparse.Namespace) -> None:
    from helisim.base.files import check_destination

    for path, suffix in (
        (options.json, ".json"),
        (options.latex, ".tex"),
        (options.matlab, ".mat"),
        (options.report, ".html"),
    ):
        if path is not None:
            check_destination(path, (suffix,))


def _write(
    options: argparse.Namespace,
    estimated: Estimated,
    fit: "Fit",
    reduction: "Reduction | None",
    shown: "Sequence[FittedParameter]",
    files: _Files,
) -> None:
    """Write what was asked for, the parameters in tables as they are shown, and say so."""
    from helisim.base.files import atomic_write, write_json
    from helisim.ident.fitting.export import latex_table

    if files.json is not None:
        log = {} if reduction is None else {"reduction": reduction.log()}
        write_json({**fit.to_dict(), **log, "logs": reports(estimated.logs)}, files.json)
    if files.latex is not None:
        with atomic_write(files.latex) as temporary:
            text = latex_table(shown, cost=fit.cost, provenance=fit.provenance)
            temporary.write_text(text, encoding="utf-8")
    if files.matlab is not None:
        fit.to_matlab(files.matlab)
    if files.report is not None:
        from helisim.show.report import write_fit_report

        records = {f"record {k + 1}": record for k, record in enumerate(estimated.records)}
        with Progress(len(records), options.quiet, unit="record") as advance:
            write_fit_report(
                files.report, fit, records=records, parameters=shown, on_progress=advance
            )
    for path in files:
        if path is not None:
            print_written(options, str(path))


def _check_covered(
    structure: str, needed: tuple[str, ...], given: tuple[str, ...], what: str
) -> None:
    missing = [name for name in needed if name not in given]
    if missing:
        raise InputError(
            f"the structure {structure!r} has the {what}s {', '.join(needed)}, and --{what}s gives "
            f"{', '.join(given)}; add {', '.join(missing)}, or --rename {missing[0]}=NAME"
        )
