"""What `helisim identify` does with logs that say themselves what they are."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

from helisim.base.errors import InputError
from helisim.cli.bands import Bands
from helisim.cli.common import names, wrapped
from helisim.cli.logs import Read, given_columns, located
from helisim.cli.responses import Estimated, Signals, estimator_options, resolved_band
from helisim.cli.structures import find_structure

if TYPE_CHECKING:
    from helisim.ident import Structure
    from helisim.look.systemid import Inferred, InferredFit

_OF_ONE = ("fix", "start", "bounds", "known", "rename", "responses", "keep")
"""Options that name what one structure has."""


class InferredWork(NamedTuple):
    """One fit that is to be made: of which structure, to what, and what it is called."""

    fit: "InferredFit"
    structure: "Structure"
    estimated: Estimated

    @property
    def label(self) -> str:
        """For the names of files."""
        if not self.fit.structure.startswith("tf:"):
            return self.fit.structure
        return "_".join((*self.fit.outputs, *self.fit.inputs))


def infers(options: argparse.Namespace) -> bool:
    """Return whether logs are to say what the options leave open.

    Raises:
        InputError: something is left open that the logs can't say.
    """
    from helisim.base.files import first_bytes
    from helisim.logs.dataflash import is_dataflash

    if options.structure is not None and not all(path.is_file() for path in options.logs):
        return False  # which is said where they are read; or they are p/lat=FILE
    logged = [path for path in options.logs if is_dataflash(path)]
    if options.structure is None:
        if len(logged) < len(options.logs):
            other = next(path for path in options.logs if path not in logged)
            if not first_bytes(other, 1):
                raise InputError(f"{other}: the file is empty")
            raise InputError(
                f"{other}: not a log of an autopilot's system identification, so --structure has "
                "to be said; helisim structures lists them, and helisim look LOG says what to run"
            )
        return True
    if not logged or len(logged) < len(options.logs):
        return False
    signals = Signals.of(options)
    structure = find_structure(options.structure, signals.inputs, signals.outputs)
    wanted = {*(signals.inputs or structure.inputs), *(signals.outputs or structure.outputs)}
    return not wanted <= set(given_columns(options)[0].channels)


def inferred_work(
    options: argparse.Namespace,
    adapted: "Callable[[Structure], Structure]",
    advance: Callable[[str], None],
) -> "tuple[Inferred, list[InferredWork]]":
    """Return what logs of SystemID say, and the fits, with their responses estimated.

    Args:
        options: of the command; they overrule what the logs say.
        adapted: returns a structure as the options want it.
        advance: called with each file's name.

    Raises:
        HelisimError: the logs can't be used, or not so.
    """
    from helisim.look.systemid import estimate_fits

    found = _inferred(options)
    fits = _fits(options, found)
    structures = [_structure(fit, adapted) for fit in fits]
    found = replace(found, fits=fits)
    wanted = {name for fit in fits for name in (*fit.inputs, *fit.outputs, *fit.conditioning)}
    wanted |= {name for fit in fits for name in fit.reference}
    logs = found.read(wanted, on_progress=advance)
    records = tuple(record for log in logs for record in log.records)
    fits = _within(fits, resolved_band(records), Bands.of(options))
    with located(logs):
        responses = estimate_fits(records, fits, estimator_options(options))
    advance("frequency responses")
    work = [
        InferredWork(fit, structure, Estimated(logs, records, response, fit.band))
        for fit, structure, response in zip(fits, structures, responses)
    ]
    return replace(found, fits=fits), work


def _inferred(options: argparse.Namespace) -> "Inferred":
    """Return what the logs say, read as the options want. Raises HelisimError."""
    from helisim.look.systemid import infer

    if options.time is not None or options.rate is not None:
        raise InputError("--time and --rate are of logs without a clock; an autopilot's has one")
    channels, _ = given_columns(options)
    return infer(
        options.logs,
        channels=channels,
        resample_hz=options.resample,
        repair=[name for item in options.repair for name in names(item)],
        max_gap=options.max_gap,
        min_duration=options.min_duration,
        start=options.from_time,
        stop=options.to_time,
    )


def read_sweeps(
    options: argparse.Namespace,
    inputs: Sequence[str],
    outputs: Sequence[str],
    advance: Callable[[str], None],
) -> Read | None:
    """Return the sweeps of a model's inputs, where logs say them; None of any other logs.

    Args:
        options: of the command.
        inputs: of the model.
        outputs: of the model.
        advance: called with each file's name.

    Raises:
        HelisimError: the logs can't be used.
    """
    from helisim.look.sweeps import SID_AXES, own_sweeps

    wanted = {*inputs, *outputs}
    if wanted <= set(given_columns(options)[0].channels):
        return None
    if not all(path.is_file() and own_sweeps(path) for path in options.logs):
        return None
    found = _inferred(options)
    found.fit("the model", inputs, outputs)  # says what wasn't swept, or isn't there
    logs = tuple(
        log
        for log in found.read(wanted, on_progress=advance)
        if SID_AXES[log.records[0].provenance["sweep"]["axis"]].control in inputs
    )
    return Read(logs, tuple(record for log in logs for record in log.records))


def with_followed_bands(
    options: argparse.Namespace,
    found: "Inferred",
    work: list[InferredWork],
    searches: "Sequence[Mapping[str, Any]]",
    advance: Callable[[str], None],
) -> "tuple[Inferred, list[InferredWork]]":
    """Return work whose bands begin where its structures follow, unless --band says the band."""
    from helisim.look.systemid import followed_band

    if options.band:
        return found, work
    done = []
    for one, search in zip(work, searches):
        names = ("responses", "frequencies_per_response", "searches", "seed", "weighting")
        mine = {name: search[name] for name in names}
        band = followed_band(one.estimated.response, one.structure, one.fit.band, **mine)
        why = one.fit.why
        if band != one.fit.band:
            why += f"; below {band[0]:.3g} rad/s the structure doesn't follow"
        fit = replace(one.fit, band=band, why=why)
        done.append(one._replace(fit=fit, estimated=one.estimated._replace(band=band)))
        advance(one.fit.structure)
    return replace(found, fits=tuple(one.fit for one in done)), done


def print_inferred(found: "Inferred") -> None:
    """Print what logs say."""
    print(wrapped(str(found), indent=4))


def _fits(options: argparse.Namespace, found: "Inferred") -> "tuple[InferredFit, ...]":
    """Return the fits that the logs allow and the options want. Raises InputError."""
    signals = Signals.of(options)
    if options.structure is not None:
        one = find_structure(options.structure, signals.inputs, signals.outputs)
        inputs, outputs = signals.inputs or one.inputs, signals.outputs or one.outputs
        fits = (found.fit(options.structure, inputs, outputs),)
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
        named = [f"--{name}" for name in _OF_ONE if getattr(options, name)]
        named += ["--band of one response"] * bool(Bands.of(options).own)
        if named and len(fits) > 1:
            raise InputError(
                f"{', '.join(named)}: of one structure, and the sweeps allow {have}; choose one "
                "by --structure"
            )
    if options.conditioning is not None:
        fits = tuple(replace(fit, conditioning=signals.conditioning) for fit in fits)
    if options.reference is not None:
        fits = tuple(replace(fit, reference=signals.reference) for fit in fits)
    return fits


def _structure(fit: "InferredFit", adapted: "Callable[[Structure], Structure]") -> "Structure":
    return adapted(find_structure(fit.structure, fit.inputs, fit.outputs))


def _within(
    fits: "tuple[InferredFit, ...]", resolved: tuple[float, float], asked: Bands
) -> "tuple[InferredFit, ...]":
    """Return fits with the band that is asked for, or as far as the records resolve theirs."""
    found = []
    for fit in fits:
        low, high = max(fit.band[0], resolved[0]), fit.band[1]
        found.append(replace(fit, band=asked.around(asked.common or (low, high))))
    return tuple(found)
