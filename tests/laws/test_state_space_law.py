"""A control law as matrices: what it does at its ticks."""

import math
from dataclasses import replace

import numpy as np
import pytest
from small_laws import INPUTS, random_law

import helisim as hs
from helisim.design.lqg import LqgWeights, Tracked, lqg
from helisim.vehicle.law import linearize_law


def test_compiled_law_is_its_matrices_within_limits_and_cuts_off_beyond(jr700):
    """At each tick the commands are C x + D seen about the trim, and the state follows."""
    vehicle = jr700
    law = random_law()
    controller = law.on(vehicle)
    settings, trim = np.asarray(controller.settings), vehicle.trim
    call = controller.law
    rng = np.random.default_rng(2)
    state, x = np.zeros(law.order), np.zeros(law.order)
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


def without_speeds(vehicle: hs.Vehicle, *, period: float = 0.002):
    """The exact base helicopter without speeds and positions, sampled: for designs in tests."""
    base = vehicle.linearize("IN1")
    speeds = ("u", "v", "w", "psi", "north", "east", "down")
    kept = base.reordered([name for name in base.states if name not in speeds])
    kept = kept.select(("lon", "lat", "ped"), ("p", "q", "r", "phi", "theta"))
    return replace(kept, delays={}).discretise(period)


TRACKED = (
    Tracked(output="theta", stick="LON", gain=0.6, frequency=8.0),
    Tracked(output="phi", stick="LAT", gain=0.6, frequency=8.0),
    Tracked(output="r", stick="PED", gain=3.0, frequency=8.0, error=0.3),
)
WEIGHTS = LqgWeights(output={"p": 1.0, "q": 1.0})


@pytest.mark.slow
def test_lqg_on_the_jr700_is_linearised_as_it_flies(jr700):
    """The compiled law differentiated in the vehicle is its matrices; the loop is stable."""
    vehicle = jr700
    law = lqg(without_speeds(vehicle), TRACKED, WEIGHTS)
    flying = vehicle.with_controller(law.on(vehicle))
    own = law.linear(0.002)
    found = linearize_law(flying.controller, flying.model, flying.trim)
    omega = np.geomspace(0.3, 200.0, 40)
    columns = [found.input_labels.index(name) for name in own.inputs]
    seen = found(np.exp(1j * omega * 0.002))[:, columns]
    # differences of 1e-5 of numbers up to 1e2 in double precision
    assert seen == pytest.approx(own.response(omega), abs=1e-9)
    poles = np.log(flying.linearize("IN2").system.poles().astype(complex)) / 0.002
    # heading, place and the slow drift of speeds that attitudes don't stop are left
    assert np.max(poles.real) < 1e-3
