"""What the tests of physics, vehicle and simulation share."""

import copy
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pytest
from hypothesis import settings

import interpreted
from helisim.physics.params import PARAM
from helisim.vehicle import Vehicle, load
from helisim.vehicle.motion import addresses

if interpreted.wanted():
    interpreted.install()

# No deadline: the first example may compile. Derandomised: a failure repeats everywhere.
settings.register_profile("helisim", deadline=None, derandomize=True, database=None)
settings.load_profile("helisim")

HOOKS = ("passive", "control", "act_dyn", "sensor", "time")


@pytest.fixture(autouse=True)
def no_callback_left_behind() -> Iterator[None]:
    """Fail any test after which one of MuJoCo's global callbacks is still set."""
    yield
    left = [hook for hook in HOOKS if getattr(mujoco, f"get_mjcb_{hook}")() is not None]
    for hook in left:
        getattr(mujoco, f"set_mjcb_{hook}")(None)
    assert not left
    errors = interpreted.raised.copy()
    interpreted.raised.clear()
    assert not errors


@pytest.fixture(scope="session")
def jr700() -> Vehicle:
    """The calibrated vehicle. Tests copy its model before they change it."""
    return load("jr700")


@pytest.fixture
def par(jr700: Vehicle) -> np.ndarray:
    """A writable copy of the numbers that the vehicle's force laws read."""
    return jr700.model.actuator_user[addresses(jr700.model).rotor].copy()


@pytest.fixture
def altered(jr700: Vehicle) -> Callable[..., mujoco.MjModel]:
    """Return a copy of the vehicle's model with some force-law numbers replaced."""

    def alter(**changes: float) -> mujoco.MjModel:
        model = copy.copy(jr700.model)
        numbers = model.actuator_user[addresses(model).rotor]
        for slot, value in changes.items():
            numbers[getattr(PARAM, slot)] = value
        return model

    return alter
