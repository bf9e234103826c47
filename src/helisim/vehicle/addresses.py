"""Where a vehicle's numbers and its body stand in a MuJoCo model."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import ModelError, UnknownNameError
from helisim.physics.layout import PARAM, ROTOR, STATE
from helisim.physics.memory import NO_FREE_JOINT, free_body


class Addresses(NamedTuple):
    """Starts of a vehicle's numbers: rotor actuator, first activation, first control."""

    rotor: int
    state: int
    control: int


def addresses(model: mujoco.MjModel, prefix: str = "") -> Addresses:
    """Find a vehicle in a model, by prefix in a scene; may raise UnknownNameError or ModelError."""
    rotor = _rotor_actuator(model, prefix)
    if model.nuser_actuator < len(PARAM):
        raise ModelError(
            f"the scene has room for {model.nuser_actuator} numbers of an actuator, and a vehicle "
            f"has {len(PARAM)}; take nuser_actuator out of the scene's <size/>, or write them into "
            "the vehicle's MJCF with `helisim vehicle build FOLDER`"
        )
    state = int(model.actuator_actadr[rotor]) - STATE.flap_a
    return Addresses(rotor, state, int(model.actuator_ctrladr[rotor]) - ROTOR)


def write_named(par: NDArray[np.float64], **numbers: ArrayLike) -> None:
    """Write numbers into a vehicle's parameters, (n_param,), by their names in `PARAM`.

    Several numbers take the places from the named one on, as `gust_north=(0.0, 0.0, 1.0)`.
    """
    for name, number in numbers.items():
        first = getattr(PARAM, name)
        par[first : first + np.size(number)] = number


def _rotor_actuator(model: mujoco.MjModel, prefix: str) -> int:
    names = {model.actuator(k).name: k for k in range(model.nactuator)}
    rotors = [name for name in names if name.endswith("rotor")]
    exact = [name for name in rotors if name == f"{prefix}rotor"]
    meant = exact or [name for name in rotors if name.startswith(prefix)]
    if len(meant) != 1:
        advice = "there are several: give the prefix of one" if meant else ""
        raise UnknownNameError("vehicle's rotor", f"{prefix}rotor", rotors, advice=advice)
    return names[meant[0]]


def root_body(model: mujoco.MjModel) -> int:
    """Return the number of a vehicle's body; may raise UnknownNameError or ModelError."""
    body = free_body(model, _rotor_actuator(model, ""))
    if body is None:
        raise ModelError(f"actuator 'rotor' {NO_FREE_JOINT}")
    return body
