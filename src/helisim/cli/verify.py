"""`helisim verify`: a model against records that no fit has seen."""

import argparse
import json
from pathlib import Path
from typing import Any

from helisim.cli.common import Progress, add_quiet
from helisim.cli.logs import MAP_HELP, add_log_options, describe, located, read_logs, reports
from helisim.errors import InputError

_EPILOG = f"""\
example:
  helisim verify model.json doublet.csv --map heli.toml --resample 100

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
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("model", type=Path, metavar="MODEL", help="model of identify, .json")
    add_log_options(command)
    command.add_argument("--json", type=Path, metavar="FILE", help="write the figures, .json")
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.ident import load_fit, verify
    from helisim.ident.frf import fingerprint
    from helisim.storage import atomic_write, check_destination

    fit = load_fit(options.model)
    if options.json is not None:
        check_destination(options.json, (".json",))
    wanted = (*fit.structure.inputs, *fit.structure.outputs)
    with Progress(len(options.logs) + 1, options.quiet) as advance:
        logs, records = read_logs(options, wanted, advance)
        for log in logs:
            if any(fingerprint(record) in fit.data.sources for record in log.records):
                raise InputError(
                    f"{log.report.path}: was used in the fit, so it can't verify it; give a log "
                    "that the fit has not seen"
                )
        with located(logs):
            verification = verify(fit, records)
        advance("simulation")
    print(f"{describe(logs)}\n")
    print(verification)
    if options.json is not None:
        data = {**verification.to_dict(), "model": str(options.model), "logs": reports(logs)}
        with atomic_write(options.json) as temporary:
            temporary.write_text(json.dumps(data, allow_nan=False) + "\n", encoding="utf-8")
        print(f"Written: {options.json}")
    return 0 if verification.acceptable else 1
