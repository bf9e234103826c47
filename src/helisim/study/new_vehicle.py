"""Make a vehicle of one's own from another: a folder that flies at once, to be changed in place."""

import os
import re
import secrets
import shutil
import textwrap
from dataclasses import replace
from pathlib import Path

from helisim.base.errors import InputError, StorageError
from helisim.base.files import make_folder, toml_key, toml_value
from helisim.study.paper import published_of
from helisim.vehicle import (
    Parameters,
    PhysicalParameter,
    read_parameters,
    standard_parameters,
)
from helisim.vehicle.blade import stated
from helisim.vehicle.calibrate import DIRECT, HOVER, SOLVED, UNKNOWNS, is_known
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
from helisim.vehicle.parameters import glossary, sections, term, to_toml
from helisim.vehicle.rate_command import STARTS

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
            f"{name!r}{around}"
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
    header = _PARAMETERS.format(name=name, like=like)
    text = to_toml(Parameters(given), header, comment=_Comments())
    return {
        "parameters.toml": text + _roles_text(read_roles(source), mjcf),
        "calibrated.toml": to_toml(Parameters(calibrated), _CALIBRATED.format(like=like)),
        "tuned.toml": to_toml(Parameters(tuned), _TUNED.format(like=like)),
        "README.md": _README.format(name=name, like=like, mjcf=mjcf),
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
    lines = ["", *(f"# {line}" for line in _ROLES.splitlines())]
    if roles == Roles():
        lines += ["# [roles]", f'# mjcf = "{mjcf}"', '# scene = "scene.xml"']
        for kind, known in ROLES.items():
            lines.append(f"# [roles.{kind}]")
            lines += [f'# {role} = "{role}"' for role in known]
        return "\n".join(lines) + "\n"
    lines.append("[roles]")
    for key in ("mjcf", "scene"):
        if getattr(roles, key) is not None:
            lines.append(f"{key} = {toml_value(getattr(roles, key))}")
    for kind, names in roles.names.items():
        lines.append(f"[roles.{kind}]")
        lines += [f"{toml_key(role)} = {toml_value(one)}" for role, one in names.items()]
    return "\n".join(lines) + "\n"


_PARAMETERS = """\
{name}: what is measured and chosen. It begins as {like}: change what is yours, line by line,
and say in `source` where each value is from. Units are SI: a wrong one is refused, with what to
write.
What follows by solving stands in calibrated.toml and tuned.toml; README.md has the next steps.

Inputs are unitised: sticks and servo commands go from -0.5 to 0.5, and "rad" of blade pitch is
radian for one unit. "1" is a pure number."""

_CALIBRATED = """\
Made with the vehicle from {like}; `helisim calibrate --write` solves it anew from [targets]."""

_TUNED = """\
Made with the vehicle from {like}; `helisim tune --write` solves it anew from [tuning]."""

_ROLES = """\
Names in the MJCF are yours: say here which of them is what. A role that is left out has the name
on its left. The kinds are body, site, geom, actuator, sensor and keyframe."""

_README = """\
# {name}

A helicopter for helisim, made from {like}. It flies at once, and is yours to change:

1. `parameters.toml`: geometry, rotors, servos, gyro, each line with what it is and where to get it.
   Units are SI; a wrong one is refused.
2. `{mjcf}`: the rigid body for MuJoCo: mass and place of each part, the IMU, what is drawn. The
   fuselage is given what the other parts lack of the moments of inertia in the parameters.
3. Look at what is wrong, every problem at once, each with its line:

       helisim vehicle check {name}

4. Solve for what the derivatives in `[targets]` fix, then for the gains that `[tuning]` asks for:

       helisim calibrate {name} --write
       helisim tune {name} --write

   Both write the numbers into the MJCF too, so that it flies in stock MuJoCo.

5. After any other change of the parameters, write them into the MJCF:

       helisim vehicle build {name}

6. Fly it:

       helisim linearize {name}
       helisim trim {name} --speeds 0:20:2
       helisim fly {name} --axis lat --out lat.parquet
       helisim recover {name}
       helisim view {name}

In Python: `helisim.load("path/to/{name}")`.

| file | what |
|---|---|
| `parameters.toml` | measured and chosen |
| `calibrated.toml` | solved by `helisim calibrate` |
| `tuned.toml` | solved by `helisim tune` |
| `{mjcf}` | MJCF of the vehicle alone |
| `scene.xml`, `scenery.xml` | the vehicle over its pad, to look at |
| `assets/` | drawn shapes |
| `rigs/` | benches that hold it on the ground, where {like} has them |
"""
