"""A flight that goes on as somebody steps it: by hand, by an autopilot, or to be watched."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.physics.layout import PARAM
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.sim.flight import begin, generator
from helisim.sim.ground import Ground
from helisim.sim.limits import Contact
from helisim.sim.plan import hover_height
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses, root_body
from helisim.vehicle.trim import FLIPS


def hovering(
    vehicle: Vehicle, weather: Weather, ground: Ground | None, height: float | None = None
) -> tuple[Vehicle, mujoco.MjModel, float]:
    """Return a vehicle trimmed to be seen above its pad, its visible model, and its height, m."""
    model = vehicle.visual_model(None if ground is None else ground.put_into)
    height = hover_height(model) if height is None else height
    if ground is not None:
        vehicle = ground.felt_by(vehicle).trimmed(height=height, wind=weather.wind_to)
        model.opt.wind[:] = vehicle.model.opt.wind
    return vehicle, model, height


class Live:
    """A vehicle in a model of its own, placed where its flight begins by `reset`.

    `data` is MuJoCo's, `added` what a manoeuvre adds, (n_step, n_injection), or None.
    """

    added: NDArray[np.float64] | None = None

    def __init__(
        self,
        vehicle: Vehicle,
        model: mujoco.MjModel,
        weather: Weather,
        ground: Ground,
        *,
        height: float | None = None,
        seed: int = 1,
    ) -> None:
        """Take a trimmed vehicle and its model; the height, m, is the weather's if None."""
        self.vehicle, self.model, self.weather, self.ground = vehicle, model, weather, ground
        self.height, self.seed, self._where = height, seed, addresses(model)
        self.par = model.actuator_user[self._where.rotor]
        self.par[PARAM.ground_effect] = ground.effect
        weather.write(self.par, vehicle, seed=int(generator(seed, 0, "air").integers(2**31)))
        self.data, self._contact = mujoco.MjData(model), Contact(vehicle, ground)
        self._body, self._imu = self.data.body(root_body(model)), self.data.site("imu")

    def reset(self) -> None:
        """Begin at time 0."""
        flown = self.vehicle, self.model, self.data, self.weather, self.ground
        begin(*flown, height=self.height, seed=self.seed)
        self._contact.begin()
        self._begins()
        with installed():
            mujoco.mj_forward(self.model, self.data)

    def _begins(self) -> None:
        """Do what a kind of flight needs before its first step: nothing here."""

    @property
    def pose(self) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Time, s, position of the IMU, (3,) m NED, and rotation from body to earth, (3, 3)."""
        turn = FLIPS * self._body.xmat.reshape(3, 3)
        return self.data.time, np.array(flip(*self._imu.xpos)), turn

    @property
    def clearance(self) -> float:
        """Height of the lowest point of the landing gear above the ground, m."""
        return self._contact.clearance(*self.pose)

    def struck(self) -> str:
        """Return why a strike or a hard landing ends the flight now, "" if it goes on."""
        return self._contact.found(*self.pose, self.data.ncon > 0)
