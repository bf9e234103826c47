"""`helisim design`: a control law from the records of a run, and its proof in flight."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, print_recording, print_written
from helisim.cli.progress import Progress

_RUN, _OUT = Path("reproduction"), Path("design")
GUST = "gust.rrd"
"""How a gust is rejected, before and after."""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "design",
        help="design a control law on identified models, and prove it in flight",
        description="Identify a vehicle from the records of helisim reproduce, find the parameters "
        "of a control law that meet specifications in the worst of the models that the records "
        "leave possible, fly it on the nonlinear vehicle, and hold what was asked, predicted, "
        "exact and flown side by side.",
        epilog="examples:\n"
        "  helisim reproduce\n"
        "  helisim design                              all of it, into design/\n"
        "  helisim design --specs specs.toml --no-proof\n"
        "  helisim fly --controller design/law.toml\n\n"
        "Exit status 1: a level is missed, in a model drawn or in flight. 2: a\n"
        "specification can't be met, or the input is at fault.",
    )
    command.add_argument(
        "source",
        nargs="*",
        type=Path,
        metavar="RUN",
        help=f"folder of helisim reproduce (default: {_RUN}), or flight records of sweeps",
    )
    command.add_argument(
        "--vehicle",
        metavar="FOLDER",
        help="that flew the records, a shipped one's name or a folder (default: as they say)",
    )
    command.add_argument(
        "--specs",
        type=Path,
        metavar="FILE",
        help="specifications, TOML (default: margins of 45 deg and 6 dB; ADS-33 and disturbance "
        "rejection, scaled; 1.3 times the rejection bandwidth of the gyro in roll and pitch)",
    )
    command.add_argument(
        "--law",
        type=Path,
        metavar="FILE",
        help="law whose parameters are moved, TOML (default: attitude command with the inverse "
        "of the identified model)",
    )
    command.add_argument(
        "--out", type=Path, default=_OUT, metavar="DIR", help=f"folder (default: {_OUT})"
    )
    command.add_argument("--no-proof", action="store_true", help="don't fly the law")
    command.add_argument(
        "--margin",
        type=float,
        metavar="M",
        help="design margin, as a share of the distance between Levels 1 and 2 (default: 0.1)",
    )
    command.add_argument(
        "--models", type=int, metavar="N", help="drawn to design with (default: 20)"
    )
    command.add_argument("--drawn", type=int, metavar="N", help="drawn to judge by (default: 200)")
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of draws and flights (default: 1)"
    )
    command.add_argument("--json", action="store_true", help="print the result as JSON, no table")
    add_quiet(command)
    command.set_defaults(run=_run)


def record_gust(run: Any, path: Path) -> None:
    """Write how the vehicle's own gyro and the designed law reject one gust, side by side."""
    from helisim.show.recording import write_recording

    flights = {"shipped gyro": run.proof.before["gust"], "designed law": run.proof.flights.gust}
    model, roles = run.vehicle.visual_model(), run.vehicle.roles
    write_recording(path, flights, model=model, roles=roles, side_by_side=True)


def _source(paths: Sequence[Path]) -> Any:
    """Return the one folder that was given, or the records of files."""
    from helisim.records.storage import read_record

    if len(paths) == 1 and (paths[0].is_dir() or not paths[0].suffix):
        return paths[0]
    return [read_record(path) for path in paths]


def _run(options: argparse.Namespace) -> int:
    from helisim.base.files import make_folder
    from helisim.design.laws import read_law
    from helisim.handling.spec import read_specs
    from helisim.show import tables
    from helisim.show.design_page import REPORT, write_design_page
    from helisim.show.table import as_text
    from helisim.show.terminal import wants_color
    from helisim.study.design_chain import (
        LAW,
        PROOF,
        RESULT,
        DesignOptions,
        flown_figures,
        run_design,
        write_design,
    )
    from helisim.vehicle import load

    given = {"margin": options.margin, "models": options.models, "drawn": options.drawn}
    chosen = DesignOptions(
        seed=options.seed,
        proof=not options.no_proof,
        **{name: value for name, value in given.items() if value is not None},
    )
    specs = None if options.specs is None else read_specs(options.specs)
    law = None if options.law is None else read_law(options.law)
    vehicle = None if options.vehicle is None else load(options.vehicle)
    with Progress(None, options.quiet) as advance:
        run = run_design(
            _source(options.source or [_RUN]),
            vehicle=vehicle,
            law=law,
            specs=specs,
            options=chosen,
            on_step=advance,
        )
        make_folder(options.out)
        write_design(run, options.out)
        write_design_page(
            options.out / REPORT,
            run.result,
            proof=run.proof,
            predicted=run.loop(run.result.law),
            before=run.loop(run.result.before),
        )
        if run.proof is not None:
            record_gust(run, options.out / GUST)
    if options.json:
        found = {"design": run.result.to_dict(), "proof": run.proof and run.proof.to_dict()}
        print(json.dumps(found, indent=2, allow_nan=False))
    else:
        color = wants_color(sys.stdout)
        flown = None if run.proof is None else flown_figures(run.proof)
        print(as_text(tables.design(run.result, flown), color=color))
        for miss in (*run.result.misses, *(run.proof.misses if run.proof else ())):
            print(f"- {miss}")
        print_written(options, f"{options.out / LAW}: helisim fly --controller {options.out / LAW}")
        print_written(options, f"{options.out / RESULT}")
        print_written(options, f"{options.out / REPORT}: charts with levels, loops, steps")
        if run.proof is not None:
            print_written(options, f"{options.out / PROOF}: the flights of the proof")
            print_recording(options.out / GUST, options.quiet)
    return 0 if run.met else 1
