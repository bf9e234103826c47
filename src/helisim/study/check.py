"""Check a vehicle's folder: files, names, rigid body, hover, gyro; every problem at once."""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from helisim.base.errors import HelisimError, ModelError, TrimError
from helisim.study.check_files import (
    ParameterFiles,
    Problem,
    at_a_glance,
    body_problems,
    element_problems,
    implausible,
    solving,
)
from helisim.study.paper import published
from helisim.study.tune import LOOPS, Margins, margins
from helisim.vehicle import Vehicle, load
from helisim.vehicle.build import unwritten
from helisim.vehicle.calibrate import DIRECT, SOLVED
from helisim.vehicle.folder import is_shipped, mjcf_file, model_folder
from helisim.vehicle.trim import root_body

_MISSED = 1e-3
"""Of a target: published ones have four digits, and calibration leaves 1e-8."""
_OFF_CENTRE = 1e-3
"""Of a control in the hover, unitised; calibration leaves 1e-8."""
_FASTEST_GROWTH = 0.2
"""1/s, of what the gyro leaves to the pilot, who has a second or two."""
_LEAST_GAIN, _LEAST_PHASE = 6.0, 30.0
"""dB and degrees: below them a loop rings with the next delay that is found."""


@dataclass(frozen=True, kw_only=True)
class Figures:
    """What a vehicle is in the hover.

    Attributes:
        mass: kg.
        disc_loading: N/m^2.
        tip_speed: m/s, of the main blades.
        solidity: of the main rotor.
        blade_loading: thrust coefficient over solidity.
        lock_number: density x lift slope x chord x radius^4 over a blade's flapping inertia.
        collective: pitch of the main blades, rad.
        power: W, of the main rotor's shaft.
        figure_of_merit: ideal over real power.
        poles: rad/s, of the base helicopter's modes that are not at zero and slower than its
            servos, slowest first; one of each pair.
    """

    mass: float
    disc_loading: float
    tip_speed: float
    solidity: float
    blade_loading: float
    lock_number: float
    collective: float
    power: float
    figure_of_merit: float
    poles: tuple[complex, ...]

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Figures":
        """Return those of a vehicle in its hover."""
        own, model = vehicle.parameters, vehicle.model
        mass = float(model.body_subtreemass[root_body(model)])
        weight = mass * float(np.linalg.norm(model.opt.gravity))
        disc = math.pi * own["main_rotor.radius"] ** 2
        pitch = own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * vehicle.trim.col
        ideal = weight**1.5 / math.sqrt(2.0 * own["air.density"] * disc)
        return cls(
            mass=mass,
            **at_a_glance(own, weight),
            collective=pitch,
            power=vehicle.power,
            figure_of_merit=ideal / vehicle.main_power,
            poles=_poles(vehicle),
        )


@dataclass(frozen=True, kw_only=True)
class VehicleCheck:
    """What is found of a vehicle.

    Attributes:
        name: of the vehicle.
        problems: what is wrong, with its place and the remedy.
        remarks: what is not wrong, but may not be meant.
        figures: of the hover; None where it doesn't hover.
        margins: of the gyro's loops by axis, empty where it doesn't fly.
    """

    name: str
    problems: tuple[Problem, ...]
    remarks: tuple[Problem, ...]
    figures: Figures | None
    margins: Mapping[str, Margins]


def check_vehicle(vehicle: str | os.PathLike[str]) -> VehicleCheck:
    """Check a vehicle's folder and return everything that is wrong with it.

    What can't be looked at because of something else is not looked at: an MJCF that MuJoCo
    refuses has no hover.

    Args:
        vehicle: name of a shipped one, or path of a folder.

    Raises:
        UnknownNameError: it is no vehicle at all.
    """
    folder = model_folder(vehicle)
    files = ParameterFiles(folder)
    problems = files.problems.copy()
    flown: Vehicle | None = None
    mjcf: Path | None = None
    try:
        mjcf = mjcf_file(folder, files.roles)
    except ModelError as error:
        problems.append(Problem.of(str(error)))
    if mjcf is not None:
        found = element_problems(mjcf, files.roles)
        if not found and files.whole:
            found = body_problems(mjcf, files)
        problems += found
        if files.whole and all(one.flies for one in found):
            flown = _flown(folder, mjcf, problems)
    figures, loops = None, {}
    if flown is not None and mjcf is not None:
        figures = Figures.of(flown)
        problems += implausible({"figure_of_merit": figures.figure_of_merit})
        problems += _stale(flown, files)
        problems += _unwritten(flown, mjcf)
        loops = {axis: margins(flown, axis) for axis in LOOPS}
        problems += _restless(flown, loops, folder)
    return VehicleCheck(
        name=folder.name,
        problems=tuple(sorted(problems, key=_order(problems))),
        remarks=tuple(files.remarks),
        figures=figures,
        margins=loops,
    )


