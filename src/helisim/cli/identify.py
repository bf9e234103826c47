"""`helisim identify`: from logs to a model with bounds."""

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

from helisim.cli.common import Progress, add_quiet, named_numbers, names
from helisim.cli.logs import (
    MAP_HELP,
    add_log_options,
    band,
    check_moving,
    describe,
    located,
    read_logs,
    reports,
)
from helisim.cli.structures import find_structure
from helisim.errors import InputError

_EPILOG = f"""\
example:
  helisim identify lat.csv lon.csv --structure rollpitch --map heli.toml --resample 100 \\
      --band 1 40 --json model.json
  helisim identify yaw.parquet --structure tf:1/2 --inputs PED --outputs r --json yaw.json

The model in --json is what `helisim verify` reads. Exit status 1: the search didn't converge
or the fit's cost is beyond the guidelines.

{MAP_HELP}"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "identify",
        help="identify a model from flight logs",
        description="Estimate frequency responses from flight logs, by anyone, fit a structure's "
        "parameters to them, and print values with Cramér-Rao bounds and insensitivities.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_log_options(command)
    command.add_argument(
        "--structure",
        required=True,
        metavar="NAME|FILE",
        help="built-in name, tf:ZEROS/POLES, or a TOML file; `helisim structures` lists them",
    )
    command.add_argument("--rename", metavar="OLD=NEW,...", help="channels of the structure")
    add_responses(command, required=False)
    command.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="keep a parameter at a value, SI; may be given again",
    )
    command.add_argument(
        "--start",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="start a parameter at a value, SI; may be given again",
    )
    command.add_argument(
        "--responses", metavar="A/B,...", help="responses to fit, such as p/lat (default: all)"
    )
    command.add_argument(
        "--reduce", action="store_true", help="drop the parameters that the data don't support"
    )
    command.add_argument(
        "--seed", type=int, default=0, metavar="S", help="of the search's starts (default: 0)"
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="write the model, for verify")
    command.add_argument("--latex", type=Path, metavar="FILE", help="write the table, .tex")
    command.add_argument("--matlab", type=Path, metavar="FILE", help="write the model, .mat")
    command.add_argument("--report", type=Path, metavar="FILE", help="write a page, .html")
    add_quiet(command)
    command.set_defaults(run=_run)


def add_responses(command: argparse.ArgumentParser, *, required: bool) -> None:
    """Add the options of which responses are estimated and how."""
    default = "" if required else " (default: the structure's)"
    command.add_argument(
        "--inputs", required=required, metavar="A,B", help=f"channels that act{default}"
    )
    command.add_argument(
        "--outputs", required=required, metavar="P,Q", help=f"channels that answer{default}"
    )
    command.add_argument(
        "--conditioning", metavar="C,D", help="further inputs whose effect is removed"
    )
    command.add_argument(
        "--reference",
        metavar="A,B",
        help="signals outside the loop, such as the sticks: joint input-output method, which "
        "feedback and gusts don't bias",
    )
    command.add_argument(
        "--band",
        nargs=2,
        type=float,
        metavar=("LO", "HI"),
        help="rad/s (default: what the records resolve)",
    )


def _run(options: argparse.Namespace) -> int:
    from helisim.ident import frequency_response, identify, reduce
    from helisim.ident.conditioning import CrossControlWarning
    from helisim.storage import atomic_write, check_destination

    inputs, outputs = names(options.inputs), names(options.outputs)
    structure = find_structure(options.structure, inputs, outputs)
    if options.rename is not None:
        structure = structure.renamed(_renames(options.rename))
    structure = structure.with_starts(named_numbers("--start", options.start))
    structure = structure.with_fixed(named_numbers("--fix", options.fix))
    inputs, outputs = inputs or structure.inputs, outputs or structure.outputs
    others, reference = names(options.conditioning), names(options.reference)
    _check_covered(structure.name, structure.inputs, inputs, "input")
    _check_covered(structure.name, structure.outputs, outputs, "output")
    for path, suffixes in (
        (options.json, (".json",)),
        (options.latex, (".tex",)),
        (options.report, (".html",)),
    ):
        if path is not None:
            check_destination(path, suffixes)
    if options.matlab is not None:
        check_destination(options.matlab, (".mat",))
    wanted = tuple(dict.fromkeys((*inputs, *others, *reference, *outputs)))
    with Progress(len(options.logs) + 2, options.quiet) as advance, warnings.catch_warnings():
        warnings.simplefilter("ignore", CrossControlWarning)  # the fit's text says it
        logs, records = read_logs(options, wanted, advance)
        check_moving(logs, wanted)
        with located(logs):
            edges = band(options, records)
            frf = frequency_response(
                records,
                inputs=inputs,
                outputs=outputs,
                band=edges,
                conditioning=others,
                reference=reference,
            )
            advance("frequency responses")
            responses = names(options.responses) or None
            if options.reduce:
                reduction = reduce(frf, structure, responses=responses, seed=options.seed)
                fit, story = reduction.fit, f"{reduction}\n"
            else:
                fit = identify(frf, structure, responses=responses, seed=options.seed)
                story = ""
            advance("fit")
    print(describe(logs))
    print(f"band {edges[0]:.4g} to {edges[1]:.4g} rad/s, {fit.method}\n")
    print(story + str(fit))
    if options.json is not None:
        text = json.dumps({**fit.to_dict(), "logs": reports(logs)}, allow_nan=False)
        with atomic_write(options.json) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")
    if options.latex is not None:
        with atomic_write(options.latex) as temporary:
            temporary.write_text(fit.to_latex(), encoding="utf-8")
    if options.matlab is not None:
        with atomic_write(options.matlab) as temporary:
            fit.to_matlab(temporary)
    if options.report is not None:
        from helisim.output.report_fit import write_fit_report

        shown = {f"record {k + 1}": record for k, record in enumerate(records)}
        write_fit_report(options.report, fit, records=shown)
    for path in (options.json, options.latex, options.matlab, options.report):
        if path is not None:
            print(f"Written: {path}")
    return 0 if fit.converged and fit.acceptable else 1


def _renames(text: str) -> dict[str, str]:
    renames = {}
    for item in names(text):
        old, equals, new = item.partition("=")
        if not equals or not old.strip() or not new.strip():
            raise InputError(f"--rename takes OLD=NEW, such as lat=LAT, got {item!r}")
        renames[old.strip()] = new.strip()
    return renames


def _check_covered(
    structure: str, needed: tuple[str, ...], given: tuple[str, ...], what: str
) -> None:
    missing = [name for name in needed if name not in given]
    if missing:
        raise InputError(
            f"the structure {structure!r} has the {what}s {', '.join(needed)}, and --{what}s gives "
            f"{', '.join(given)}; add {', '.join(missing)}, or --rename {missing[0]}=NAME"
        )
