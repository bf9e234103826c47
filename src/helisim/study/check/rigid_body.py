"""A vehicle's rigid body: mass, centre of gravity, places, and an inertia that a solid can have."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, ModelError
from helisim.physics.layout import ACTUATORS, ROTOR, ROTOR_STATES
from helisim.physics.memory import TICK_TOLERANCE
from helisim.study.check.figures import at_a_glance, implausible
from helisim.study.check.parameter_files import ParameterFiles
from helisim.study.check.problem import Problem, sentence
from helisim.vehicle.assembly import total_inertia, wanted_inertia
from helisim.vehicle.blade import INERTIA, with_both
from helisim.vehicle.build import Element, Mjcf
from helisim.vehicle.folder import Roles
from helisim.vehicle.motion import root_body
from helisim.vehicle.parameters import Parameters, completed

_OFF_CENTRE = 0.002
"""Of the rotor's radius: the trim tilts by as much over the hub's height, some 0.3 degrees."""
_MISPLACED = 0.005
"""Of the rotor's radius: what is drawn is drawn to the millimetre."""
_DIVISORS = (
    "air.density",
    "main_rotor.radius",
    "main_rotor.speed",
    "main_rotor.chord",
    "main_rotor.blades",
)
_AXES = ("ixx", "iyy", "izz")


def body_problems(path: Path, files: ParameterFiles) -> list[Problem]:
    """Return what is wrong with the rigid body that an MJCF describes.

    Args:
        path: of the vehicle's MJCF, whose elements are all there.
        files: its parameter files, all there.
    """
    roles, own = files.roles, {name: one.value for name, one in files.entries.items()}
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        roles.rename(spec)
        model = spec.compile()
    except (ValueError, HelisimError) as error:
        return [Problem.of(str(error), path)]
    mjcf = Mjcf(path)
    problems = list(_wrong_channels(model, mjcf, roles))
    try:
        root = root_body(model)
    except HelisimError as error:
        rotor = mjcf.find("actuator", roles.name("actuator", "rotor"))
        return [*problems, _at(str(error), rotor, path)]
    problems += _off_centre(model, root, own["main_rotor.radius"], mjcf, roles, path)
    problems += _misplaced(model, root, own, files)
    problems += _not_solid(model, root, own, files)
    problems += _out_of_step(model, own, files)
    try:
        own = dict(with_both(completed(Parameters(files.entries))))
    except ModelError as error:
        files.add(str(error), INERTIA)
        return problems
    if INERTIA in own and min(own[name] for name in _DIVISORS) > 0.0:
        weight = model.body_subtreemass[root] * np.linalg.norm(model.opt.gravity)
        problems += implausible(at_a_glance(own, float(weight)))
    return problems


def _wrong_channels(model: mujoco.MjModel, mjcf: Mjcf, roles: Roles) -> Iterator[Problem]:
    """Yield actuators that have no room for the states of the force laws."""
    for ordinal, role in enumerate(ACTUATORS):
        found = int(model.actuator_actnum[model.actuator(role).id])
        servo = role.startswith("servo")
        wanted = ROTOR_STATES if ordinal == ROTOR else 2 if servo else 0
        if found == wanted or (ordinal == ROTOR and found > wanted):
            continue
        element = mjcf.find("actuator", roles.name("actuator", role))
        states = f'dyntype="user" actdim="{wanted}"' if wanted else 'no dyntype="user"'
        yield _at(
            f"the actuator {role!r} must have {states}, here or in its class; it has {found} "
            "activations",
            element,
            mjcf.path,
        )


def _off_centre(
    model: mujoco.MjModel, root: int, radius: float, mjcf: Mjcf, roles: Roles, path: Path
) -> Iterator[Problem]:
    """Yield a centre of gravity that isn't the origin of the vehicle's body."""
    data = _at_rest(model)
    offset = _inside(data, root, data.subtree_com[root])
    if np.linalg.norm(offset) <= _OFF_CENTRE * radius:
        return
    name = roles.body("fuselage")
    fuselage = model.body(name).id
    shift = -offset * model.body_subtreemass[root] / model.body_mass[fuselage]
    element = mjcf.find("worldbody", name, tag="body")
    inertial = [one for one in mjcf if one.parent is element and one.tag == "inertial"]
    x, y, z = np.round(1e3 * offset, 1) + 0.0  # no minus before a zero
    found = _at(
        f"the centre of gravity is {x:.1f} mm ahead, {y:.1f} mm left and {z:.1f} mm above the "
        f"origin of the body {model.body(root).name!r}, about which the force laws act; move "
        "parts, or the fuselage's inertial pos by "
        f"{' '.join(f'{part:.4g}' for part in np.round(shift, 6) + 0.0)} m",
        inertial[0] if inertial else element,
        path,
    )
    yield replace(found, flies=True)


