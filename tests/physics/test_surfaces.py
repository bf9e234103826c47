"""Fin and tailplane: lift slope, stall, flow at right angles and energy, by others' numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.physics.flow import fin, normal_force, tailplane
from helisim.physics.layout import PARAM
from helisim.physics.motion import Velocities
from helisim.vehicle import load
from helisim.vehicle.assembly import lift_slope

component = st.floats(-30.0, 30.0)
turn = st.floats(-3.0, 3.0)


def lattice_slope(aspect_ratio, along=6, across=40):
    """Return the lift slope of a flat rectangle of chord 1 by a vortex lattice, 1/rad.

    Horseshoes at a quarter of each panel, no flow through the plate at three quarters.
    """
    span = aspect_ratio
    edges = span * (np.arange(across + 1) / across - 0.5)
    left, right = edges[:-1], edges[1:]
    bound = (np.arange(along) + 0.25) / along
    x0, y1 = np.meshgrid(bound, left, indexing="ij")
    _, y2 = np.meshgrid(bound, right, indexing="ij")
    x0, y1, y2 = x0.ravel(), y1.ravel(), y2.ravel()
    x, y = x0 + 0.5 / along, 0.5 * (y1 + y2)
    dx = x[:, None] - x0
    wash = np.zeros_like(dx)
    for edge, sign in ((y1, 1.0), (y2, -1.0)):
        dy = y[:, None] - edge
        distance = np.hypot(dx, dy)
        # half-infinite trailing leg, and the bound one from its foot to this edge
        wash += sign * (1.0 + dx / distance) / dy
        wash += sign * dy / (dx * distance)
    circulation = np.linalg.solve(-wash / (4.0 * math.pi), np.ones(x.size))
    area = span
    return 2.0 * abs(np.sum(circulation * (y2 - y1))) / area


@pytest.mark.parametrize("aspect_ratio", [1.0, 2.0, 2.6, 4.0, 6.0])
def test_lift_slope_is_a_lifting_surfaces(aspect_ratio):
    """Helmbold's formula is an ellipse's; rectangles lie up to 8 % below."""
    assert lift_slope(aspect_ratio) == pytest.approx(lattice_slope(aspect_ratio), rel=0.08)


def test_lift_slope_has_both_limits():
    """Thin-aerofoil theory's 2 pi, and pi A / 2 of R. T. Jones's slender wing (NACA TR 835)."""
    assert lift_slope(1e6) == pytest.approx(2.0 * math.pi, rel=1e-5)
    assert lift_slope(1e-3) == pytest.approx(0.5 * math.pi * 1e-3, rel=1e-3)


def coefficient(angle, aspect_ratio=2.6):
    """Return the normal-force coefficient of a plate at an angle to the flow, rad."""
    square, normal = 400.0, 20.0 * math.sin(angle)
    force = normal_force(1.225, 0.01, lift_slope(aspect_ratio), 1.17, square, normal)
    return -force / (0.5 * 1.225 * 0.01 * square)


def test_flow_at_right_angles_is_hoerners_plate():
    """1.17 on a plate of aspect ratio 1 to 5 (Hoerner, Fluid-Dynamic Drag, chapter 3)."""
    assert coefficient(0.5 * math.pi) == pytest.approx(1.17, rel=0.02)  # the approach to it


def test_it_stalls_smoothly():
    """The slope is the linear one at first and rises nowhere; from 40 degrees on it is small."""
    angles = np.radians(np.arange(0.0, 90.5, 0.5))
    found = np.array([coefficient(angle) for angle in angles])
    # at 8 degrees sine and stall take 1 % each
    assert found[16] == pytest.approx(lift_slope(2.6) * angles[16], rel=0.02)
    slopes = np.diff(found) / np.diff(angles)
    assert (np.diff(slopes) < 1e-9).all()
    assert found[80] > 0.95 * found[-1]


@given(u=component, v=component, w=component, p=turn, q=turn, r=turn)
def test_surfaces_take_energy_from_every_motion(jr700, u, v, w, p, q, r):
    """Over the whole sphere of flows, and turning: lift is never driven by still air."""
    par = jr700.model.actuator_user[jr700.model.actuator("rotor").id].copy()
    par[[PARAM.tailplane_area, PARAM.tailplane_sine, PARAM.fin_sine]] = 0.01, 0.1, -0.1
    motion = Velocities(u, v, w, p, q, r)
    for surface in (fin, tailplane):
        loads = np.array(surface(par, motion, 0.0))
        size = np.abs(loads * motion).sum()
        assert np.dot(loads, motion) <= 1e-12 * size  # rounding


def test_weathercock_stiffness_is_the_fins_lift(jr700):
    """At 20 m/s: N_v of the fin is rho/2 S a V l / Izz, 0.8, as much as all the rest in hover."""
    without = load(parameters={"fin.area": 0.0})
    share = [
        one.trimmed(speed=20.0).linearize("IN1").derivative("r", "v") for one in (jr700, without)
    ]
    izz = jr700.parameters["airframe.izz"]
    expected = 0.5 * 1.225 * 0.01 * lift_slope(2.6) * 20.0 * 0.90 / izz
    # the tail rotor trims elsewhere without the fin's push
    assert share[0] - share[1] == pytest.approx(expected, rel=0.02)
    assert expected == pytest.approx(0.8, rel=0.05)
