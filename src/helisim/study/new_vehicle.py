"""The files of a vehicle's folder: a new one like another, and what calibration solves for."""

import os
import re
import secrets
import shutil
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

from helisim.base.errors import InputError, ModelError, StorageError
from helisim.base.files import make_folder, read_toml
from helisim.base.settings import toml_text
from helisim.study.paper import published, published_of
from helisim.vehicle import (
    calibrate,
    read_parameters,
    standard_parameters,
)
from helisim.vehicle.assembly import mass_and_gravity
from helisim.vehicle.calibrate import (
    DIRECT,
    HOVER,
    SOLVED,
    UNKNOWNS,
    estimated_targets,
    is_known,
    lacking,
    settled,
    spared,
    stated_targets,
)
from helisim.vehicle.folder import (
    PARAMETER_FILES,
    ROLES,
    Roles,
    is_shipped,
    mjcf_file,
    model_folder,
    read_roles,
    vehicle_names,
)
from helisim.vehicle.parameters import (
    Parameters,
    PhysicalParameter,
    completed,
    glossary,
    sections,
    term,
    to_toml,
)
from helisim.vehicle.rate_command import STARTS
from helisim.vehicle.swashplate import INERTIA, REDUCTION, lock_number, stated, with_both

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_WIDTH = 98

_LONGEST = 100
_TUNING = {
    "tuning.cyclic_bandwidth": 8.0,
    "tuning.yaw_bandwidth": 8.0,
    "tuning.peak_sensitivity": 1.6,
}
"""What a gyro is tuned to where the vehicle that is copied doesn't say."""


def new_vehicle(
    name: str,
    *,
    like: str | os.PathLike[str] = "jr700",
    to: str | os.PathLike[str] | None = None,
) -> Path:
    """Make a vehicle's folder from another's and return it; it flies, calibrates and tunes.

    Args:
        name: of the vehicle, its folder and its MJCF.
        like: name or path of the vehicle that it is made from.
        to: folder in which the new one is made; the present one if None.

    Raises:
        InputError: a name that a vehicle can't have.
        UnknownNameError: no such vehicle to make it from.
        StorageError: there is something of that name, or it can't be written; nothing is left.
    """
    if not _NAME.fullmatch(name):
        around = "; the folder around it is `to`" if os.path.basename(name) != name else ""
        raise InputError(
            "a vehicle's name has letters, digits, _ and -, and begins with a letter, got "
            f"{name!r}{around}",
            remedy="to" if around else (),
        )
    if len(name) > _LONGEST:
        raise InputError(
            f"a vehicle's name has at most {_LONGEST} characters, as files of it have longer ones; "
            f"got one of {len(name)}"
        )
    if name in vehicle_names():
        raise InputError(f"{name!r} is a shipped vehicle: take another name")
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


def _text(name: str) -> str:
    return _texts_of_files()[name]


@cache
def _texts_of_files() -> dict[str, str]:
    return read_toml(Path(__file__).with_name("vehicle_texts.toml"))


def _write(source: Path, folder: Path, name: str, texts: dict[str, str]) -> None:
    """Write the texts and what else belongs to a vehicle into a folder that isn't there yet."""
    folder.mkdir()
    mjcf = mjcf_file(source, read_roles(source)).name
    renamed = {mjcf: _mjcf_name(source, name)}
    word = re.compile(rf"\b{re.escape(source.name)}\b")
    for path in (*source.glob("*.xml"), *source.glob("rigs/*.xml")):
        target = folder / path.relative_to(source).with_name(renamed.get(path.name, path.name))
        target.parent.mkdir(exist_ok=True)
        target.write_text(word.sub(name, path.read_text(encoding="utf-8")), encoding="utf-8")
    if (source / "assets").is_dir():
        shutil.copytree(source / "assets", folder / "assets")
    if (source / "LICENSE").is_file():
        shutil.copy(source / "LICENSE", folder)
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")


def _mjcf_name(source: Path, name: str) -> str:
    """Return what the new vehicle's MJCF is called: after it, where the other's is after that."""
    mjcf = mjcf_file(source, read_roles(source))
    return f"{name}.xml" if mjcf.stem == source.name else mjcf.name


def _texts(source: Path, name: str) -> dict[str, str]:
    """Return the parameter files and the README of a vehicle made from another, by file."""
    like, mjcf = source.name, _mjcf_name(source, name)
    own = stated(standard_parameters(source))
    entries = {
        key: replace(own.entry(key), source=f"{like}: {own.entry(key).source}") for key in own
    }
    tuned = {key: entries.pop(key) for key in STARTS}
    unknown = HOVER if is_known(read_parameters(source / PARAMETER_FILES[0])) else UNKNOWNS
    solved = [*(f"flapping.{key.lower()}" for key in DIRECT), *unknown]
    calibrated = {key: entries.pop(key) for key in solved if key in entries}
    for key, value in {**_targets(source, own), **_TUNING}.items():
        known = term(key)
        if key not in entries and known is not None:
            entries[key] = PhysicalParameter(key, value, known.unit, _origin(key, like))
    given = {key: entries[key] for key in sorted(entries, key=_rank)}
    header = _text("parameters").format(name=name, like=like)
    text = to_toml(Parameters(given), header, comment=_Comments())
    return {
        "parameters.toml": text + _roles_text(read_roles(source), mjcf),
        "calibrated.toml": to_toml(Parameters(calibrated), _text("calibrated").format(like=like)),
        "tuned.toml": to_toml(Parameters(tuned), _text("tuned").format(like=like)),
        "README.md": _text("readme").format(name=name, like=like, mjcf=mjcf),
    }


