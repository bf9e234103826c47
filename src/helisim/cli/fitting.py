"""Options of which parameters a fit varies, how it searches, and what a reduction drops."""

import argparse
import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from helisim.base.errors import InputError
from helisim.cli.bands import Band, Bands
from helisim.cli.common import named_numbers, names

if TYPE_CHECKING:
    from helisim.ident import Parameter, Structure


def add_fitting(command: argparse.ArgumentParser) -> None:
    """Add the options."""
    _add_parameters(command)
    _add_search(command)
    _add_reduction(command)


def _add_parameters(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group(
        "parameters of the structure",
        "Names, units and starts are in `helisim structures NAME`. Values are in SI.\n"
        "Each option may be given again.",
    )
    group.add_argument(
        "--start",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="where the search begins: an order of magnitude is enough",
    )
    group.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="NAME=VALUE[+-ERROR]",
        help="what is known already: keep it, and fit the others; its standard error, as from a "
        "bench, goes on into theirs: omega=62+-0.5",
    )
    group.add_argument(
        "--bounds",
        action="append",
        default=[],
        metavar="NAME=LO:HI",
        help="values that are possible; without LO or HI that side is open, as in tau=0:",
    )
    group.add_argument(
        "--known",
        action="append",
        default=[],
        metavar="SIGNAL,...=BLOCK",
        help="a servo before an input or a filter behind an output, as one knows it from a bench: "
        "lat,lon=second_order:omega=62+-1,zeta=0.7 or p=low_pass:corner=40,order=2, SI; what is "
        "left out is fitted (first_order, second_order, low_pass, inflow, delay)",
    )
    group.add_argument(
        "--rename",
        metavar="OLD=NEW,...",
        help="the structure's channels by other names, as lat=LAT for the stick",
    )