def _order(problems: Sequence[Problem]) -> Callable[[Problem], tuple[int, int]]:
    """Return the key that sorts problems by file, in the order of their finding, and line."""
    files = list(dict.fromkeys(problem.file for problem in problems))
    return lambda problem: (files.index(problem.file), problem.line or 0)


def _flown(folder: Path, mjcf: Path, problems: list[Problem]) -> Vehicle | None:
    """Return the vehicle in its hover, or None and a problem."""
    try:
        return load(folder)
    except TrimError as error:
        text = (
            f"it does not hover: {error}; look at the mass in the MJCF, the rotors' radius and "
            "speed, and calibrate the rest"
        )
        problems.append(Problem(text, mjcf, remedy=solving("calibrate", folder)))
    except HelisimError as error:
        problems.append(Problem.of(str(error), mjcf))
    return None


def _place(vehicle: Vehicle) -> Path:
    """Return a vehicle's folder as a command takes it: of a shipped one its name."""
    return Path(vehicle.name) if is_shipped(vehicle.folder) else vehicle.folder


def _stale(vehicle: Vehicle, files: ParameterFiles) -> Iterator[Problem]:
    """Yield what calibration is to have made true and isn't."""
    remedy = solving("calibrate", _place(vehicle))
    for control in ("col", "ped"):
        value = getattr(vehicle.trim, control)
        if abs(value) > _OFF_CENTRE:
            rotor = "main_rotor" if control == "col" else "tail_rotor"
            text = f"the hover needs {control} = {value:.4g}, which calibration centres"
            yield Problem(
                text,
                *files.place(f"{rotor}.pitch_trim"),
                remedy=remedy,
            )
    targets = {key: one.value for key, one in files.entries.items() if key.startswith("targets.")}
    if not targets and is_shipped(vehicle.folder):
        known = published(vehicle.name).targets
        targets = {f"targets.{key}": known[key] for key in (*DIRECT, *SOLVED) if key in known}
    for name in (*DIRECT, *SOLVED):
        wanted, found = targets.get(f"targets.{name}"), vehicle.derivatives[name]
        if wanted is not None and not math.isclose(wanted, found, rel_tol=_MISSED):
            text = (
                f"{name} is {found:.5g} with calibrated.toml, and [targets] wants {wanted:.5g}; "
                "calibrate anew"
            )
            yield Problem(text, *files.place(f"targets.{name}"), remedy=remedy)


def _unwritten(vehicle: Vehicle, mjcf: Path) -> Iterator[Problem]:
    """Yield what the MJCF has of other parameters, by which stock MuJoCo would fly it."""
    remedy = solving("vehicle build", _place(vehicle))
    try:
        for change in unwritten(vehicle.folder):
            element, names = change.element, ", ".join(change.numbers)
            named = f" {element.name!r}" if element.name else ""
            text = (
                f"the <{element.tag}>{named} has other numbers ({names}) than the parameters give, "
                f"by which stock MuJoCo would fly it; write them anew"
            )
            yield replace(Problem.at(text, element), remedy=remedy)
    except HelisimError as error:
        yield Problem.of(str(error), mjcf)


def _restless(vehicle: Vehicle, loops: Mapping[str, Margins], folder: Path) -> Iterator[Problem]:
    """Yield a gyro that doesn't hold its vehicle, or only just."""
    remedy, linear = solving("tune", _place(vehicle)), vehicle.linearize("IN2")
    poles = np.abs(np.linalg.eigvals(linear.a))
    growth = float(np.log(poles.max()) / linear.period)
    if growth > _FASTEST_GROWTH:
        text = f"with its gyro a motion grows by {growth:.3g} 1/s in the hover; tune the gains"
        yield Problem(text, folder / "tuned.toml", remedy=remedy)
        return
    for axis, left in loops.items():
        if left.gain_db < _LEAST_GAIN or left.phase_deg < _LEAST_PHASE:
            text = (
                f"the {axis} loop has margins of {left.gain_db:.1f} dB and {left.phase_deg:.0f} "
                f"degrees, fewer than {_LEAST_GAIN:g} dB or {_LEAST_PHASE:g} degrees; tune it"
            )
            yield Problem(text, folder / "tuned.toml", remedy=remedy)


def _poles(vehicle: Vehicle) -> tuple[complex, ...]:
    poles = np.linalg.eigvals(vehicle.linearize("IN1").a)
    slowest_servo = min(
        vehicle.parameters["servo.swash_frequency"], vehicle.parameters["servo.tail_frequency"]
    )
    size = np.abs(poles)
    kept = poles[(size > 1e-3) & (size < 0.9 * slowest_servo) & (poles.imag >= 0.0)]
    return tuple(complex(pole) for pole in kept[np.argsort(np.abs(kept))])