def _origin(key: str, like: str) -> str:
    return f"{like}: published" if key.startswith("targets.") else "chosen: margins of 36 degrees"


def _targets(source: Path, own: Parameters) -> dict[str, float]:
    """Return what the vehicle that is copied was calibrated to, by parameter."""
    if not is_shipped(source):
        return {key: own[key] for key in own if key.startswith("targets.")}
    known = published_of(source, instead="").targets
    return {f"targets.{key}": known[key] for key in (*DIRECT, *SOLVED) if key in known}


class _Comments:
    """Comments on parameters, each given once in a row."""

    def __init__(self) -> None:
        self._last: tuple[str, str] | None = None

    def __call__(self, name: str) -> list[str]:
        """Return the lines above a parameter: what it is and does, where to get it."""
        known = term(name)
        if known is None:
            return []
        said, self._last = self._last, (known.meaning, known.origin)
        if said == self._last:
            return ["As the one above."]
        unit = "" if known.unit == "1" else f" {known.unit}"
        origin = f"From: {known.origin} Plausible: {known.low:g} to {known.high:g}{unit}."
        return [
            *textwrap.wrap(known.meaning, _WIDTH),
            *textwrap.wrap(origin, _WIDTH, subsequent_indent="  "),
        ]


def _rank(name: str) -> tuple[int, int]:
    """Return where a parameter stands in a file: by section and glossary, one's own last."""
    section, terms = name.split(".")[0], list(glossary())
    known = sections()
    return (
        known.index(section) if section in known else len(known),
        terms.index(name) if name in terms else len(terms),
    )


def _roles_text(roles: Roles, mjcf: str) -> str:
    """Return `[roles]` as text: of the vehicle that is copied, or the usual ones as remarks."""
    lines = ["", *(f"# {line}" for line in _text("roles").splitlines())]
    if roles == Roles():
        lines += ["# [roles]", f'# mjcf = "{mjcf}"', '# scene = "scene.xml"']
        for kind, known in ROLES.items():
            lines.append(f"# [roles.{kind}]")
            lines += [f'# {role} = "{role}"' for role in known]
        return "\n".join(lines) + "\n"
    table = {"mjcf": roles.mjcf, "scene": roles.scene, **roles.names}
    return "\n".join(lines) + "\n" + toml_text({"roles": table})


def calibrated_text(
    vehicle: str | os.PathLike[str],
    *,
    from_geometry: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> str:
    """Return a vehicle's `calibrated.toml`, solved from its derivatives.

    Where parameters.toml says itself what would be solved for, the blade's inertia too, nothing
    but the pitch of the blades in hover is, and no derivative is needed.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        from_geometry: True estimates the derivatives that it doesn't state, in closed form.
        on_progress: called with the vehicle's name after each trial.

    Raises:
        UnknownNameError: no such vehicle.
        ModelError: a derivative is missing or malformed, or they can't be met.
    """
    folder = model_folder(vehicle)
    files = (folder / "parameters.toml", folder / "tuned.toml")
    given = completed(read_parameters(*(path for path in files if path.is_file())))
    if is_known(given) and not stated_targets(given):
        return to_toml(settled(folder, given), _text("known"))
    if is_shipped(folder) and not from_geometry:
        known = published(folder.name)
        targets, source, whose = known.targets, known.source, "published"
    else:
        whose = "estimated" if from_geometry else "stated"
        try:
            targets, source = _own(folder, given, from_geometry=from_geometry)
        except ModelError as error:
            raise ModelError(f"{files[0]}: {error}", remedy=error.remedy) from None
    solved = calibrate(folder, given, targets, source, on_progress=on_progress)
    both = {name: one.entry(name) for one in (given, solved) for name in one}
    whole = with_both(Parameters(both))
    inertia, radius, lock = whole[INERTIA], whole["main_rotor.radius"], lock_number(whole)
    header = _text("solved").format(
        derivatives=whose,
        lock=lock,
        felt=lock / whole[REDUCTION],
        inertia=inertia,
        mass=3.0 * inertia / radius**2,
        radius=radius,
    )
    return to_toml(solved, header)


def _own(
    folder: Path, given: Parameters, *, from_geometry: bool
) -> tuple[Mapping[str, float], str]:
    """Return a vehicle's own targets, those that it states before those that are estimated."""
    stated = stated_targets(given)
    if not from_geometry:
        missing = lacking(stated, given)
        if missing:
            raise ModelError(
                f"section [targets] lacks {', '.join(missing)}; each is "
                '{ value = NUMBER, unit = "UNIT", source = "WHERE FROM" }; what is missing can be '
                "estimated from the geometry",
                remedy="from_geometry",
            )
        return dict(stated), "[targets] of parameters.toml"
    estimated = dict(estimated_targets(given, *mass_and_gravity(folder)))
    for name in spared(given):
        del estimated[name]
    return {**estimated, **stated}, "[targets] and closed forms of the geometry"
