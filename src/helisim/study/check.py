"""Check of a vehicle's folder: parameter files, hover, rigid body, gyro."""

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np

from helisim.base.errors import HelisimError, StorageError, TrimError, similar
from helisim.base.note import Command, Option
from helisim.study.new_vehicle import targets_of
from helisim.study.tune import LOOPS, Margins, margins
from helisim.vehicle import Vehicle, load
from helisim.vehicle.addresses import root_body
from helisim.vehicle.build import unwritten
from helisim.vehicle.parameters import (
    PARAMETER_FILES,
    PhysicalParameter,
    is_shipped,
    model_folder,
    read_entries,
    sections,
    term,
)
from helisim.vehicle.swashplate import lock_number

Files = Mapping[str, Path]  # by parameter

# _MISSED: relative; published ones have four digits
# _OFF_CENTRE: unitised, of a control in the hover
_MISSED, _OFF_CENTRE = 1e-3, 1e-3
_OFF_ORIGIN, _MISPLACED = 0.002, 0.005  # shares of the rotor's radius: centre of gravity, hub
_FASTEST_GROWTH = 0.2  # 1/s, that a pilot can still hold
_LEAST_GAIN, _LEAST_PHASE = 6.0, 30.0  # least margins, dB and degrees
_MADE_BY = {"calibrated.toml": "calibrate", "tuned.toml": "tune"}
_USUAL = {
    "disc_loading": (2.0, 1000.0, "airframe.mass, main_rotor.radius"),
    "tip_speed": (20.0, 300.0, "main_rotor.radius and speed (rad/s, not rpm)"),
    "solidity": (0.01, 0.25, "main_rotor.chord, blades and radius"),
    "blade_loading": (0.005, 0.16, "mass, main_rotor.speed and chord"),
    "lock_number": (0.3, 20.0, "flapping.tau_f or main_rotor.blade_inertia"),
    "figure_of_merit": (0.15, 0.9, "main_rotor.profile_drag and induced_factor"),
}  # figure -> lowest and highest usual value, SI, and where to look


@dataclass(frozen=True)
class Problem:
    """A problem, its file or None, and a command that mends it or None."""

    text: str
    file: Path | None = None
    remedy: Command | None = None

    def __str__(self) -> str:
        return self.text if self.file is None else f"{_below_here(self.file)}: {self.text}"


@dataclass(frozen=True, kw_only=True)
class VehicleCheck:
    """Findings of a vehicle's check.

    Figures of the hover, SI, and margins of the gyro's loops are empty where it doesn't fly.
    """

    name: str
    problems: tuple[Problem, ...]
    figures: Mapping[str, float] = field(default_factory=dict)
    margins: Mapping[str, Margins] = field(default_factory=dict)


def check_vehicle(vehicle: str | os.PathLike[str]) -> VehicleCheck:
    """Return the problems of a vehicle, by name or folder. Raises UnknownNameError."""
    folder = model_folder(vehicle)
    entries: dict[str, PhysicalParameter] = {}
    files: dict[str, Path] = {}  # by parameter
    problems = list(_unreadable(folder, entries, files))
    doubts = list(_doubtful(entries, files))
    figures, loops = {}, {}
    if not problems:
        try:
            flown = load(folder)
            figures = hover_figures(flown)
            loops = {axis: margins(flown, axis) for axis in LOOPS}
            problems += chain(  # each in turn, so that what was found stays if one raises
                (
                    Problem(
                        f"the {name.replace('_', ' ')} is {figures[name]:.4g}, which is "
                        f"implausible: it is usually {low:g} to {high:g}, SI; look at {look}"
                    )
                    for name, (low, high, look) in _USUAL.items()
                    if not low <= figures[name] <= high
                ),
                _misplaced(flown, files),
                _stale(flown, files),
                _unwritten(folder),
                _restless(flown, loops),
            )
        except TrimError as error:
            problems.append(
                Problem(
                    f"it does not hover: {error}; look at airframe.mass and at the rotors",
                    remedy=_solving("calibrate", folder),
                )
            )
        except HelisimError as error:
            problems.append(Problem(str(error)))
    return VehicleCheck(
        name=folder.name, problems=(*problems, *doubts), figures=figures, margins=loops
    )


def hover_figures(vehicle: Vehicle) -> dict[str, float]:
    """Return figures of a vehicle's hover by name, SI."""
    own, model = vehicle.parameters, vehicle.model
    radius, speed = own["main_rotor.radius"], own["main_rotor.speed"]
    mass = float(model.body_subtreemass[root_body(model)])
    weight = mass * float(np.linalg.norm(model.opt.gravity))
    disc, density = math.pi * radius**2, own["air.density"]
    solidity = own["main_rotor.blades"] * own["main_rotor.chord"] / (math.pi * radius)
    ideal = weight**1.5 / math.sqrt(2.0 * density * disc)
    pitch = own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * vehicle.trim.col
    return {
        "mass": mass,
        "disc_loading": weight / disc,
        "tip_speed": speed * radius,
        "solidity": solidity,
        "blade_loading": weight / (density * disc * (speed * radius) ** 2) / solidity,
        "lock_number": lock_number(own),
        "collective": pitch,
        "power": vehicle.power,
        "figure_of_merit": ideal / vehicle.main_power,
    }


