"""Domain randomisation: each episode flies a helicopter a little unlike the last."""

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.vehicle import Vehicle
from helisim.vehicle.assembly import total_inertia
from helisim.vehicle.blade import changed
from helisim.vehicle.force_laws import force_law_block
from helisim.vehicle.motion import addresses, root_body
from helisim.vehicle.parameters import Parameters

MASS = "airframe.mass"
INERTIAS = ("airframe.ixx", "airframe.iyy", "airframe.izz")
_BUILT_IN = ("gyro.period",)
"""Reaches the force laws, but the model's ticks were built with it."""

USUAL: dict[str, float] = {
    MASS: 0.1,
    **dict.fromkeys(INERTIAS, 0.15),
    "air.density": 0.1,
    "main_rotor.speed": 0.03,
    "main_rotor.lift_slope": 0.1,
    "main_rotor.hub_stiffness": 0.2,
    "flapping.tau_f": 0.15,
    "tail_rotor.lift_slope": 0.15,
    "servo.swash_frequency": 0.2,
    "servo.tail_frequency": 0.2,
    "servo.rate_limit": 0.2,
    "gyro.kp_lat": 0.2,
    "gyro.kp_lon": 0.2,
    "gyro.k_p": 0.2,
}
"""Relative spreads that a policy should bear before it meets another helicopter."""


class Spread:
    """How far each parameter is spread about the vehicle's own, and how to put it in a model.

    Args:
        vehicle: whose parameters are spread.
        relative: parameter -> half the width of its range, relative: 0.1 draws factors from 0.9
            to 1.1, all as likely. "airframe.mass" is one too.

    Raises:
        UnknownNameError: no such parameter.
        InputError: one that doesn't act in flight, is 0, or a spread that isn't in [0, 1).
    """

    def __init__(self, vehicle: Vehicle, relative: Mapping[str, float]) -> None:
        own = vehicle.parameters
        self.names = tuple(relative)
        for name, width in relative.items():
            _check(own, name, width)
        self._own, self._own_block = own, force_law_block(own)
        self._in_block = [name for name in self.names if name not in (MASS, *INERTIAS)]
        self._widths = np.array([float(relative[name]) for name in self.names])
        model = vehicle.model
        self._rotor = addresses(model).rotor
        self._body = root_body(model)
        self._mass = model.body_mass.copy()
        self._frame = np.empty(9)
        mujoco.mju_quat2Mat(self._frame, model.body_iquat[self._body])
        turn = self._frame.reshape(3, 3)
        self._inertia = turn @ np.diag(model.body_inertia[self._body]) @ turn.T
        self._total = np.diag(total_inertia(model, self._body)).copy()
        self._scratch = mujoco.MjData(model)

    def draw(self, random: np.random.Generator) -> NDArray[np.float64]:
        """Return a factor for each of `names`, (n_names,)."""
        return 1.0 + self._widths * random.uniform(-1.0, 1.0, len(self.names))

    def write(self, model: mujoco.MjModel, factors: NDArray[np.float64]) -> None:
        """Put factors, (n_names,), into a copy of the vehicle's model that is as it was loaded."""
        factor = dict(zip(self.names, factors.tolist()))
        if self._in_block:
            user = model.actuator_user[self._rotor]
            spread = {name: self._own[name] * factor[name] for name in self._in_block}
            block = force_law_block(changed(self._own, spread))
            differs = np.flatnonzero(block != self._own_block)
            user[differs] = block[differs]
        if len(self._in_block) < len(self.names):
            self._write_body(model, factor)

    def _write_body(self, model: mujoco.MjModel, factor: Mapping[str, float]) -> None:
        model.body_mass[:] = self._mass * factor.get(MASS, 1.0)
        grown = [factor.get(name, 1.0) - 1.0 for name in INERTIAS]
        inertia = (self._inertia + np.diag(self._total * grown)).ravel()
        mujoco.mju_eig3(
            model.body_inertia[self._body], self._frame, model.body_iquat[self._body], inertia
        )
        model.body_sameframe[self._body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        mujoco.mj_setConst(model, self._scratch)


def _check(own: Parameters, name: str, width: float) -> None:
    if name != MASS and name not in own:
        raise UnknownNameError("parameter", name, sorted([*own, MASS]))
    if not (isinstance(width, (int, float)) and 0.0 <= width < 1.0):
        raise InputError(f"spread of {name!r} must be relative, from 0 to below 1, got {width!r}")
    if name in (MASS, *INERTIAS):
        return
    if own[name] == 0.0:
        raise InputError(f"{name!r} is 0, which no relative spread changes; leave it out")
    if not _acts(own, name):
        raise InputError(
            f"{name!r} can't be spread: an episode flies without it, or the model is built with "
            "it; give it to helisim.load(parameters=...) instead"
        )


def _acts(own: Parameters, name: str) -> bool:
    """Return whether a parameter reaches the force laws of a flight whose pilot is the agent."""
    if name in _BUILT_IN or name.startswith("pilot."):
        return False
    try:
        moved = force_law_block(changed(own, {name: 0.99 * own[name]}))
    except HelisimError:
        return False  # a choice among a few, of which nothing is near
    return bool(np.any(moved != force_law_block(own)))
