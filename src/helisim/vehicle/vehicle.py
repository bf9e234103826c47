"""A vehicle, ready to fly: its model, parameters, hover and linearisations."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco

from helisim.physics.layout import PARAM
from helisim.physics.servo import equivalent_delay
from helisim.vehicle.assembly import assemble, model_folder
from helisim.vehicle.linearize import Inputs, Linearization, linearize, stability_derivatives
from helisim.vehicle.motion import addresses
from helisim.vehicle.parameters import Parameters, read_parameters
from helisim.vehicle.trim import Trim, find_hover, place


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A helicopter with parameters in place and its hover found.

    Attributes:
        name: of the model folder.
        parameters: every physical parameter, with unit and source.
        model: the compiled MuJoCo model, gyro on, pilot off. Copy it before changing it.
        trim: the hover.
    """

    name: str
    parameters: Parameters
    model: mujoco.MjModel
    trim: Trim

    def hovering(self) -> mujoco.MjData:
        """Return fresh simulation data in the hover."""
        data = mujoco.MjData(self.model)
        place(self.model, data, self.trim)
        return data

    def linearize(self, inputs: Inputs = "IN1") -> Linearization:
        """Return the exact linearisation at the hover, its delays beside it.

        Args:
            inputs: "IN1" for servo commands to motion, "IN2" for sticks to motion.
        """
        model = assemble(self.name, self.parameters, delays=False)
        linear = linearize(model, self.trim, inputs=inputs)
        delays = {"PED": self.parameters["gyro.ped_latency"]} if inputs == "IN2" else {}
        return Linearization(linear.system, delays, self.trim)

    def visual_model(self) -> mujoco.MjModel:
        """Return the same vehicle with all its parts and the scene around it, to look at."""
        return assemble(self.name, self.parameters, visual=True)

    @cached_property
    def derivatives(self) -> dict[str, float]:
        """Stability and control derivatives of the base helicopter by name, SI."""
        return stability_derivatives(self.linearize("IN1"))

    def servo_delay(self, axis: str) -> float:
        """Return the equivalent delay of the servos that move a control axis, s."""
        par = self.model.actuator_user[addresses(self.model).rotor]
        if axis == "ped":
            return equivalent_delay.py_func(par[PARAM.tail_frequency], par[PARAM.tail_damping])
        return equivalent_delay.py_func(par[PARAM.swash_frequency], par[PARAM.swash_damping])


def load(
    name: str = "jr700",
    *,
    parameters: Mapping[str, float] | None = None,
    timestep: float | None = None,
) -> Vehicle:
    """Load a vehicle, calibrated and trimmed.

    Args:
        name: of the vehicle, such as "jr700".
        parameters: values that replace the calibrated ones, such as
            {"main_rotor.hub_stiffness": 100.0}; the truth then follows them.
        timestep: s; the MJCF's own if None.

    Raises:
        UnknownNameError: no such vehicle or parameter.
        InputError: a value is not finite.
        ModelError: the model can't be built.
        TrimError: it can't hover.
    """
    folder = model_folder(name)
    values = read_parameters(folder / "parameters.toml", folder / "calibrated.toml")
    values = values.replace(parameters or {})
    model = assemble(name, values, timestep=timestep)
    return Vehicle(name, values, model, find_hover(model))
