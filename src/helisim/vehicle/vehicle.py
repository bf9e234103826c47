"""A vehicle, ready to fly: its model, parameters, hover and linearisations."""

import copy
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import mujoco
import numpy as np

from helisim.base.display import Displayed
from helisim.base.errors import InputError, ModelError
from helisim.base.linear import LinearSystem
from helisim.base.note import Command, Option
from helisim.base.settings import Value
from helisim.physics.gyro import equivalent_delay
from helisim.physics.layout import PARAM, SENSOR
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.records.record import ACCELERATIONS, IN1, RATES
from helisim.vehicle.assembly import Around, Integrator, assemble, force_law_block, with_room
from helisim.vehicle.controller import (
    DIRECT,
    GYRO,
    Controller,
    ControllerLike,
    as_controller,
    law_room,
)
from helisim.vehicle.folder import PARAMETER_FILES, Roles, is_shipped, model_folder, read_roles
from helisim.vehicle.law import linearize_law
from helisim.vehicle.linearize import Linearization, linearize, plain_rotor, stability_derivatives
from helisim.vehicle.parameters import (
    GyroSettings,
    Parameters,
    completed,
    glossary,
    read_parameters,
    untuned,
)
from helisim.vehicle.sampled import close
from helisim.vehicle.swashplate import INSTEAD, Swashplate, changed, with_both
from helisim.vehicle.trim import HEIGHT, Trim, addresses, find_trim, place, root_body

if TYPE_CHECKING:
    import control

Inputs = Literal["IN1", "IN2"]

_SETTABLE = ("gyro", "gyro_tuned", "recorder_latency")
"""Sections of the parameters that leave the hover as it is."""