def _misplaced(
    model: mujoco.MjModel, root: int, own: Mapping[str, float], files: ParameterFiles
) -> Iterator[Problem]:
    """Yield hubs that the parameters and the MJCF have in different places."""
    data = _at_rest(model)
    for role, section, along, down in (
        ("hub", "main_rotor", "hub_x", "hub_z"),
        ("tail_hub", "tail_rotor", "arm_x", "arm_z"),
    ):
        name = files.roles.site(role)
        x, _, up = _inside(data, root, data.site(name).xpos)
        for key, drawn in ((along, x), (down, -up)):
            given = own[f"{section}.{key}"]
            if abs(given - drawn) > _MISPLACED * own["main_rotor.radius"]:
                text = (
                    f"{section}.{key} is {given:g} m, and the site {name!r} of the MJCF is at "
                    f"{drawn + 0.0:.4g} m; make them one place"
                )
                yield Problem(sentence(text), *files.place(f"{section}.{key}"), flies=True)


def _not_solid(
    model: mujoco.MjModel, root: int, own: Mapping[str, float], files: ParameterFiles
) -> Iterator[Problem]:
    """Yield moments of inertia that no solid has: of the whole, or of what is left to a part."""
    whole = {axis: own[f"airframe.{axis}"] for axis in _AXES}
    largest = max(whole, key=lambda axis: whole[axis])
    others = sum(whole.values()) - whole[largest]
    if min(whole.values()) <= 0.0 or whole[largest] > others:
        text = (
            f"airframe.{largest} = {whole[largest]:.4g} kg m^2 is more than the other two moments "
            f"together, {others:.4g}, which no solid has; lower it, or raise another"
        )
        yield Problem(sentence(text), *files.place(f"airframe.{largest}"))
        return
    fuselage = model.body(files.roles.body("fuselage")).id
    missing = wanted_inertia(own) - total_inertia(model, root)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[fuselage])
    matrix = turn.reshape(3, 3)
    left = missing + matrix @ np.diag(model.body_inertia[fuselage]) @ matrix.T
    small, middle, large = np.linalg.eigvalsh(left)
    if small > 0.0 and small + middle >= large:
        return
    parts = np.diag(np.diag(list(whole.values())) - left)
    takes = ", ".join(f"{axis} {part:.4g}" for axis, part in zip(_AXES, parts))
    text = (
        "the fuselage is left with principal moments of inertia of "
        f"{small:.4g}, {middle:.4g} and {large:.4g} kg m^2, which no solid has (each positive, "
        f"none more than the other two together); the other parts take {takes} of the whole: "
        "change airframe.ixx, iyy or izz, or the parts' masses and places"
    )
    yield Problem(sentence(text), *files.place("airframe.ixx"))


def _out_of_step(
    model: mujoco.MjModel, own: Mapping[str, float], files: ParameterFiles
) -> Iterator[Problem]:
    """Yield a gyro that does not tick at a time step."""
    step = float(model.opt.timestep)
    steps = own["gyro.period"] / step
    if steps < 0.5 or abs(steps - round(steps)) > TICK_TOLERANCE:
        near = max(1, round(steps)) * step
        text = (
            f"gyro.period = {own['gyro.period']:g} s must be a whole number of the MJCF's time "
            f"steps of {step:g} s: {near:g} s is one"
        )
        yield Problem(sentence(text), *files.place("gyro.period"))


def _at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def _inside(data: mujoco.MjData, root: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a point of the world in the vehicle's axes (forward, left, up), (3,)."""
    return data.xmat[root].reshape(3, 3).T @ (point - data.xpos[root])


def _at(text: str, element: Element | None, path: Path) -> Problem:
    if element is None:
        return Problem(sentence(text), path)
    return Problem(sentence(text), element.file, element.line)
