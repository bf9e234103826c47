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
from helisim.base.errors import InputError, ModelError, check_known
from helisim.base.files import read_bytes
from helisim.base.linear import LinearSystem
from helisim.base.note import Command, Option
from helisim.base.settings import Value, is_number
from helisim.physics.gyro import equivalent_delay
from helisim.physics.layout import PARAM
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.records.record import ACCELERATIONS, IN1, RATES
from helisim.vehicle.addresses import addresses, own_centre, root_body
from helisim.vehicle.assembly import Around, Integrator, assemble, force_law_block, with_room
from helisim.vehicle.controller import (
    DIRECT,
    GYRO,
    Controller,
    ControllerLike,
    as_controller,
    law_room,
)
from helisim.vehicle.law import linearize_law
from helisim.vehicle.linearize import Linearization, linearize, plain_rotor, stability_derivatives
from helisim.vehicle.parameters import (
    PARAMETER_FILES,
    Parameters,
    completed,
    glossary,
    is_shipped,
    model_folder,
    read_parameters,
    untuned,
)
from helisim.vehicle.sampled import close
from helisim.vehicle.swashplate import INSTEAD, Swashplate, changed, with_both
from helisim.vehicle.trim import HEIGHT, Trim, find_trim, place

if TYPE_CHECKING:
    import control

Inputs = Literal["IN1", "IN2"]

_SETTABLE = ("gyro", "pilot", "gyro_tuned", "recorder_latency")
"""Sections of the parameters that leave the hover as it is."""


