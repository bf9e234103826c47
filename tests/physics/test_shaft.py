"""A shaft that leans, and a fin in the tail rotor's slipstream."""

import math

import numpy as np
import pytest

from helisim.physics.layout import PARAM
from helisim.physics.motion import Velocities, Wrench, from_shaft, to_shaft
from helisim.physics.rotor import TailRotor, tail_wrench

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


def test_a_fin_takes_its_share_of_the_tail_rotors_thrust(par):
    tail = TailRotor(10.0, 0.05, 0.0, 0.0, 0.0, 0.0)
    free = tail_wrench(par, tail)
    par[PARAM.tail_blockage] = 0.2
    blocked = tail_wrench(par, tail)
    assert blocked.fy == pytest.approx(0.8 * free.fy, rel=1e-15)
    assert blocked.mz == pytest.approx(0.8 * free.mz, rel=1e-15)
