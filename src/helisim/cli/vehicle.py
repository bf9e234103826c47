"""`helisim vehicle`: make a vehicle of your own, check it, build its MJCF, list the shipped."""

import argparse
from pathlib import Path
from typing import Any

from helisim.cli.common import add_quiet, add_vehicle, print_written, single_line

_EPILOG = """\
examples:
  helisim vehicle list
  helisim vehicle new myheli --like jr700      the folder myheli/, which flies
  helisim vehicle check myheli                 what is wrong with it, with lines
  helisim fly myheli --axis lat --out lat.parquet
  helisim vehicle build myheli                 its MJCF for stock MuJoCo

A vehicle is a folder: every command takes its path. parameters.toml in it
says of each line what it is, in which unit, and where to get it.
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "vehicle",
        help="make a vehicle of your own, check it, build its MJCF, list the shipped",
        description="Make a vehicle of your own from a shipped one, say what is wrong with it, "
        "write its numbers for stock MuJoCo, list what is shipped.",
        epilog=_EPILOG,
    )
    parts = command.add_subparsers(
        dest="part", required=True, metavar="PART", parser_class=type(command)
    )
    _add_new(parts)
    _add_check(parts)
    _add_build(parts)
    parts.add_parser("list", help="list the shipped vehicles").set_defaults(run=_list)


def _add_new(parts: Any) -> None:
    new = parts.add_parser(
        "new",
        help="make a folder that flies at once, commented line by line",
        description="Make a vehicle's folder from another's. It flies at once; change it line by "
        "line. Nothing that is there is overwritten.",
        epilog="example: helisim vehicle new myheli --like blade360",
    )
    new.add_argument("name", metavar="NAME", help="of the vehicle and its folder")
    new.add_argument(
        "--like",
        default="jr700",
        metavar="VEHICLE",
        help="that it is made from, name or path (default: jr700)",
    )
    new.add_argument(
        "--to", type=Path, metavar="DIR", help="in which its folder is made (default: here)"
    )
    add_quiet(new)
    new.set_defaults(run=_new)


def _new(options: argparse.Namespace) -> int:
    from helisim.study.new_vehicle import new_vehicle

    folder = new_vehicle(options.name, like=options.like, to=options.to)
    shown = folder.name if options.to is None else options.to / folder.name
    print_written(options, f"{shown}; next: see {shown}/README.md, or helisim linearize {shown}")
    return 0


def _add_check(parts: Any) -> None:
    check = parts.add_parser(
        "check",
        help="say everything that is wrong with a vehicle, with its line and the remedy",
        description="Say everything that is wrong with a vehicle's folder, each with its line and "
        "the remedy, and print what it is in the hover. Exit status 2 if anything is wrong.",
        epilog="example: helisim vehicle check myheli",
    )
    add_vehicle(check)
    add_quiet(check)
    check.set_defaults(run=_check)


def _check(options: argparse.Namespace) -> int:
    from helisim.show.terminal import render_check
    from helisim.study.check import check_vehicle

    found = check_vehicle(options.vehicle)
    for problem in found.problems:
        print(single_line(str(problem)))
    if not options.quiet:
        print(render_check(found))
    return 2 if found.problems else 0


def _add_build(parts: Any) -> None:
    build = parts.add_parser(
        "build",
        help="write the force laws' numbers into the vehicle's MJCF",
        description="Write into a vehicle's MJCF what its parameters give: the numbers of the "
        "force laws, the gyro's timing, the fuselage's inertia and the trim of the keyframe "
        "hover. Stock MuJoCo flies it then, within helisim.installed(). Nothing else of the file "
        "is changed.",
        epilog="example: helisim vehicle build myheli",
    )
    build.add_argument("vehicle", metavar="VEHICLE", help="its folder, or name of a shipped one")
    build.add_argument(
        "--check",
        action="store_true",
        help="write nothing; say what is not as the parameters give it, status 1",
    )
    add_quiet(build)
    build.set_defaults(run=_build)


def _build(options: argparse.Namespace) -> int:
    from helisim.vehicle.build import unwritten, write_numbers

    if options.check:
        changes = unwritten(options.vehicle)
        for change in changes:
            print(f"{change.element.place}: {', '.join(change.numbers)}")
        return 1 if changes else 0
    written = write_numbers(options.vehicle)
    for path in written:
        print_written(options, str(path))
    if not written and not options.quiet:
        print("Nothing to write: the MJCF says what the parameters give")
    return 0


def _list(options: argparse.Namespace) -> int:
    from helisim.vehicle.folder import model_folder, vehicle_names

    for name in vehicle_names():
        title = (model_folder(name) / "README.md").read_text(encoding="utf-8").splitlines()[0]
        print(f"{name:<10} {title.lstrip('# ')}")
    return 0
