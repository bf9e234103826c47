"""How an episode starts: a motion near the trim, in the episode's weather."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import is_number
from helisim.gym.settings import Setup
from helisim.physics.layout import STATE
from helisim.physics.motion import flip
from helisim.sim import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import Motion, addresses, write_motion
from helisim.vehicle.trim import place

_FIELDS = tuple(field.name for field in fields(Motion))


class EpisodeStart:
    """The starts of a setup's episodes.

    Attributes:
        height: m above the ground.
        state: MuJoCo's full physics state in the trim, (n_state,).
    """

    def __init__(self, setup: Setup, vehicle: Vehicle) -> None:
        self._weather, self._vehicle = setup.weather, vehicle
        model = vehicle.model
        self.height = setup.weather.height
        self._rotor = addresses(model).rotor
        first = addresses(model).state
        self._air = slice(first + STATE.air_u, first + STATE.air_r_lag + 1)
        self._data = mujoco.MjData(model)
        place(model, self._data, vehicle.trim, height=self.height)
        self._motion = replace(vehicle.trim.motion, down=-self.height)
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self.state = np.empty(size)
        self._read(self.state)
        near = setup.start
        self._reach = np.array(
            [near.velocity] * 3
            + [near.rate] * 3
            + [near.tilt] * 2
            + [near.heading]
            + [near.position] * 3
        )

    def draw(self, random: np.random.Generator) -> tuple[dict[str, float], Weather, int]:
        """Return how far a motion is from the trim, by name, the weather, and a seed for its air.

        Velocities are drawn in the earth's axes, of a helicopter that is nearly level.
        """
        offsets = self._reach * random.uniform(-1.0, 1.0, len(_FIELDS))
        seed = int(random.integers(2**31))
        weather = self._weather
        drawn = weather if isinstance(weather, Weather) else weather.draw(random)
        return dict(zip(_FIELDS, offsets.tolist())), drawn, seed

    def write_weather(self, model: mujoco.MjModel, weather: Weather, seed: int) -> None:
        """Put the weather into a model of the vehicle; its turbulence has this seed."""
        model.opt.wind[:] = flip(*weather.wind_to)
        weather.write(model.actuator_user[self._rotor], self._vehicle, seed=seed)

    def state_of(
        self, offsets: Mapping[str, float], weather: Weather, seed: int
    ) -> NDArray[np.float64]:
        """Return the full physics state of a start, (n_state,).

        Args:
            offsets: field of `Motion` -> how far it is from the trim's.
            weather: whose turbulence is under way.
            seed: of its first air.

        Raises:
            UnknownNameError: no such field.
            InputError: not a finite number.
        """
        for name, value in offsets.items():
            if name not in _FIELDS:
                raise UnknownNameError("field of a motion", name, _FIELDS)
            if not (is_number(value) and math.isfinite(value)):
                raise InputError(f"motion: {name} must be a finite number, got {value!r}")
        trim = self._motion
        motion = replace(
            trim, **{name: getattr(trim, name) + value for name, value in offsets.items()}
        )
        write_motion(self._vehicle.model, self._data, motion)
        calm = weather.dryden is None
        rough = 0.0 if calm else weather.start(self._vehicle, np.random.default_rng(seed))
        self._data.act[self._air] = rough
        state = np.empty_like(self.state)
        self._read(state)
        return state

    def _read(self, state: NDArray[np.float64]) -> None:
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        mujoco.mj_getState(self._vehicle.model, self._data, state, kind)
