"""A law of one's own in the process's table, and in a vehicle's ticks."""

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import CallbackError, ModelError
from helisim.physics.laws import OwnLaw, is_registered, token
from helisim.vehicle import Controller


def test_a_law_is_known_until_it_is_released():
    """By handle, process and count of states; a failure is told once."""
    law = OwnLaw(lambda seen: (1.0,) * 3, "all", 2, np.zeros(1), None, "short").watched()
    assert is_registered(law.handle, token(), 2)
    for wrong in ((law.handle + 1, token(), 2), (law.handle, 0, 2), (law.handle, token(), 3)):
        assert not is_registered(*wrong)
    with pytest.raises(ModelError, match="where finite numbers for front"):
        law([0.0] * 18, np.zeros(2), starts=True)
    assert law.failure().why.startswith("returned")
    assert law.failure() is None
    law.release()
    assert not is_registered(law.handle, token(), 2)


def test_a_failed_law_leaves_the_servos_where_they_were(jr700):
    """At its third tick; the second tick's commands stay, and the block says why."""
    given = []

    def law(seen, state):
        state[0] += 1.0
        given.append(state[0])
        return [0.1 * state[0], 0.2, 0.3, np.nan if state[0] > 2.0 else 0.4]

    model = jr700.model.__copy__()
    hs.set_controller(model, Controller(law, states=1))
    data = mujoco.MjData(model)
    with pytest.raises(CallbackError, match="finite numbers"), hs.installed():
        mujoco.mj_step(model, data, 5)
    assert given == [1.0, 2.0, 3.0]
    assert np.isnan(data.sensor("servo_command").data).all()
    assert data.ctrl[4:8].tolist() == [0.2, 0.2, 0.3, 0.4]
