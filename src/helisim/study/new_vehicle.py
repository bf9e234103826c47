"""New vehicle folders made from others, and calibrated parameters."""

import os
import re
import secrets
import shutil
import textwrap
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

from helisim.base.errors import InputError, ModelError, StorageError
from helisim.base.files import make_folder, read_toml
from helisim.study.paper import published
from helisim.vehicle import (
    calibrate,
    read_parameters,
    standard_parameters,
)
from helisim.vehicle.calibrate import (
    DIRECT,
    HOVER,
    SOLVED,
    UNKNOWNS,
    is_known,
    lacking,
    settled,
    stated_targets,
)
from helisim.vehicle.parameters import (
    PARAMETER_FILES,
    Parameters,
    PhysicalParameter,
    completed,
    glossary,
    is_shipped,
    mjcf_file,
    model_folder,
    sections,
    term,
    to_toml,
    vehicle_names,
)
from helisim.vehicle.rate_command import STARTS
from helisim.vehicle.swashplate import INERTIA, REDUCTION, lock_number, stated, with_both

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,99}")
_WIDTH = 98

_TUNING = {
    "tuning.cyclic_bandwidth": 8.0,
    "tuning.yaw_bandwidth": 8.0,
    "tuning.peak_sensitivity": 1.6,
}


def new_vehicle(
    name: str,
    *,
    like: str | os.PathLike[str] = "jr700",
    to: str | os.PathLike[str] | None = None,
) -> Path:
    """Make a vehicle's folder from another's, in folder `to` or the present one, and return it.

    Raises InputError for an unfit name, UnknownNameError, or StorageError if the folder exists.
    """
    if not _NAME.fullmatch(name) or name in vehicle_names():
        raise InputError(
            "a vehicle's name has at most 100 letters, digits, _ and -, begins with a letter, and "
            f"is no shipped one's, got {name!r:.120}; `to` takes the folder around it",
            remedy="to" if os.path.basename(name) != name else (),
        )
    source = model_folder(like)
    folder = Path(to or "").resolve() / name
    if folder.exists():
        raise StorageError(f"{folder} is there already, and is not overwritten: take another name")
    texts = _texts(source, name)
    temporary = folder.with_name(f".{name}.{secrets.token_hex(4)}.tmp")
    try:
        make_folder(temporary.parent)
        _write(source, temporary, name, texts)
        os.rename(temporary, folder)
    except OSError as error:
        raise StorageError(f"can't make {folder}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return folder


@cache
def _header(name: str) -> str:
    return read_toml(Path(__file__).with_name("vehicle_texts.toml"))[name]


def _write(source: Path, folder: Path, name: str, texts: dict[str, str]) -> None:
    folder.mkdir()
    word = re.compile(rf"\b{re.escape(source.name)}\b")
    for path in (*source.glob("*.xml"), *source.glob("rigs/*.xml")):
        named = name + path.suffix if path.stem == source.name else path.name
        target = folder / path.relative_to(source).with_name(named)
        target.parent.mkdir(exist_ok=True)
        target.write_text(word.sub(name, path.read_text(encoding="utf-8")), encoding="utf-8")
    if (source / "assets").is_dir():
        shutil.copytree(source / "assets", folder / "assets")
    if (source / "LICENSE").is_file():
        shutil.copy(source / "LICENSE", folder)
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")


def _texts(source: Path, name: str) -> dict[str, str]:
    like, mjcf = source.name, mjcf_file(source)
    mjcf_name = f"{name}.xml" if mjcf.stem == like else mjcf.name
    own = stated(standard_parameters(source))
    entries = {
        key: replace(own.entry(key), source=f"{like}: {own.entry(key).source}") for key in own
    }
    tuned = {key: entries.pop(key) for key in STARTS}
    unknown = HOVER if is_known(read_parameters(source / PARAMETER_FILES[0])) else UNKNOWNS
    solved = [*(f"flapping.{key.lower()}" for key in DIRECT), *unknown]
    calibrated = {key: entries.pop(key) for key in solved if key in entries}
    targets = {f"targets.{key}": value for key, value in targets_of(source, own).items()}
    for key, value in {**targets, **_TUNING}.items():
        known = term(key)
        if key not in entries and known is not None:
            entries[key] = PhysicalParameter(key, value, known.unit, _origin(key, like))
    given = {key: entries[key] for key in sorted(entries, key=_rank)}
    header = _header("parameters").format(name=name, like=like)
    return {
        "parameters.toml": to_toml(Parameters(given), header, comment=_comment),
        "calibrated.toml": to_toml(Parameters(calibrated), _header("calibrated").format(like=like)),
        "tuned.toml": to_toml(Parameters(tuned), _header("tuned").format(like=like)),
        "README.md": _header("readme").format(name=name, like=like, mjcf=mjcf_name),
    }


def _origin(key: str, like: str) -> str:
    return f"{like}: published" if key.startswith("targets.") else "chosen: margins of 36 degrees"


def targets_of(folder: Path, given: Parameters) -> dict[str, float]:
    """Return the derivatives to calibrate to, published or of [targets], SI. Raises ModelError."""
    known = published(folder.name).targets if is_shipped(folder) else stated_targets(given)
    return {key: known[key] for key in (*DIRECT, *SOLVED) if key in known}


def _comment(name: str) -> list[str]:
    known = term(name)
    if known is None:
        return []
    origin = f"From: {known.origin} Plausible: {known.low:g} to {known.high:g} {known.unit}."
    return [
        *textwrap.wrap(known.meaning, _WIDTH),
        *textwrap.wrap(origin, _WIDTH, subsequent_indent="  "),
    ]


def _rank(name: str) -> tuple[int, int]:
    known, terms = [*sections(), name.split(".")[0]], [*glossary(), name]
    return known.index(name.split(".")[0]), terms.index(name)


def calibrated_text(
    vehicle: str | os.PathLike[str],
    *,
    on_progress: Callable[[str], None] | None = None,
) -> str:
    """Return a vehicle's `calibrated.toml`, solved from its derivatives.

    If parameters.toml states all solved parameters, only the blades' pitch in hover is solved for.
    Raises UnknownNameError, or ModelError where a derivative is missing or can't be met.
    """
    folder = model_folder(vehicle)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = completed(read_parameters(*(path for path in files if path.is_file())))
    if is_known(given) and not stated_targets(given):
        return to_toml(settled(folder, given), _header("known"))
    shipped, targets = is_shipped(folder), targets_of(folder, given)
    source = published(folder.name).source if shipped else "[targets] of parameters.toml"
    if missing := lacking(targets, given):
        raise ModelError(
            f"{files[0]}: section [targets] lacks {', '.join(missing)}; each is "
            '{ value = NUMBER, unit = "UNIT", source = "WHERE FROM" }'
        )
    solved = calibrate(folder, given, targets, source, on_progress=on_progress)
    both = {name: one.entry(name) for one in (given, solved) for name in one}
    whole = with_both(Parameters(both))
    inertia, radius, lock = whole[INERTIA], whole["main_rotor.radius"], lock_number(whole)
    header = _header("solved").format(
        derivatives="published" if shipped else "stated",
        lock=lock,
        felt=lock / whole[REDUCTION],
        inertia=inertia,
        mass=3.0 * inertia / radius**2,
        radius=radius,
    )
    return to_toml(solved, header)
