"""New vehicle folders made from others, and calibrated parameters."""

import os
import re
import secrets
import shutil
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from helisim.base.errors import InputError, ModelError, StorageError
from helisim.base.files import make_folder, read_toml
from helisim.base.settings import Checked, setting
from helisim.base.units import RAD_S_PER_RPM, STANDARD_GRAVITY
from helisim.study.paper import published
from helisim.vehicle import calibrate, load, read_parameters, standard_parameters
from helisim.vehicle.build import Change, elements, write_changes, write_numbers
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
from helisim.vehicle.rate_command import STARTS, tune_rate_command
from helisim.vehicle.swashplate import INERTIA, REDUCTION, lock_number, stated, with_both

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,99}")
_WIDTH = 98
_TURN = 60.0 / 90.0  # of a servo's range of one unit, that its speed is told for

_TUNING = {
    "tuning.cyclic_bandwidth": 8.0,
    "tuning.yaw_bandwidth": 8.0,
    "tuning.peak_sensitivity": 1.6,
}


@dataclass(frozen=True, kw_only=True)
class Airframe(Checked):
    """What a pilot knows of a helicopter; None is estimated from another one, in proportion.

    Limits hold what flies, of 10 g to the Mi-26: lengths in millimetres are refused, times in
    milliseconds, and a mass in grams by the disc loading.

    Attributes:
        mass: as it flies, kg.
        rotor, tail_rotor: diameters, m.
        rpm: of the main rotor.
        blades: of the main rotor.
        chord, tail_chord: of the blades, m.
        tail_ratio: turns of the tail rotor for one of the main rotor.
        tail_arm: from the mast to the tail rotor's shaft, m.
        servo: of the swashplate, s for 60 degrees.
    """

    mass: float = setting(unit="kg", low=0.01, high=60000.0)
    rotor: float = setting(unit="m", low=0.1, high=40.0)
    rpm: float = setting(low=100.0, high=6000.0)
    blades: int | None = setting(None, low=2, high=8)
    chord: float | None = setting(None, unit="m", low=0.005, high=1.5)
    tail_rotor: float | None = setting(None, unit="m", low=0.02, high=10.0)
    tail_chord: float | None = setting(None, unit="m", low=0.003, high=0.8)
    tail_ratio: float | None = setting(None, low=1.0, high=12.0)
    tail_arm: float | None = setting(None, unit="m", low=0.05, high=25.0)
    servo: float | None = setting(None, unit="s", low=0.01, high=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if (loading := STANDARD_GRAVITY * self.mass / (0.25 * np.pi * self.rotor**2)) > 1000.0:
            raise InputError(
                f"{self.mass:g} kg on a rotor of {self.rotor:g} m is a disc loading of "
                f"{loading:.3g} N/m^2, and helicopters have at most 1000 (the CH-53E 720): the "
                "mass is in kg, the rotor a diameter in m"
            )

    def ratios(self, other: Mapping[str, float]) -> "Ratios":
        """Return its mass, size and rotor speed over another vehicle's."""
        return Ratios(
            self.mass / other["airframe.mass"],
            0.5 * self.rotor / other["main_rotor.radius"],
            self.rpm * RAD_S_PER_RPM / other["main_rotor.speed"],
        )

    def parameters(self) -> dict[str, float]:
        """Return the parameters that are known, by name, SI."""
        speed = self.rpm * RAD_S_PER_RPM
        known = {
            "airframe.mass": self.mass,
            "main_rotor.radius": 0.5 * self.rotor,
            "main_rotor.speed": speed,
            "main_rotor.blades": self.blades,
            "main_rotor.chord": self.chord,
            "tail_rotor.radius": self.tail_rotor and 0.5 * self.tail_rotor,
            "tail_rotor.chord": self.tail_chord,
            "tail_rotor.speed": self.tail_ratio and self.tail_ratio * speed,
            "tail_rotor.arm_x": self.tail_arm and -self.tail_arm,
            "servo.rate_limit": self.servo and _TURN / self.servo,
        }
        return {name: float(value) for name, value in known.items() if value}


class Ratios(NamedTuple):
    """A vehicle's mass, size and rotor speed over those of another one of its kind."""

    mass: float
    size: float
    speed: float

    def of(self, name: str, unit: str) -> float:
        """Return by what a parameter of that unit grows.

        The Lock number stays, so a blade's inertia grows with the fifth power of its length; the
        flapping frequency stays, and the hub's spring with it. Power is that of the hover, which
        grows with mass to 1.5 over the rotor's size; torque is power over speed.
        """
        mass, size, speed = _GROWTH.get(name) or _GROWTH.get(unit, (0.0, 0.0, 0.0))
        return self.mass**mass * self.size**size * self.speed**speed


_POWER = (1.5, -1.0, 0.0)
_BLADES, _SPEED = (0.0, 5.0, 0.0), (0.0, 0.0, 1.0)
_GROWTH = {
    "m": (0.0, 1.0, 0.0),
    "m^2": (0.0, 2.0, 0.0),
    "kg": (1.0, 0.0, 0.0),
    "kg m^2": (1.0, 2.0, 0.0),
    "main_rotor.blade_inertia": _BLADES,
    "drive.inertia": _BLADES,
    "N m/rad": (0.0, 5.0, 2.0),
    "drive.power_speed": _SPEED,
    "tail_rotor.speed": _SPEED,
    "rad/s/V": _SPEED,
    "N m": (1.5, -1.0, -1.0),
    "ohm": (-1.5, 1.0, 0.0),
    **dict.fromkeys(("W", "A", "C", "J/K", "W/K"), _POWER),
}  # Parameter, or the unit of all others -> its powers of mass, size and rotor speed


def new_vehicle(
    name: str,
    *,
    like: str | os.PathLike[str] = "jr700",
    to: str | os.PathLike[str] | None = None,
    airframe: Airframe | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> Path:
    """Make a vehicle's folder from another's, in folder `to` or the present one, and return it.

    With an airframe all that is not known of it is estimated from the other vehicle, and says so;
    its hover is solved, and its gyro tuned. Raises InputError for an unfit name, UnknownNameError,
    StorageError if the folder exists, or ModelError or TrimError if an airframe can't fly.
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
    temporary = folder.with_name(f".{name}.{secrets.token_hex(4)}.tmp")
    try:
        make_folder(temporary.parent)
        _write(source, temporary, name, _texts(source, name, airframe))
        if airframe is not None:
            _fit(temporary, name, airframe.ratios(standard_parameters(source)), on_progress)
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


def _fit(folder: Path, name: str, ratios: Ratios, on_progress: Callable[[str], None]) -> None:
    """Give a folder's MJCF and scene an airframe's size and mass; solve hover and gyro."""
    own = standard_parameters(folder)
    shutil.rmtree(folder / "rigs", ignore_errors=True)  # of another size
    for path in (folder / f"{name}.xml", *folder.glob("scene.xml")):
        write_changes([*_resized(path, ratios, own)])
    on_progress("hover")
    (folder / PARAMETER_FILES[1]).write_text(calibrated_text(folder), encoding="utf-8")
    on_progress("gyro")
    (folder / PARAMETER_FILES[2]).write_text(
        to_toml(tune_rate_command(load(folder, tuned=False)), _header("retuned")), encoding="utf-8"
    )
    write_numbers(folder)


def _resized(path: Path, ratios: Ratios, own: Mapping[str, float]) -> Iterator[Change]:
    units = {"mass": "kg", "fullinertia": "kg m^2", "diaginertia": "kg m^2"}
    lengths = dict.fromkeys(("pos", "size", "fromto", "center", "extent"), "m")
    for one in elements(path, path.read_bytes()):
        found = {key: (one.numbers(key), unit) for key, unit in (units | lengths).items()}
        new = {
            key: ratios.of("", unit) * np.array(value)
            for key, (value, unit) in found.items()
            if value
        }
        if one.tag == "mesh" and one.attribute("inertia"):
            new["scale"] = np.full(3, ratios.size)
        if one.tag == "site" and one.name == "tail_hub":
            new["pos"] = np.array([own["tail_rotor.arm_x"], 0.0, -own["tail_rotor.arm_z"]])
        yield Change.to(one, new)


def _texts(source: Path, name: str, airframe: Airframe | None) -> dict[str, str]:
    like, mjcf = source.name, mjcf_file(source)
    mjcf_name = f"{name}.xml" if mjcf.stem == like else mjcf.name
    own = standard_parameters(source)
    if airframe is not None:
        entries = _estimated(own, like, airframe).entries()
    else:
        entries = stated(own).entries()
        entries = {k: replace(one, source=f"{like}: {one.source}") for k, one in entries.items()}
    entries = {k: one for k, one in entries.items() if not k.startswith("targets.")}  # its own
    tuned = {key: entries.pop(key) for key in STARTS}
    unknown = HOVER if is_known(read_parameters(source / PARAMETER_FILES[0])) else UNKNOWNS
    solved = [*(f"flapping.{key.lower()}" for key in DIRECT), *unknown]
    calibrated = {key: entries.pop(key) for key in solved if key in entries}
    for key, value in _TUNING.items():
        known = term(key)
        if key not in entries and known is not None:
            entries[key] = PhysicalParameter(
                key, value, known.unit, "chosen: margins of 36 degrees"
            )
    parts, terms = [*sections(), *(key.split(".")[0] for key in entries)], [*glossary(), *entries]
    ranks = {key: (parts.index(key.split(".")[0]), terms.index(key)) for key in entries}
    given = {key: entries[key] for key in sorted(entries, key=ranks.__getitem__)}
    header = _header("parameters").format(name=name, like=like)
    return {
        "parameters.toml": to_toml(Parameters(given), header, comment=_comment),
        "calibrated.toml": to_toml(Parameters(calibrated), _header("calibrated").format(like=like)),
        "tuned.toml": to_toml(Parameters(tuned), _header("tuned").format(like=like)),
        "README.md": _header("readme").format(name=name, like=like, mjcf=mjcf_name),
    }


def _estimated(own: Parameters, like: str, airframe: Airframe) -> Parameters:
    """Return a vehicle's parameters with an airframe's mass, size and speed, and those known."""
    ratios, known = airframe.ratios(own), airframe.parameters()
    scaled = {name: ratios.of(name, own.entry(name).unit) * own[name] for name in own}
    quicker = known.get("servo.rate_limit", own["servo.rate_limit"]) / own["servo.rate_limit"]
    scaled["servo.swash_frequency"] *= quicker
    fixed = {name: value for name, value in scaled.items() if value != own[name]}
    new = own.replace(fixed | known).entries()  # at one flapping frequency its couplings stay
    for name, one in new.items():
        origin = "given" if name in known else f"estimated: as {like}"
        if name not in known and one.value != own[name]:
            origin = f"estimated: {own[name]:.4g} of {like}, in proportion"
        new[name] = replace(one, source=origin)
    names = {*stated(own), INERTIA} - {"flapping.tau_f"}  # which follows
    return Parameters({name: one for name, one in new.items() if name in names})


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


def calibrated_text(
    vehicle: str | os.PathLike[str],
    *,
    on_progress: Callable[[str], None] | None = None,
) -> str:
    """Return a vehicle's `calibrated.toml`, solved from its derivatives.

    If parameters.toml states all solved parameters, only the blades' pitch in hover is solved for;
    without any target the rest of `calibrated.toml` stays.
    Raises UnknownNameError, or ModelError where a derivative is missing or can't be met.
    """
    folder = model_folder(vehicle)
    files = [folder / file for file in PARAMETER_FILES]
    given = completed(read_parameters(*(files[k] for k in (0, 2) if files[k].is_file())))
    if is_known(given) and not stated_targets(given):
        return to_toml(settled(folder, given), _header("known"))
    if files[1].is_file() and not targets_of(folder, given):
        kept = read_parameters(files[1]).entries()
        kept = {name: one for name, one in kept.items() if name not in HOVER}
        hover = settled(folder, completed(Parameters(given.entries() | kept)))
        return to_toml(Parameters({**kept, **hover.entries()}), _header("kept"))
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
