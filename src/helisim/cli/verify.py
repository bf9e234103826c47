"""`helisim verify`: a model against records that no fit has seen."""

import argparse
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, print_written
from helisim.cli.inferred import read_sweeps
from helisim.cli.logs import MAP_HELP, add_log_options, describe, located, read_logs, reports
from helisim.cli.progress import Progress
from helisim.cli.units import add_units, chosen_units

_EPILOG = f"""\
example:
  helisim verify model.json doublet.csv --map heli.toml --resample 100
  helisim verify hover.json flight.csv --map heli.toml --ahead 0.5

An unstable model diverges from any initial state: it is verified in segments,
and says so.

Exit status 1: Theil's coefficient is above 0.25.

{MAP_HELP}"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "verify",
        help="simulate an identified model on other flight logs",
        description="Simulate a model that `helisim identify --json` wrote on flight logs that it "
        "was not fitted to, estimating only bias and trim, and print J_rms and Theil's "
        "inequality coefficient.",
        epilog=_EPILOG,
    )
    command.add_argument("model", type=Path, metavar="MODEL", help="model of identify, .json")
    add_log_options(command)
    command.add_argument(
        "--segment",
        type=float,
        metavar="S",
        help="verify in segments of S seconds, each from a state of its own; by default an "
        "unstable model's, in which its errors double three times at most",
    )
    command.add_argument(
        "--ahead",
        type=float,
        metavar="S",
        help="predict each sample S seconds ahead, from the samples before it alone; --segment "
        "is then how much of the past gives a state",
    )
    command.add_argument("--json", type=Path, metavar="FILE", help="write the figures, .json")
    add_units(command, "J_rms")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import check_destination, write_json
    from helisim.ident import load_fit, verify
    from helisim.ident.verify import refuse_seen
    from helisim.records.provenance import made_by

    units = chosen_units(options)
    fit = load_fit(options.model)
    if options.json is not None:
        check_destination(options.json, (".json",))
    wanted = (*fit.structure.inputs, *fit.structure.outputs)
    with Progress(len(options.logs) + 1, options.quiet) as advance:
        swept = read_sweeps(options, fit.structure.inputs, fit.structure.outputs, advance)
        logs, records = swept or read_logs(options, wanted, advance)
        for log in logs:
            for record in log.records:
                refuse_seen(fit, record, log.report.path)
        with located(logs):
            verification = verify(
                fit,
                records,
                segment=options.segment,
                ahead=options.ahead,
                use_ended=options.use_ended,
            )
        advance("simulation")
    print(f"{describe(logs)}\n")
    print(verification.in_units(units) if units else verification)
    if options.json is not None:
        data = {
            **verification.to_dict(),
            "model": str(options.model),
            "logs": reports(logs),
            "provenance": made_by("verification", fit=fit.provenance),
        }
        write_json(data, options.json)
        print_written(options, str(options.json))
    return 0 if verification.acceptable else 1