@dataclass(frozen=True, eq=False)
class Vehicle(Value, Displayed):
    """A helicopter with parameters in place, trimmed in a hover when loaded; `folder` is absolute.

    model: gyro on, pilot off; copy it before changing it. slung: MJCF of what hangs on it, or "".
    """

    folder: Path
    parameters: Parameters
    model: mujoco.MjModel
    trim: Trim
    controller: Controller = GYRO
    slung: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        where = self.name if is_shipped(self.folder) else self.folder
        return _passed, (where, self.parameters, self.model, self.trim, self.controller, self.slung)

    @property
    def name(self) -> str:
        """That of its folder."""
        return self.folder.name

    def __repr__(self) -> str:
        flight = f"at {self.trim.speed:g} m/s" if self.trim.speed else "in the hover"
        flight = f"with its load, {flight}" if self.slung else flight
        mass, count = self.model.body_mass.sum(), len(self.parameters)
        return f"Vehicle({self.name!r}, {mass:.4g} kg, {flight}, {count} parameters)"

    def _compared(self) -> tuple[Any, ...]:
        return self.name, self.parameters, self.trim, self.digest, self.controller

    def trimmed(
        self,
        *,
        speed: float = 0.0,
        height: float = HEIGHT,
        wind: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> "Vehicle":
        """Return the same vehicle in another steady flight, level and heading north; or TrimError.

        speed: m/s over the ground; height: m above it; wind: m/s towards north, east and down.
        Raises InputError if one can't be flown.
        """
        if not (
            np.shape(wind) == (3,)
            and all(is_number(one) and math.isfinite(one) for one in (speed, height, *wind))
            and height > 0.0
        ):
            raise InputError(
                "a flight needs a finite speed and wind in m/s (three numbers) and a height above "
                f"0 m, got speed {speed!r}, wind {wind!r}, height {height!r}"
            )
        model = copy.copy(self.model)
        model.opt.wind[:] = flip(*wind)
        trim = find_trim(model, speed=speed, height=height, near=self.trim)
        return self._changed(model, self.parameters, trim)

    @cached_property
    def imu_offset(self) -> tuple[float, float, float]:
        """The IMU's place from the centre of gravity, m, body axes (FRD)."""
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        body = root_body(self.model)
        arm = data.site("imu").xpos - own_centre(self.model, data)
        x, y, z = flip(*(data.xmat[body].reshape(3, 3).T @ arm))
        return float(x), float(y), float(z)

    @property
    def power(self) -> float:
        """Shaft power of main and tail rotor in this flight, W, without losses of the drive."""
        return sum(self._powers)

    @property
    def main_power(self) -> float:
        """Power that the main rotor's shaft alone takes in this flight, W."""
        return self._powers[0]

    @property
    def _powers(self) -> tuple[float, float]:
        data = self.hovering()
        with installed():
            mujoco.mj_forward(self.model, data)
        _, main, tail, _ = data.sensor("power").data
        return float(main), float(tail)

    def hovering(self) -> mujoco.MjData:
        """Return fresh simulation data in the trim, the hover by default."""
        data = mujoco.MjData(self.model)
        place(self.model, data, self.trim)
        return data

    def linearize(self, inputs: Inputs = "IN1") -> Linearization:
        """Return the linear model about the trim, with delays; `inputs` is "IN1" or "IN2".

        "IN1" is continuous and leads from the servo commands to the motion, with no control law.
        "IN2" is sampled and leads from the sticks to the motion, with the controller at work.
        """
        if inputs not in ("IN1", "IN2"):
            raise InputError(f"inputs must be 'IN1' or 'IN2', got {inputs!r}")
        if inputs == "IN2":
            return close(self._base, self.gyro, imu=self.imu_offset)
        return replace(
            self._base,
            delays=dict.fromkeys(IN1, 0.5 * self.parameters["gyro.period"]),
            trim=self.trim,
        )

    @cached_property
    def digest(self) -> str:
        """A digest of the compiled model: MJCF, parameters, time step, MuJoCo; no controller."""
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
        own |= {"slung": self.slung} if self.slung else {}
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
        """The controller's linear, sampled model, from fields of `Seen` to col, lon, lat, ped.

        Raises InputError without a controller, and ModelError if it can't hold this flight.
        """
        if self.controller == DIRECT:
            raise InputError("no controller moves the servos: linearize('IN1') is all there is")
        system = linearize_law(self.controller, self.model, self.trim)
        own = self.parameters
        late = dict.fromkeys(RATES, own["gyro.latency"]) | {"PED": own["gyro.ped_latency"]}
        late |= dict.fromkeys(ACCELERATIONS, float(self.model.opt.timestep))
        return replace(system, delays=late)

    def loop(self, axis: str) -> "control.StateSpace":
        """Return the sampled loop of the gyro, cut at a servo command ("lon", "lat" or "ped").

        It leads from that command to the gyro's answer, with the other loops closed. The loop gain
        L of the sensitivity 1 / (1 + L) is minus this. Raises UnknownNameError.
        """
        check_known("axis", [axis], IN1)
        return self.cut(axis).system

    def cut(self, axis: str) -> LinearSystem:
        """Return what `loop` does, with a frequency response of its own."""
        return close(self._base, self.gyro, imu=self.imu_offset, cut=axis).select(outputs=(axis,))

    def with_settings(self, settings: Mapping[str, float]) -> "Vehicle":
        """Return the same vehicle, not trimmed again, with other settings such as "gyro.k_p".

        Latencies inside the gyro change its linear model only. UnknownNameError: no such parameter;
        InputError: it is of the airframe, or no number; ModelError: a value that it can't have.
        """
        parameters = self.parameters.replace(settings)
        for name in settings:
            if name.split(".")[0] not in _SETTABLE:
                raise InputError(
                    f"{name!r} belongs to the airframe: give it to load(parameters=...), which "
                    "trims the vehicle again"
                )
        model = copy.copy(self.model)
        model.actuator_user[addresses(model).rotor, : len(PARAM)] = force_law_block(parameters)
        changed = self._changed(model, parameters, self.trim)
        changed.__dict__["_base"] = self._base
        return changed

    def _changed(self, model: mujoco.MjModel, parameters: Parameters, trim: Trim) -> "Vehicle":
        changed = replace(self, parameters=parameters, model=model, trim=trim)
        if not self.controller.is_shipped:
            controller = self.controller.on(changed)
            controller.put_into(model)
            changed = replace(changed, controller=controller)
        return changed

    def with_controller(self, controller: ControllerLike) -> "Vehicle":
        """Return the same vehicle with another controller; InputError if that is no law.

        A copy of its model outlives the vehicle only after `set_controller`.
        controller: a law of (seen, state, settings), a `Controller`, a law as data (`read_law`), or
        None: then nothing commands the servos but their `ctrl`.
        """
        chosen = as_controller(controller, self)
        model, states = copy.copy(self.model), sum(chosen.state_counts)
        if states > law_room(model):
            model = with_room(model, self.folder, self.parameters, states, slung=self.slung)
        chosen.put_into(model)
        changed = replace(self, model=model, controller=chosen)
        changed.__dict__["_base"] = self._base
        return changed

    @cached_property
    def _base(self) -> Linearization:
        return linearize(self.model, self.trim)

    def grounded_model(self, around: Around) -> mujoco.MjModel:
        """Return its model with something around it that it can touch, such as the ground."""
        return with_room(
            self.model,
            self.folder,
            self.parameters,
            law_room(self.model),
            around=around,
            slung=self.slung,
        )

    def visual_model(self, around: Around | None = None) -> mujoco.MjModel:
        """Return the vehicle's model with all its parts and its scene."""
        model = assemble(
            self.folder,
            self.parameters,
            visual=True,
            around=around,
            states=sum(self.controller.state_counts),
            slung=self.slung,
        )
        if not self.controller.is_shipped:
            self.controller.put_into(model)
        return model

    @cached_property
    def derivatives(self) -> dict[str, float]:
        """Stability and control derivatives of the base helicopter by name, SI.

        They hold at a constant rotor speed, with inflow that follows at once; the model of
        `linearize` has the states of a motor and of dynamic inflow.
        """
        model = plain_rotor(self.model)
        base = self._base if model is self.model else linearize(model, self.trim)
        return stability_derivatives(base, self.swashplate)

    def servo_delay(self, axis: str) -> float:
        """Return the equivalent delay of an axis's servos plus half a period of the gyro, s."""
        servo, own = "tail" if axis == "ped" else "swash", self.parameters
        lag = equivalent_delay(own[f"servo.{servo}_frequency"], own[f"servo.{servo}_damping"])
        return 0.5 * own["gyro.period"] + lag


def _passed(
    where: str | Path,
    parameters: Parameters,
    model: mujoco.MjModel,
    trim: Trim,
    controller: Controller,
    slung: str,
) -> Vehicle:
    folder = model_folder(where) if isinstance(where, str) else where
    if not controller.is_shipped:  # the laws of that process are not those of this one
        controller.put_into(model)
    return Vehicle(folder, parameters, model, trim, controller, slung)


def load(
    vehicle: str | PathLike[str] = "jr700",
    *,
    parameters: Mapping[str, float | str] | None = None,
    timestep: float | None = None,
    tuned: bool = True,
    integrator: Integrator | None = None,
    slung: str | PathLike[str] | None = None,
) -> Vehicle:
    """Load a vehicle, calibrated and trimmed.

    vehicle: a shipped one's name, or a folder; parameters: replacements, such as {"drive.governor":
    "ideal"}; timestep: s, the MJCF's own if None; tuned: False accepts an untuned gyro; integrator:
    "RK4" (MJCF's own) or "Euler", staggered: at 2 ms within a few parts in a thousand; slung: MJCF
    of a load that hangs on it, a file or its text. Raises UnknownNameError, InputError, ModelError
    (can't be built), StorageError (can't be read), TrimError (can't hover).
    """
    folder = model_folder(vehicle)
    values = changed(standard_parameters(folder, tuned=tuned), parameters or {})
    hung = str(slung or "")
    if hung and not hung.lstrip().startswith("<"):
        hung = read_bytes(Path(hung), limit=1 << 20).decode(errors="replace")
    model = assemble(folder, values, timestep=timestep, integrator=integrator, slung=hung)
    return Vehicle(folder, values, model, find_trim(model), slung=hung)


def standard_parameters(
    vehicle: str | PathLike[str] = "jr700", *, tuned: bool = True
) -> Parameters:
    """Return a vehicle's parameters from its files; tuned: False accepts an untuned gyro."""
    folder = model_folder(vehicle)
    files = [folder / file for file in PARAMETER_FILES]
    for path, command in ((files[1], "calibrate"), (files[2], "tune")):
        if not path.is_file() and (tuned or command == "calibrate"):
            raise ModelError(
                f"{path}: no such file",
                remedy=Command(command, (str(folder),), (Option("write"),)),
            )
    found = read_parameters(*(path for path in files if path.is_file()))
    found = found if files[2].is_file() else untuned(found)
    for name, known in glossary().items():
        if not known.optional and not {name, *INSTEAD.get(name, ())} & set(found):
            raise ModelError(
                f"{folder}: parameter {name} ({known.unit}) is missing; helisim vehicle check "
                "lists all that are"
            )
    return with_both(completed(found))
