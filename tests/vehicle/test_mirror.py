"""A vehicle seen in a mirror flies the mirror image of every flight: physics knows no hand."""

import numpy as np
import pytest

from helisim.records.record import IN1, IN2, POSITIONS, RATES, SERVOS
from helisim.sim import FlightPlan, Pilot, Recorder, Weather, fly
from helisim.sim.excitation import Excitation
from helisim.vehicle import Vehicle, load
from helisim.vehicle.assembly import assemble
from helisim.vehicle.parameters import model_folder
from helisim.vehicle.trim import find_trim
from mirror import mirrored, mirrored_parts

ROUNDING = 1e-11
"""Of some 10 m, m/s and rad: a sum in another order, in a flight that is stable."""
ASKEW = {
    "swashplate.front_angle": 0.2,
    "swashplate.left_angle": 1.9,
    "swashplate.right_angle": -2.3,
    "swashplate.left_arm": 1.1,
    "swashplate.right_sign": -1.0,
    "drive.governor": "motor",
}
"""A swashplate that is not its own mirror image, and a motor that turns the rotor."""


@pytest.fixture(scope="module", params=["as shipped", "askew"])
def pair(request):
    """A vehicle and its mirror image, as shipped, and with mass and swashplate off the middle."""
    askew = request.param == "askew"
    own = load("jr700", parameters=ASKEW).parameters if askew else load("jr700").parameters
    models = assemble("jr700", own), assemble("jr700", mirrored(own))
    if askew:
        for model in models:
            model.body_ipos[:, 1] += 0.003
    mirrored_parts(models[1])
    each = zip((own, mirrored(own)), models)
    return tuple(
        Vehicle(model_folder("jr700"), values, model, find_trim(model)) for values, model in each
    )


class MirroredWeave(Excitation):
    """Sines on all sticks; the mirrored pilot moves two of them the other way."""

    def sticks(self, time):
        hand = 1.0 if self.axis == "lat" else -1.0
        waves = [0.02 * np.sin(time), 0.05 * np.sin(3.0 * time), 0.05 * np.cos(2.0 * time)]
        waves[2] *= hand
        return np.column_stack([*waves, 0.03 * hand * np.sin(4.0 * time)])


ODD = {"LAT", "PED", "lat", "ped", "p", "r", "phi", "psi", "v", "ay", "east"}
ODD |= {"b", "air_v", "air_p", "air_r"}
SWAPPED = {"left": "right", "right": "left"}


def test_a_recorded_flight_is_the_mirror_image(pair):
    """Pilot, gyro, servos and recorder: every channel, or its namesake on the other side."""
    records = [
        fly(
            vehicle,
            FlightPlan(
                excitation=MirroredWeave(axis=axis, duration=6.0),
                pilot=Pilot(remnant=0.0),
                weather=Weather(wind=2.2, wind_from=hand),
                recorder=Recorder(latency=None, noise={}, resolution={}, rotor=True),
            ),
            jobs=1,
        )[0]
        for vehicle, hand, axis in zip(pair, (1.0, -1.0), ("lat", "ped"))
    ]
    assert set(records[0].names) >= {*IN1, *IN2, *SERVOS, *RATES, *POSITIONS}
    for name in records[0].names:
        namesake = "_".join(SWAPPED.get(part, part) for part in name.split("_"))
        sign = -1.0 if name in ODD or name.startswith("servo_tail") else 1.0
        there = sign * records[1][namesake]
        scale = max(1.0, np.abs(there).max())
        assert records[0][name] / scale == pytest.approx(there / scale, abs=ROUNDING), name
