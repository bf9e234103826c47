"""The command line: each command parses, calls the library once, prints, and exits.

Exit status: 0 all is well, 1 a parameter misses its tolerance, 2 the input is at fault,
130 interrupted.
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn

from tqdm import tqdm

from helisim.channels import AXES
from helisim.errors import HelisimError, InputError
from helisim.output.tables import render_derivatives, render_results, wants_color

_EXAMPLES = """\
examples:
  helisim reproduce --out reproduction      the paper's experiment, end to end
  helisim fly --axis lat --out lat.parquet  one lateral sweep
  helisim linearize --json                  the exact linear model, for a script
"""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and exits with status 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        return options.run(options)
    except HelisimError as error:
        print(f"helisim {options.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"helisim {options.command}: interrupted", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="helisim",
        description="Fly, sweep, identify and verify a nonlinear helicopter in MuJoCo.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"helisim {version('helisim')}")
    commands = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", parser_class=_Parser
    )
    _add_reproduce(commands)
    _add_fly(commands)
    _add_linearize(commands)
    _add_calibrate(commands)
    return parser


def _add_reproduce(commands: Any) -> None:
    command = commands.add_parser(
        "reproduce",
        help="fly the paper's experiment, identify its models, compare",
        description="Fly sweeps on all four axes, identify the paper's models from the records, "
        "and print them beside the paper and the exact linearisation of the model that flew.",
        epilog="example: helisim reproduce --out reproduction --flights 10 --seed 1",
    )
    command.add_argument(
        "--out",
        type=Path,
        default=Path("reproduction"),
        metavar="DIR",
        help="folder of results.json and flights/ (default: reproduction)",
    )
    command.add_argument(
        "--flights", type=int, default=10, metavar="N", help="kept on each axis (default: 10)"
    )
    command.add_argument("--jobs", type=int, metavar="J", help="threads (default: all processors)")
    command.add_argument("--timestep", type=float, metavar="S", help="of the simulation, s")
    _add_common(command)
    command.set_defaults(run=_reproduce)


def _add_fly(commands: Any) -> None:
    command = commands.add_parser(
        "fly",
        help="fly one sweep and record it",
        description="Fly one frequency sweep and write what the flight computer records.",
        epilog="example: helisim fly --axis lat --duration 90 --seed 1 --out lat.parquet",
    )
    command.add_argument("--axis", required=True, metavar="AXIS", help="|".join(AXES))
    command.add_argument(
        "--duration", type=float, default=90.0, metavar="S", help="of the flight, s (default: 90)"
    )
    command.add_argument(
        "--amplitude",
        type=float,
        metavar="A",
        help="of the stick, unitised (default: the axis's own)",
    )
    command.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="record to write, .parquet or .csv"
    )
    _add_common(command)
    command.set_defaults(run=_fly)


def _add_common(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--seed", type=int, default=1, metavar="S", help="of pilot and sensors (default: 1)"
    )
    command.add_argument(
        "--rerun", type=Path, metavar="FILE", help="write a Rerun recording too, .rrd"
    )
    _add_parameters(command)
    command.add_argument("--quiet", action="store_true", help="no progress bar")


def _add_parameters(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="replace a physical parameter, such as "
        "main_rotor.hub_stiffness=100 (SI); may be given again",
    )


def _add_linearize(commands: Any) -> None:
    command = commands.add_parser(
        "linearize",
        help="print the exact linearisation at the hover",
        description="Print the exact linearisation of the nonlinear vehicle at its hover.",
        epilog="example: helisim linearize --inputs IN2 --json",
    )
    command.add_argument(
        "--inputs",
        default="IN1",
        metavar="IN",
        help="IN1 (servo commands to motion, default) or IN2 (sticks to motion)",
    )
    command.add_argument("--json", action="store_true", help="matrices and names as JSON")
    _add_parameters(command)
    command.set_defaults(run=_linearize)


def _add_calibrate(commands: Any) -> None:
    command = commands.add_parser(
        "calibrate",
        help="solve the physical parameters from the paper's tables",
        description="Solve for the physical parameters whose linearised flight has the paper's "
        "derivatives.",
        epilog="example: helisim calibrate > calibrated.toml",
    )
    command.add_argument(
        "--write",
        action="store_true",
        help="replace the vehicle's calibrated.toml instead of printing it",
    )
    command.set_defaults(run=_calibrate)


def _reproduce(options: argparse.Namespace) -> int:
    from helisim import pipeline
    from helisim.experiment import MODELS
    from helisim.storage import check_destination

    if options.flights < 1:
        raise InputError(f"--flights must be 1 or more, got {options.flights}")
    if options.rerun is not None:
        check_destination(options.rerun, (".rrd",))
    steps = pipeline.flights_in_all(options.flights) + len(MODELS)
    with _Progress(steps, options.quiet) as advance:
        results, flights = pipeline.reproduce(
            out=options.out,
            flights=options.flights,
            seed=options.seed,
            jobs=options.jobs,
            parameters=_parameters(options),
            timestep=options.timestep,
            on_progress=advance,
        )
    print(render_results(results, color=wants_color(sys.stdout)))
    print(f"\nWritten: {options.out / 'results.json'}, records in {options.out / 'flights'}")
    if options.rerun is not None:
        records = pipeline.named_records(flights)
        _write_recording(options.rerun, records)
    return 1 if results.misses else 0


def _fly(options: argparse.Namespace) -> int:
    from helisim.sim import Sweep, fly
    from helisim.storage import check_destination, write_record
    from helisim.vehicle import load

    sweep = Sweep(axis=options.axis, duration=options.duration, amplitude=options.amplitude)
    check_destination(options.out)
    if options.rerun is not None:
        check_destination(options.rerun, (".rrd",))
    vehicle = load(parameters=_parameters(options))
    with _Progress(1, options.quiet) as advance:
        (record,) = fly(vehicle, sweep, seed=options.seed, on_flight=lambda: advance("flight"))
    write_record(record, options.out)
    print(
        f"Written: {options.out} ({record.duration:.2f} s, {len(record)} samples, "
        f"{len(record.names)} channels)"
    )
    if options.rerun is not None:
        _write_recording(options.rerun, {options.axis: record})
    return 0


def _linearize(options: argparse.Namespace) -> int:
    from helisim.vehicle import load

    vehicle = load(parameters=_parameters(options))
    linear = vehicle.linearize(options.inputs)
    if options.json:
        print(json.dumps({**linear.to_dict(), "derivatives": vehicle.derivatives}, indent=2))
    else:
        print(render_derivatives(linear, vehicle.derivatives))
    return 0


def _calibrate(options: argparse.Namespace) -> int:
    from helisim.pipeline import calibrated_text
    from helisim.storage import atomic_write
    from helisim.vehicle.assembly import model_folder

    text = calibrated_text("jr700")
    if not options.write:
        print(text, end="")
        return 0
    path = model_folder("jr700") / "calibrated.toml"
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(f"Written: {path}")
    return 0


def _parameters(options: argparse.Namespace) -> dict[str, float]:
    values = {}
    for item in options.set:
        name, equals, text = item.partition("=")
        try:
            values[name.strip()] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"--set takes NAME=VALUE with a number, got {item!r}")
    return values


def _write_recording(path: Path, records: Any) -> None:
    from helisim.output.rerun_log import write_recording
    from helisim.vehicle import load

    write_recording(path, records, model=load().visual_model())
    print(f"Written: {path}; open it with: rerun {path}")


class _Progress:
    """A progress bar on standard error; silent where that is no terminal, or when asked."""

    def __init__(self, steps: int, quiet: bool) -> None:
        self._bar = tqdm(total=steps, disable=quiet or None, unit="step", leave=False)

    def __enter__(self) -> Callable[[str], None]:
        return self._advance

    def _advance(self, label: str) -> None:
        self._bar.set_description(label)
        self._bar.update()

    def __exit__(self, *_: object) -> None:
        self._bar.close()


if __name__ == "__main__":
    sys.exit(main())
