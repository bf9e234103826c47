"""The rate command law: the vehicles' own gyros as data."""

import numpy as np
import pytest
from small_laws import HOLDS

import helisim as hs
from helisim.base.errors import InputError
from helisim.design.laws.law import law_of
from helisim.physics.laws import Called

OMEGA = np.geomspace(0.2, 150.0, 60)


@pytest.mark.parametrize("name", ["jr700", "lynx", "blade360"])
def test_flies_as_the_gyro_that_it_is_of(name):
    """To the last bit, after its file was written and read, at its stops too."""
    vehicle = hs.load(name)
    law = law_of(hs.RateCommand.of(vehicle).to_dict())
    plan = hs.Step(axis="lat", amplitude=0.3, duration=8.0)
    (own,) = hs.fly(vehicle, plan, seed=1, keep_ended=True)
    (written,) = hs.fly(vehicle, plan, seed=1, controller=law, keep_ended=True)
    np.testing.assert_array_equal(written.values, own.values)


def test_linear_form_is_the_gyro_s(jr700):
    """Against the shipped laws differentiated; central differences of 1e-5 leave 1e-10."""
    system = jr700.gyro.system
    a, b, c, d = (np.asarray(getattr(system, name)) for name in "ABCD")
    z = np.exp(1j * OMEGA * system.dt)[:, None, None]
    flown = np.moveaxis(c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d, 0, -1)
    linear = hs.RateCommand.of(jr700).linear(system.dt)
    order = [system.input_labels.index(name) for name in linear.inputs]
    np.testing.assert_allclose(linear.response(OMEGA), flown[:, order], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("law", [hs.RateCommand.of, lambda _: HOLDS])
def test_starts_where_the_servos_stand(jr700, law):
    """As after a gyro's restart: without a rate or a stick no servo moves, wherever it stands."""
    (flown,) = law(jr700).on(jr700).laws
    servos = (0.03, -0.08, 0.05, 0.11)  # of no collective, which is the stick's
    at_rest = hs.Seen(*np.zeros(len(hs.Seen._fields)).tolist())
    seen = at_rest._replace(phi=jr700.trim.phi, theta=jr700.trim.theta, az=-9.8)
    seen = seen._replace(**dict(zip(("front", "left", "right", "tail"), servos)))
    called, state = Called(flown), np.zeros(flown.states)
    called.start(seen, state)
    np.testing.assert_allclose(called(seen, state), servos, rtol=0.0, atol=1e-15)


def test_what_it_can_t_have_is_said(jr700):
    data = hs.RateCommand.of(jr700).to_dict()
    with pytest.raises(InputError, match="anti_windup must be true or false, got 1"):
        law_of({**data, "anti_windup": 1})
    with pytest.raises(InputError, match=r"ped\.k_i must be a number 1e-09 or more .*, got 0"):
        law_of({**data, "ped": {**data["ped"], "k_i": 0.0}})
