"""Energy: what the motor gives, and what height and speed give, is what the air gets.

Momentum theory, blade elements, blade drag, surfaces and fuselage each say on their own what force
they make and what they lose; shaft torque comes from a third place. Only where they agree does a
flight's energy balance: kinetic and potential energy of the body, taken from MuJoCo's sensors, and
that of the turning rotor, against the work of the motor and the wind less the heat.
"""

import numpy as np
import pytest
from energy import FLIGHTS, flown

import helisim as hs

BALANCED = 1e-3
"""Of the energy turned over. Not counted are the springs of the hub (0.1 J at 3 degrees of tilt),
the tilting of the disc (0.02 J at 1 rad/s) and the turning of thrust and torque with it: a joule of
a thousand and more."""


@pytest.fixture(scope="module")
def motor():
    """The JR700 with its electric motor."""
    return hs.load("jr700", parameters={"drive.governor": "motor"})


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_s_energy_balances(motor, name):
    """At every instant of a whole flight, from take-off to landing, with and without an engine.

    The legs of a hard landing take what they take: the energy of its sinking, and no more than a
    hundredth of what is turned over.
    """
    found, end = flown(motor, name)
    assert np.abs(found.missing[:end]).max() < BALANCED * found.turned_over, str(found)
    assert found.turned_over > 1000.0
    assert np.all(np.diff(found.lost) > 0.0)  # the air never gives heat back
    taken = found.missing[end - 1] - found.missing[-1]
    assert -1.0 < taken < 0.02 * found.turned_over


def test_an_ideal_governor_s_energy_balances(jr700):
    """What it delivers is what the shafts take."""
    found, _ = flown(jr700, "forward")
    assert np.abs(found.missing).max() < BALANCED * found.turned_over, str(found)


def test_an_autorotation_lives_on_height(motor):
    """Height and the rotor's speed pay for all of it; the motor has taken no part since its cut."""
    found, _ = flown(motor, "autorotation, 30 m and 0 m/s")
    height = found.potential[0] - found.potential[-1]
    assert height == pytest.approx(8.01 * 9.8015 * 30.0, rel=0.05)  # to the landing gear's height
    assert found.delivered[-1] < 0.45 * found.turned_over  # the second before the cut, 900 J
    assert found.spin[-1] < found.spin[0]
