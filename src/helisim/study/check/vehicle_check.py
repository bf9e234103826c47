"""Check a vehicle's folder: files, names, rigid body, hover, gyro; every problem at once."""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from helisim.base.errors import HelisimError, ModelError, TrimError
from helisim.study.check.elements import element_problems
from helisim.study.check.figures import Figures, implausible
from helisim.study.check.parameter_files import ParameterFiles
from helisim.study.check.problem import Problem, command, sentence
from helisim.study.check.rigid_body import body_problems
from helisim.study.paper import published
from helisim.study.tune import LOOPS, Margins, margins
from helisim.vehicle import Vehicle, load
from helisim.vehicle.build import unwritten
from helisim.vehicle.calibrate import DIRECT, SOLVED
from helisim.vehicle.folder import is_shipped, mjcf_file, model_folder

_MISSED = 1e-3
"""Of a target: published ones have four digits, and calibration leaves 1e-8."""
_OFF_CENTRE = 1e-3
"""Of a control in the hover, unitised; calibration leaves 1e-8."""
_FASTEST_GROWTH = 0.2
"""1/s, of what the gyro leaves to the pilot, who has a second or two."""
_LEAST_GAIN, _LEAST_PHASE = 6.0, 30.0
"""dB and degrees: below them a loop rings with the next delay that is found."""


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
            f"speed, and solve for the rest with {command('calibrate', folder, '--write')}"
        )
        problems.append(Problem(sentence(text), mjcf))
    except HelisimError as error:
        problems.append(Problem.of(str(error), mjcf))
    return None


def _folder(vehicle: Vehicle) -> Path:
    """Return a vehicle's folder as a command takes it: of a shipped one its name."""
    return Path(vehicle.name) if is_shipped(vehicle.folder) else vehicle.folder


def _stale(vehicle: Vehicle, files: ParameterFiles) -> Iterator[Problem]:
    """Yield what calibration is to have made true and isn't."""
    remedy = f"{command('calibrate', _folder(vehicle), '--write')} solves for it anew"
    for control in ("col", "ped"):
        value = getattr(vehicle.trim, control)
        if abs(value) > _OFF_CENTRE:
            rotor = "main_rotor" if control == "col" else "tail_rotor"
            text = (
                f"the hover needs {control} = {value:.4g}, where calibration centres it; {remedy}"
            )
            yield Problem(sentence(text), *files.place(f"{rotor}.pitch_trim"))
    targets = {key: one.value for key, one in files.entries.items() if key.startswith("targets.")}
    if not targets and is_shipped(vehicle.folder):
        known = published(vehicle.name).targets
        targets = {f"targets.{key}": known[key] for key in (*DIRECT, *SOLVED) if key in known}
    for name in (*DIRECT, *SOLVED):
        wanted, found = targets.get(f"targets.{name}"), vehicle.derivatives[name]
        if wanted is not None and not math.isclose(wanted, found, rel_tol=_MISSED):
            text = (
                f"{name} is {found:.5g} with calibrated.toml, and [targets] wants {wanted:.5g}; "
                f"{remedy}"
            )
            yield Problem(sentence(text), *files.place(f"targets.{name}"))


def _unwritten(vehicle: Vehicle, mjcf: Path) -> Iterator[Problem]:
    """Yield what the MJCF has of other parameters, by which stock MuJoCo would fly it."""
    remedy = f"{command('vehicle build', _folder(vehicle))} writes them"
    try:
        for change in unwritten(vehicle.folder):
            element, names = change.element, ", ".join(change.numbers)
            named = f" {element.name!r}" if element.name else ""
            text = (
                f"the <{element.tag}>{named} has other numbers ({names}) than the parameters give, "
                f"by which stock MuJoCo would fly it; {remedy}"
            )
            yield Problem(sentence(text), element.file, element.line)
    except HelisimError as error:
        yield Problem.of(str(error), mjcf)


def _restless(vehicle: Vehicle, loops: Mapping[str, Margins], folder: Path) -> Iterator[Problem]:
    """Yield a gyro that doesn't hold its vehicle, or only just."""
    remedy = f"{command('tune', _folder(vehicle), '--write')} solves the gains for [tuning]"
    system = vehicle.linearize("IN2").system
    poles = np.abs(np.linalg.eigvals(np.asarray(system.A)))
    growth = float(np.log(poles.max()) / system.dt)
    if growth > _FASTEST_GROWTH:
        text = f"with its gyro a motion grows by {growth:.3g} 1/s in the hover; {remedy}"
        yield Problem(sentence(text), folder / "tuned.toml")
        return
    for axis, left in loops.items():
        if left.gain_db < _LEAST_GAIN or left.phase_deg < _LEAST_PHASE:
            text = (
                f"the {axis} loop has margins of {left.gain_db:.1f} dB and {left.phase_deg:.0f} "
                f"degrees, fewer than {_LEAST_GAIN:g} dB or {_LEAST_PHASE:g} degrees; {remedy}"
            )
            yield Problem(sentence(text), folder / "tuned.toml")
