"""A shaft that leans, and a fin in the tail rotor's slipstream."""

import math

import numpy as np
import pytest

from helisim.physics.layout import PARAM
from helisim.physics.motion import Velocities, Wrench, from_shaft, to_shaft
from helisim.physics.rotor import TailRotor, tail_wrench
from helisim.vehicle import load

LEAN = 0.1


def matrix(angle):
    """Columns are the shaft's axes in the body's: nose down turns z ahead."""
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])


def test_a_leaning_shaft_turns_velocities_and_forces(par):
    par[[PARAM.shaft_cosine, PARAM.shaft_sine]] = math.cos(LEAN), math.sin(LEAN)
    moving = to_shaft(par, Velocities(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    turn = matrix(LEAN).T
    assert moving[:3] == pytest.approx(turn @ [1.0, 2.0, 3.0], rel=1e-15)
    assert moving[3:] == pytest.approx(turn @ [4.0, 5.0, 6.0], rel=1e-15)
    loads = from_shaft(par, Wrench(*moving))
    assert tuple(loads) == pytest.approx((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), rel=1e-15)


def test_thrust_of_a_shaft_that_leans_ahead_pulls_ahead(par):
    par[[PARAM.shaft_cosine, PARAM.shaft_sine]] = math.cos(LEAN), math.sin(LEAN)
    loads = from_shaft(par, Wrench(0.0, 0.0, -1.0, 0.0, 0.0, 0.0))
    assert loads.fx == pytest.approx(math.sin(LEAN), rel=1e-15)


def test_a_helicopter_hovers_as_far_nose_up_as_its_shaft_leans():
    """Drag areas aside, the hover is that of a straight shaft, seen from a body that is pitched.

    A hub above the centre of gravity along the shaft is needed for that.
    """
    straight = load("jr700", parameters={"airframe.download": 0.0}).trim
    vehicle = load("jr700")
    height = vehicle.parameters["main_rotor.hub_z"]
    leaning = load(
        "jr700",
        parameters={
            "main_rotor.shaft_tilt": 0.03,
            "main_rotor.hub_x": -height * math.sin(0.03),
            "main_rotor.hub_z": height * math.cos(0.03),
            "airframe.download": 0.0,
        },
    ).trim
    assert leaning.theta - straight.theta == pytest.approx(0.03, abs=1e-4)
    assert leaning.col == pytest.approx(straight.col, abs=2e-3)


def test_a_fin_takes_its_share_of_the_tail_rotors_thrust(par):
    tail = TailRotor(10.0, 0.05, 0.0, 0.0, 0.0, 0.0)
    free = tail_wrench(par, tail)
    par[PARAM.tail_blockage] = 0.2
    blocked = tail_wrench(par, tail)
    assert blocked.fy == pytest.approx(0.8 * free.fy, rel=1e-15)
    assert blocked.mz == pytest.approx(0.8 * free.mz, rel=1e-15)