@dataclass(frozen=True, eq=False)
class Vehicle(Value, Displayed):
    """A helicopter with parameters in place and its trim found.

    Attributes:
        folder: its own, with its whole path.
        parameters: every physical parameter, with unit and source.
        model: the compiled MuJoCo model, gyro on, pilot off. Copy it before changing it.
        trim: the steady flight that it flies, and is linearised about: the hover when loaded.
        controller: that commands its servos: the gyro that it comes with, when loaded.
    """

    folder: Path
    parameters: Parameters
    model: mujoco.MjModel
    trim: Trim
    controller: Controller = GYRO

    def __reduce__(self) -> tuple[Any, ...]:
        """Let a vehicle pass between processes, without what can be computed again."""
        where = self.name if is_shipped(self.folder) else self.folder
        return _passed, (where, self.parameters, self.model, self.trim, self.controller)

    @property
    def name(self) -> str:
        """That of its folder."""
        return self.folder.name

    @cached_property
    def roles(self) -> Roles:
        """The names that the author of its MJCF gave."""
        return read_roles(self.folder)

    def __repr__(self) -> str:
        mass = float(np.sum(self.model.body_mass))
        flight = f"at {self.trim.speed:g} m/s" if self.trim.speed else "in the hover"
        return f"Vehicle({self.name!r}, {mass:.4g} kg, {flight}, {len(self.parameters)} parameters)"

    def _compared(self) -> tuple[Any, ...]:
        return self.name, self.parameters, self.trim, self.digest, self.controller

    def trimmed(
        self,
        *,
        speed: float = 0.0,
        height: float = HEIGHT,
        wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> "Vehicle":
        """Return the same vehicle in another steady flight, level and heading north.

        Args:
            speed: m/s over the ground.
            height: m above the ground, which matters in its effect.
            wind: m/s towards north, east and down.

        Raises:
            InputError: a number is not finite, or the height not positive.
            TrimError: no equilibrium within the controls' range.
        """
        if not (all(map(math.isfinite, (speed, height, *wind))) and height > 0.0):
            raise InputError(
                "a flight needs a finite speed and wind in m/s and a height above 0 m, got "
                f"speed {speed}, wind {wind}, height {height}"
            )
        model = copy.copy(self.model)
        model.opt.wind[:] = flip(*wind)
        trim = find_trim(model, speed=speed, height=height, near=self.trim)
        changed = self._changed(model, self.parameters, trim)
        changed.__dict__.update(_unsampled=self._unsampled)
        return changed

    @cached_property
    def imu_offset(self) -> tuple[float, float, float]:
        """The IMU's place from the centre of gravity, m, body axes (FRD)."""
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        body = root_body(self.model)
        arm = data.site(self.roles.site("imu")).xpos - data.subtree_com[body]
        x, y, z = flip(*(data.xmat[body].reshape(3, 3).T @ arm))
        return float(x), float(y), float(z)

    @property
    def power(self) -> float:
        """Power that the shafts of main and tail rotor take in this flight, W.

        Induced, climb and profile power of both; no losses of gears, motor and speed controller.
        """
        return self.main_power + self._sensed_power(SENSOR.tail_power)

    @property
    def main_power(self) -> float:
        """Power that the main rotor's shaft alone takes in this flight, W."""
        return self._sensed_power(SENSOR.main_power)

    def _sensed_power(self, index: int) -> float:
        data = self.hovering()
        with installed():
            mujoco.mj_forward(self.model, data)
        return float(data.sensor("power").data[index - SENSOR.drive_power])

    def hovering(self) -> mujoco.MjData:
        """Return fresh simulation data in the trim, the hover by default."""
        data = mujoco.MjData(self.model)
        place(self.model, data, self.trim)
        return data

    def linearize(self, inputs: Inputs = "IN1") -> Linearization:
        """Return the exact linearisation at the trim, its delays beside it.

        Args:
            inputs: "IN1" for servo commands to motion, continuous; "IN2" for sticks to motion,
                sampled at the gyro's rate.

        Raises:
            InputError: no such set of inputs.
        """
        if inputs not in ("IN1", "IN2"):
            raise InputError(f"inputs must be 'IN1' or 'IN2', got {inputs!r}")
        if inputs == "IN2":
            return close(self._base, self.gyro, imu=self.imu_offset)
        held = 0.5 * self.parameters["gyro.period"]
        return replace(self._base, delays=dict.fromkeys(IN1, held), trim=self.trim)

    @cached_property
    def digest(self) -> str:
        """A digest of the compiled model: of its MJCF, parameters, time step and MuJoCo.

        Of the controller it says nothing.
        """
        model = copy.copy(self.model)
        if not self.controller.is_shipped:  # which has a digest of its own, and handles here
            GYRO.put_into(model)
        data = np.empty(mujoco.mj_sizeModel(model), dtype=np.uint8)
        mujoco.mj_saveModel(model, None, data)
        return hashlib.blake2b(data.tobytes(), digest_size=16).hexdigest()

    @property
    def provenance(self) -> dict[str, Any]:
        """The vehicle as plain data: enough to load it again, and to see whether it changed."""
        own = {} if self.controller.is_shipped else {"controller": self.controller.to_dict()}
        return {
            "vehicle": self.name,
            "model_digest": self.digest,
            "parameters": dict(self.parameters),
            "timestep_s": float(self.model.opt.timestep),
            **own,
        }

    @property
    def swashplate(self) -> Swashplate:
        """The mixing of its three servos under the swashplate."""
        return Swashplate.in_block(self.model.actuator_user[addresses(self.model).rotor])

    @cached_property
    def gyro(self) -> LinearSystem:
        """The controller's linear law at its ticks: of the gyro, or of whatever commands instead.

        From what it sees, by the names of `Seen`, to col, lon, lat, ped; its delays are those of
        the rates, of the forces that it feels and of the pedals.

        Raises:
            InputError: no law moves any servo.
            ModelError: the law can't hold the steady flight.
        """
        if self.controller == DIRECT:
            raise InputError("no controller moves the servos: linearize('IN1') is all there is")
        system = linearize_law(self.controller, self.model, self.trim)
        own = self.parameters
        late = dict.fromkeys(RATES, own["gyro.latency"]) | {"PED": own["gyro.ped_latency"]}
        late |= dict.fromkeys(ACCELERATIONS, float(self.model.opt.timestep))
        return replace(LinearSystem.from_control(system), delays=late)

    def loop(self, axis: str) -> "control.StateSpace":
        """Return what comes back at a servo command when the gyro's loop is cut there.

        Sampled; the input is the command of that axis ("lon", "lat" or "ped"), the output the
        gyro's answer to it, all other loops closed. Positive feedback: -1 is the stable side.
        """
        cut = close(self._base, self.gyro, imu=self.imu_offset, cut=axis)
        return cut.select(outputs=(axis,)).system

    @property
    def settings(self) -> GyroSettings:
        """The pilot's settings of the gyro."""
        return GyroSettings.of(self.parameters)

    def with_settings(self, settings: GyroSettings | Mapping[str, float]) -> "Vehicle":
        """Return the same vehicle with other settings of gyro and recorder, such as "gyro.k_p".

        For trying many: nothing is compiled or trimmed again, so the airframe can't change
        here, and the latencies inside the gyro change its linear model only.

        Raises:
            UnknownNameError: no such parameter.
            InputError: one that is not of gyro or recorder, or a value that it can't have.
        """
        if isinstance(settings, GyroSettings):
            settings = settings.as_parameters()
        fixed = [name for name in settings if name.split(".")[0] not in _SETTABLE]
        parameters = self.parameters.replace(settings)
        if fixed:
            raise InputError(
                f"{fixed[0]!r} belongs to the airframe: give it to load(parameters=...), which "
                "trims the vehicle again"
            )
        model = copy.copy(self.model)
        model.actuator_user[addresses(model).rotor, : len(PARAM)] = force_law_block(parameters)
        changed = self._changed(model, parameters, self.trim)
        changed.__dict__.update(_base=self._base, _unsampled=self._unsampled)
        return changed

    def _changed(self, model: mujoco.MjModel, parameters: Parameters, trim: Trim) -> "Vehicle":
        """Return the same vehicle in another flight, or with other settings, by its controller."""
        changed = Vehicle(self.folder, parameters, model, trim, self.controller)
        if self.controller.is_shipped:
            return changed
        controller = self.controller.on(changed)
        controller.put_into(model)
        return replace(changed, controller=controller)

    def with_controller(self, controller: ControllerLike) -> "Vehicle":
        """Return the same vehicle with another controller of its servos.

        Nothing is trimmed again: a controller doesn't change what flies. To step a copy of its
        model after the vehicle is gone, give that the controller with `set_controller`.

        Args:
            controller: a law of (seen, state, settings), a `Controller`, a law as data such as
                `read_law` gives, or None: then nothing commands the servos but their `ctrl`.

        Raises:
            InputError: it is no law, or numba can't compile it.
        """
        chosen = as_controller(controller, self)
        model = copy.copy(self.model)
        if sum(chosen.state_counts) > law_room(model):
            model = with_room(model, self.folder, self.parameters, sum(chosen.state_counts))
        chosen.put_into(model)
        changed = Vehicle(self.folder, self.parameters, model, self.trim, chosen)
        changed.__dict__.update(_base=self._base, _unsampled=self._unsampled)
        return changed

    @cached_property
    def _base(self) -> Linearization:
        return linearize(self._linear_model, self.trim)

    @cached_property
    def _linear_model(self) -> mujoco.MjModel:
        model = copy.copy(self._unsampled)
        user = self.model.actuator_user[addresses(self.model).rotor]
        model.actuator_user[addresses(model).rotor] = user
        if not self.controller.is_shipped:  # no law acts here, and there may be no room for it
            GYRO.put_into(model)
        model.opt.wind[:] = self.model.opt.wind
        return model

    @cached_property
    def _unsampled(self) -> mujoco.MjModel:
        return assemble(self.folder, self.parameters, delays=False)

    def grounded_model(self, around: Around) -> mujoco.MjModel:
        """Return its model with something around it that it can touch, such as the ground."""
        return with_room(
            self.model, self.folder, self.parameters, law_room(self.model), around=around
        )

    def visual_model(self, around: Around | None = None) -> mujoco.MjModel:
        """Return the same vehicle with all its parts and the scene around it, to look at.

        Args:
            around: changes the scene, as for `assemble`.
        """
        states = sum(self.controller.state_counts)
        model = assemble(self.folder, self.parameters, visual=True, around=around, states=states)
        if not self.controller.is_shipped:
            self.controller.put_into(model)
        return model

    @cached_property
    def derivatives(self) -> dict[str, float]:
        """Stability and control derivatives of the base helicopter by name, SI.

        At a rotor speed that is kept and with inflow that follows at once, as the structures have
        them whose parameters they are; a motor or dynamic inflow is in `linearize`.
        """
        model = plain_rotor(self._linear_model)
        same = model is self._linear_model
        base = self._base if same else linearize(model, self.trim)
        return stability_derivatives(base, self.swashplate)

    def servo_delay(self, axis: str) -> float:
        """Return the delay of the servos that move a control axis, s.

        The equivalent delay of the servo, and half a period in which its command is held.
        """
        held = 0.5 * self.parameters["gyro.period"]
        par = self.model.actuator_user[addresses(self.model).rotor]
        if axis == "ped":
            lag = equivalent_delay(par[PARAM.tail_frequency], par[PARAM.tail_damping])
        else:
            lag = equivalent_delay(par[PARAM.swash_frequency], par[PARAM.swash_damping])
        return held + lag


def _passed(
    where: str | Path,
    parameters: Parameters,
    model: mujoco.MjModel,
    trim: Trim,
    controller: Controller,
) -> Vehicle:
    """Return a vehicle that came from another process, where helisim may be elsewhere."""
    folder = model_folder(where) if isinstance(where, str) else where
    if not controller.is_shipped:  # the laws of that process are not those of this one
        controller.put_into(model)
    return Vehicle(folder, parameters, model, trim, controller)


def load(
    vehicle: str | PathLike[str] = "jr700",
    *,
    parameters: Mapping[str, float | str] | None = None,
    timestep: float | None = None,
    tuned: bool = True,
    integrator: Integrator | None = None,
) -> Vehicle:
    """Load a vehicle, calibrated and trimmed.

    Args:
        vehicle: name of a shipped one, such as "jr700", or path of a folder of your own.
        parameters: values that replace the calibrated ones, such as
            {"main_rotor.hub_stiffness": 100.0}, or a word where one is chosen, such as
            {"drive.governor": "ideal"}; the truth then follows them.
        timestep: s; the MJCF's own if None.
        tuned: False accepts a vehicle whose gyro is not tuned yet, to tune it.
        integrator: "RK4", fourth order, the MJCF's own and the default; or "Euler", staggered to
            second order: at 2 ms within a few parts in a thousand of it, at a quarter of the cost.

    Raises:
        UnknownNameError: no such vehicle or parameter.
        InputError: a value is not finite or no such choice, or no such integrator.
        ModelError: the model can't be built.
        TrimError: it can't hover.
    """
    folder = model_folder(vehicle)
    values = changed(standard_parameters(folder, tuned=tuned), parameters or {})
    model = assemble(folder, values, timestep=timestep, integrator=integrator)
    return Vehicle(folder, values, model, find_trim(model))


def _makes(command: str, folder: Path) -> Command:
    """Return the command that makes a parameter file of a vehicle."""
    return Command(command, (str(folder),), (Option("write"),))


def standard_parameters(
    vehicle: str | PathLike[str] = "jr700", *, tuned: bool = True
) -> Parameters:
    """Return a vehicle's parameters as its files give them, calibrated and tuned.

    Args:
        vehicle: name of a shipped one, or path of a folder.
        tuned: False accepts a vehicle whose gyro is not tuned yet.

    Raises:
        UnknownNameError: no such vehicle.
        ModelError: a file is missing or malformed.
    """
    folder = model_folder(vehicle)
    files = [folder / file for file in PARAMETER_FILES]
    _, calibrated, tuned_file = files
    if not calibrated.is_file():
        raise ModelError(f"{calibrated}: no such file", remedy=_makes("calibrate", folder))
    if tuned and not tuned_file.is_file():
        raise ModelError(f"{tuned_file}: no such file", remedy=_makes("tune", folder))
    if tuned_file.is_file():
        found = read_parameters(*files)
    else:
        found = untuned(read_parameters(*files[:-1]))
    missing = [
        known
        for known in glossary().values()
        if not known.optional and not {known.name, *INSTEAD.get(known.name, ())} & set(found)
    ]
    if missing:
        first, more = missing[0], len(missing) - 1
        others = f" and {more} more, which helisim vehicle check lists" if more else ""
        raise ModelError(f"{folder}: parameter {first.name} ({first.unit}) is missing{others}")
    return with_both(completed(found))
