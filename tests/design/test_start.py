"""The law that a design starts from inverts the model, and no loop is open to instability."""

import numpy as np
import pytest
from small_design import SmallPlant

from helisim.base.errors import InputError
from helisim.design.start import attitude_start


class Helicopter:
    """Roll and pitch of a rotor that is turned, and yaw: rates over commands, first order."""

    inputs = ("lon", "lat", "ped")
    outputs = ("p", "q", "r", "phi", "theta", "psi")

    def __init__(self, angle: float):
        self.angle = angle

    def response(self, frequency):
        s = 1j * np.asarray(frequency)
        roll, pitch, yaw = 90.0 / (s + 10.0), 40.0 / (s + 5.0), 80.0 / (s + 0.5)
        cosine, sine, none = np.cos(self.angle), np.sin(self.angle), np.zeros_like(s)
        # the rotor turns lat and lon back by the angle before it answers
        rates = np.array(
            [
                [sine * roll, cosine * roll, none],
                [cosine * pitch, -sine * pitch, none],
                [none, none, yaw],
            ]
        )
        return np.concatenate([rates, rates / s])


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.35])
def test_the_mix_undoes_what_the_rotor_turns_and_the_feed_forward_is_the_inverse(angle):
    """Of p over lat = 90 / (s + 10) the inverse is (s + 10) / 90, and so on."""
    law = attitude_start(Helicopter(angle), period=0.002).law
    assert law.phase == pytest.approx(-angle, abs=np.radians(0.5))  # its grid
    for axis, inverse in (("lat", (10 / 90, 1 / 90)), ("lon", (5 / 40, 1 / 40))):
        own = getattr(law, axis)
        # 1 %: the grid of angles leaves a sine of a quarter degree
        assert (own.ff_rate, own.ff_acceleration) == pytest.approx(inverse, rel=0.01)
        assert own.ff_delay == 0.0
    assert (law.ped.ff_rate, law.ped.ff_acceleration) == pytest.approx((0.5 / 80, 1 / 80))


def test_every_range_holds_its_start():
    start = attitude_start(Helicopter(0.2), period=0.002)
    own = start.law.parameters()
    assert {"lat.k_rate", "lon.k_angle", "ped.k_rate", "phase"} <= set(start.bounds)
    assert all(low <= own[name] <= high for name, (low, high) in start.bounds.items())


def test_a_model_without_yaw_is_said_so():
    with pytest.raises(InputError, match="the model lacks ped, r"):
        attitude_start(SmallPlant(), period=0.002)
