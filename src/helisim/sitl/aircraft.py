"""A vehicle on its ground, flown by frames of pulses."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.frames import flip
from helisim.physics.layout import CONTROL, SENSOR
from helisim.physics.native import installed
from helisim.physics.params import PARAM
from helisim.sim.ground import Ground
from helisim.sitl.outputs import Outputs
from helisim.sitl.packet import Sensed
from helisim.vehicle import load
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place


class Aircraft:
    """A vehicle that stands on the ground, its rotor stopped, until an autopilot flies it."""

    def __init__(self, vehicle: str = "jr700", *, ground: Ground | None = None) -> None:
        """Place a vehicle on the ground.

        Args:
            vehicle: name or folder.
            ground: level, with its effect, if None.
        """
        ground = ground or Ground(parked=True, rotor=0.0)
        loaded = load(vehicle, parameters={"drive.governor": "motor"})
        self.vehicle = ground.felt_by(loaded.with_controller(None))
        self.model = self.vehicle.grounded_model(ground.put_into)
        self.data = mujoco.MjData(self.model)
        self.outputs = Outputs()
        self._where = addresses(self.model)
        par = self.model.actuator_user[self._where.rotor]
        par[PARAM.gyro_on] = par[PARAM.pilot_on] = 0.0
        par[PARAM.ground_effect] = ground.effect
        place(self.model, self.data, self.vehicle.trim)
        ground.begin(self.vehicle, self.model, self.data)

    def step(self, pulses: Sequence[int]) -> Sensed:
        """Fly on by one time step with the outputs where they are, and return what is sensed."""
        first = self._where.control
        commands = self.outputs.commands(pulses)
        self.data.ctrl[first + CONTROL.servo_front : first + CONTROL.rotor + 1] = commands
        with installed():
            mujoco.mj_step(self.model, self.data)
        return self.sensed()

    def sensed(self) -> Sensed:
        """Return what the IMU senses where the last step began."""
        sensors = self.data.sensordata[int(self.model.sensor_adr[self._first]) :]

        def three(name: int) -> NDArray[np.float64]:
            return np.array(flip(*sensors[name : name + 3]))

        w, x, y, z = sensors[SENSOR.imu_quat_w : SENSOR.imu_quat_w + 4]
        turn = np.array([w, *flip(x, y, z)])
        return Sensed(
            time=float(sensors[SENSOR.clock]),
            gyro=three(SENSOR.imu_p),
            force=three(SENSOR.imu_ax),
            position=three(SENSOR.imu_x),
            velocity=_turned(turn, three(SENSOR.imu_u)),
            quaternion=turn,
        )

    @property
    def _first(self) -> int:
        return int(mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_SENSOR, "imu_gyro"))


def _turned(quaternion: NDArray[np.float64], vector: NDArray[np.float64]) -> Any:
    """Return a body's vector in earth axes, (3,)."""
    turned = np.empty(3)
    mujoco.mju_rotVecQuat(turned, vector, quaternion)
    return turned
