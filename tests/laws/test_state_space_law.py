"""A control law as matrices: what it does at its ticks."""

import math

import numpy as np
import pytest

import helisim as hs
from small_laws import INPUTS, random_law


def test_compiled_law_is_its_matrices_within_limits_and_cuts_off_beyond(jr700):
    """At each tick the commands are C x + D seen about the trim, and the state follows."""
    vehicle = jr700
    law = random_law()
    controller = law.on(vehicle)
    settings, trim = np.asarray(controller.settings), vehicle.trim
    call = controller.law
    rng = np.random.default_rng(2)
    state, x = np.zeros(len(law.a)), np.zeros(len(law.a))
    steady = hs.Seen(*([0.0] * 18))._replace(phi=trim.phi, theta=trim.theta)
    middle = np.array([trim.col, trim.lon, trim.lat, trim.ped])
    cut = 0
    for size in (1e-3, 1e-2, 10.0, 1.0, 1e-3):
        off = dict(zip(INPUTS, size * rng.standard_normal(5)))
        seen = steady._replace(**{name: getattr(steady, name) + by for name, by in off.items()})
        y = np.array([*off.values()])
        y[2] = math.remainder(y[2], 2.0 * math.pi)  # of a heading
        front, left, right, tail = call(seen, state, settings)
        given = np.array([*vehicle.swashplate.unmix(front, left, right), tail])
        whole = middle + law.c @ x + law.d @ y
        assert given == pytest.approx(np.clip(whole, -0.5, 0.5), abs=1e-12)
        cut += bool(np.any(np.abs(whole) > 0.5))
        x = law.a @ x + law.b @ y + law.windup @ (np.clip(whole, -0.5, 0.5) - whole)
        assert state == pytest.approx(x, abs=1e-12)
    assert 0 < cut < 5