def _add_search(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("how the parameters are fitted")
    group.add_argument(
        "--responses", metavar="A/B,...", help="responses to fit, such as p/lat (default: all)"
    )
    group.add_argument(
        "--points",
        type=int,
        default=20,
        metavar="N",
        help="frequencies that are fitted in each response, log-spaced (default: 20)",
    )
    group.add_argument(
        "--searches",
        type=int,
        default=12,
        metavar="N",
        help="starts to try at most, scattered around the structure's; two that end alike "
        "suffice (default: 12)",
    )
    group.add_argument(
        "--seed", type=int, default=0, metavar="S", help="of the scattered starts (default: 0)"
    )
    group.add_argument(
        "--weighting",
        choices=("error", "coherence"),
        default="error",
        help="what a point counts by: its own random error (default), or CIFER's weight, by "
        "coherence",
    )


def _add_reduction(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("parameters that the data don't support")
    group.add_argument(
        "--reduce",
        action="store_true",
        help="set them to zero, worst first, as long as the cost hardly rises",
    )
    group.add_argument("--keep", metavar="NAME,...", help="with --reduce: those that must stay")
    group.add_argument(
        "--rise",
        type=float,
        metavar="J",
        help="with --reduce: by how much the average cost may rise in all (default: 1)",
    )
    group.add_argument(
        "--drop-delays", action="store_true", help="with --reduce: delays may be dropped too"
    )


def adapted(structure: "Structure", options: argparse.Namespace) -> "Structure":
    """Return a structure with the options' channels, bounds, starts and fixed values.

    Raises:
        InputError: an option isn't of its form, or names what does not exist.
    """
    if options.rename is not None:
        structure = structure.renamed(_renames(options.rename))
    structure = _with_blocks(structure, options.known)
    bounds = dict(_bounds(item) for item in options.bounds)
    starts = named_numbers("--start", options.start)
    fixed, errors = _known(options.fix)
    within = {name: _start(structure.parameter(name), *bounds[name]) for name in bounds}
    structure = structure.with_bounds(dict.fromkeys(bounds))
    structure = structure.with_starts(within | starts).with_bounds(bounds)
    return structure.with_fixed(fixed, errors)


def _known(items: Sequence[str]) -> tuple[dict[str, float], dict[str, float]]:
    """Return NAME=VALUE[+-ERROR] items as values and as errors by name. Raises InputError."""
    apart = [re.split(r"\+-|\+/-|±", item, maxsplit=1) for item in items]
    values = named_numbers("--fix", [value for value, *_ in apart])
    named = [f"{value.partition('=')[0]}={error}" for value, *errors in apart for error in errors]
    return values, named_numbers("--fix NAME=VALUE+-ERROR:", named)


def _with_blocks(structure: "Structure", items: Sequence[str]) -> "Structure":
    """Return a structure with the blocks of SIGNAL,...=BLOCK in series. Raises InputError."""
    if not items:
        return structure
    from helisim.ident.model.blocks import with_blocks

    series = {}
    for item in items:
        signals, equals, block = item.partition("=")
        if not equals or not names(signals):
            raise InputError(
                f"--known takes SIGNAL=BLOCK, such as lat=delay:tau=0.02, got {item!r}"
            )
        if signals in series:
            raise InputError(f"--known {signals} was given twice: a signal has one block")
        series[signals] = block
    return with_blocks(structure, series)


def _start(parameter: "Parameter", low: float, high: float) -> float:
    """Return where a parameter starts within new bounds: as before, or in between."""
    if low <= parameter.start <= high:
        return parameter.start
    if math.isfinite(low) and math.isfinite(high):
        return 0.5 * (low + high)
    return low + parameter.magnitude if math.isfinite(low) else high - parameter.magnitude


def search_options(options: argparse.Namespace, structure: "Structure") -> dict[str, Any]:
    """Return what `identify` and `reduce` are given beside responses, structure and bands.

    Raises:
        UnknownNameError: --band names a response that isn't fitted.
        InputError: an option of --reduce is given without it.
    """
    Bands.of(options).check(_fitted(options, structure))
    search: dict[str, Any] = {
        "responses": names(options.responses) or None,
        "frequencies_per_response": options.points,
        "searches": options.searches,
        "seed": options.seed,
        "weighting": options.weighting,
    }
    if options.reduce:
        search |= {"keep": names(options.keep), "delays": options.drop_delays}
        return search if options.rise is None else search | {"rise": options.rise}
    if options.keep is not None or options.rise is not None or options.drop_delays:
        raise InputError("--keep, --rise and --drop-delays belong to --reduce: add it")
    return search


def fitted_bands(
    options: argparse.Namespace, structure: "Structure", default: Band
) -> dict[str, Band] | Band:
    """Return the band of all fitted responses or of each, rad/s.

    Args:
        options: of the command.
        structure: that is fitted.
        default: of a response for which --band says nothing.
    """
    bands = Bands.of(options)
    own = bands.by_response(_fitted(options, structure), default)
    return own or bands.common or default


def _fitted(options: argparse.Namespace, structure: "Structure") -> tuple[str, ...]:
    pairs = [f"{output}/{input_}" for output in structure.outputs for input_ in structure.inputs]
    return names(options.responses) or tuple(pairs)


def _bounds(item: str) -> tuple[str, tuple[float, float]]:
    """Return NAME=LO:HI as a name and bounds, infinite where a side is left out."""
    name, _, edges = item.partition("=")
    low, colon, high = edges.partition(":")
    try:
        if name.strip() and colon:
            return name.strip(), (float(low or -math.inf), float(high or math.inf))
    except ValueError:
        pass
    raise InputError(f"--bounds takes NAME=LO:HI, such as tau=0:0.5 or tau=0:, got {item!r}")


def _renames(text: str) -> dict[str, str]:
    renames = {}
    for item in names(text):
        old, equals, new = item.partition("=")
        if not equals or not old.strip() or not new.strip():
            raise InputError(f"--rename takes OLD=NEW, such as lat=LAT, got {item!r}")
        renames[old.strip()] = new.strip()
    return renames