def _below_here(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _solving(command: str, folder: Path) -> Command:
    where = folder.name if is_shipped(folder) else str(_below_here(folder))
    return Command(command, (where,), () if " " in command else (Option("write"),))


def _unreadable(
    folder: Path, entries: dict[str, PhysicalParameter], files: dict[str, Path]
) -> Iterator[Problem]:
    for path in (folder / name for name in PARAMETER_FILES):
        solver = _MADE_BY.get(path.name)
        if not path.is_file() and solver:
            yield Problem(
                f"there is no such file: {solver} the vehicle to make it",
                path,
                _solving(solver, folder),
            )
            continue
        try:
            for fault in read_entries(path, entries):
                yield Problem(fault, path)
        except StorageError as error:
            yield Problem(f"can't be read: {error}", path)
        files |= dict.fromkeys(entries.keys() - files.keys(), path)


def _doubtful(entries: Mapping[str, PhysicalParameter], files: Files) -> Iterator[Problem]:
    for name, entry in entries.items():
        known = term(name)
        if known is not None and not known.low <= entry.value <= known.high:
            yield Problem(
                f"{name} = {entry.value:g} {known.unit} is implausible: it is usually "
                f"{known.low:g} to {known.high:g}. {known.meaning} {known.origin}",
                files[name],
            )
    found = {name.split(".")[0]: path for name, path in files.items()}
    for section in (one for one in found if one not in sections()):
        meant = similar(section, sections())
        if meant:  # else it is its author's own
            yield Problem(
                f"there is no section [{section}]; did you mean [{meant[0]}]?", found[section]
            )


def _misplaced(vehicle: Vehicle, files: Files) -> Iterator[Problem]:
    model, own = vehicle.model, vehicle.parameters
    data, root, radius = mujoco.MjData(model), root_body(model), own["main_rotor.radius"]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    inside = data.xmat[root].reshape(3, 3).T
    x, y, z = offset = inside @ (data.subtree_com[root] - data.xpos[root])
    if np.linalg.norm(offset) > _OFF_ORIGIN * radius:
        yield Problem(
            f"the centre of gravity is {1e3 * x:.1f} mm ahead, {1e3 * y:.1f} mm left and "
            f"{1e3 * z:.1f} mm above the origin of the body {model.body(root).name!r}, about which "
            "the force laws act; move parts, or the fuselage's inertial pos"
        )
    for role, section, along, down in (
        ("hub", "main_rotor", "hub_x", "hub_z"),
        ("tail_hub", "tail_rotor", "arm_x", "arm_z"),
    ):
        site = data.site(role)
        x, _, up = inside @ (site.xpos - data.xpos[root])
        for key, drawn in ((f"{section}.{along}", x), (f"{section}.{down}", -up)):
            if abs(own[key] - drawn) > _MISPLACED * radius:
                yield Problem(
                    f"{key} is {own[key]:g} m, and the site {site.name!r} of the MJCF is at "
                    f"{drawn:.4g} m; make them one place",
                    files.get(key),
                )


def _stale(vehicle: Vehicle, files: Files) -> Iterator[Problem]:
    remedy = _solving("calibrate", vehicle.folder)
    for control, rotor in (("col", "main_rotor"), ("ped", "tail_rotor")):
        value = getattr(vehicle.trim, control)
        if abs(value) > _OFF_CENTRE:
            yield Problem(
                f"the hover needs {control} = {value:.4g}, which calibration centres",
                files.get(f"{rotor}.pitch_trim"),
                remedy,
            )
    for name, wanted in targets_of(vehicle.folder, vehicle.parameters).items():
        found = vehicle.derivatives[name]
        if not math.isclose(wanted, found, rel_tol=_MISSED):
            yield Problem(
                f"{name} is {found:.5g}, and [targets] wants {wanted:.5g}; calibrate anew",
                files.get(f"targets.{name}"),
                remedy,
            )


def _unwritten(folder: Path) -> Iterator[Problem]:
    for change in unwritten(folder):
        element, names = change.element, ", ".join(change.attributes)
        yield Problem(
            f"line {element.line}: the <{element.tag}> {element.name!r} has other numbers "
            f"({names}) than the parameters give, by which stock MuJoCo would fly it; write them "
            "anew",
            element.file,
            _solving("vehicle build", folder),
        )


def _restless(vehicle: Vehicle, loops: Mapping[str, Margins]) -> Iterator[Problem]:
    remedy, linear = _solving("tune", vehicle.folder), vehicle.linearize("IN2")
    file = vehicle.folder / "tuned.toml"
    growth = float(np.log(np.abs(np.linalg.eigvals(linear.a)).max()) / linear.period)
    if growth > _FASTEST_GROWTH:
        yield Problem(
            f"with its gyro a motion grows by {growth:.3g} 1/s in the hover; tune the gains",
            file,
            remedy,
        )
    for axis, left in loops.items():
        if left.gain_db < _LEAST_GAIN or left.phase_deg < _LEAST_PHASE:
            yield Problem(
                f"the {axis} loop has margins of {left.gain_db:.1f} dB and {left.phase_deg:.0f} "
                f"degrees, fewer than {_LEAST_GAIN:g} dB or {_LEAST_PHASE:g} degrees; tune it",
                file,
                remedy,
            )
