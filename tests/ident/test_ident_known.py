"""Known parameters with an error, what a structure leaves beyond noise, and the covariance."""

import math
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import FrequencyResponse, Parameter, Structure, identify
from helisim.ident.bounds import accuracy
from helisim.ident.cost import Cost, select
from helisim.ident.structures import yaw_base

GRID = np.geomspace(0.5, 20.0, 30)
S = 1j * GRID
BEHIND_SERVO = Structure(
    name="behind_servo",
    parameters=(
        Parameter("N_r", "1/s", -1.0),
        Parameter("N_ped", "1/s^2", 10.0),
        Parameter("lag", "s", 0.05, fixed=True, error=0.01),
    ),
    states=("r", "behind"),
    inputs=("ped",),
    outputs=("r",),
    F=(("N_r", "N_ped"), ("0", "-1")),
    G=(("0",), ("1",)),
    M=(("1", "0"), ("0", "lag")),
)


def data(response):
    return FrequencyResponse.exact(GRID, response[None, None], inputs=("ped",), outputs=("r",))


WOBBLE = np.exp(0.01 * np.random.default_rng(2).normal(size=(GRID.size, 2)) @ [1.0, 1j])
MEASURED = data(50.0 / (S + 0.7) / (1.0 + 0.05 * S) * WOBBLE)


def test_what_a_known_error_makes_of_the_others_is_what_fits_with_other_values_find():
    """Fitted again with the lag a hundredth of its error up and down, the others move so."""
    found = identify(MEASURED, BEHIND_SERVO)
    exact = identify(MEASURED, BEHIND_SERVO.with_fixed({"lag": 0.05}))
    added = found.covariance - exact.covariance
    step = 1e-4
    ends = [
        identify(MEASURED, BEHIND_SERVO.with_fixed({"lag": 0.05 + sign * step})).values
        for sign in (1.0, -1.0)
    ]
    names = [one.name for one in BEHIND_SERVO.free]
    slope = np.array([(ends[0][name] - ends[1][name]) / (2.0 * step) for name in names])
    # residuals of 1 % bend the cost by as much, which Gauss and Newton's derivative leaves out
    assert added == pytest.approx(0.01**2 * np.outer(slope, slope), rel=0.02)
    assert found["lag"].standard_error == 0.01
    assert found["lag"].interval == pytest.approx((0.05 - 0.0196, 0.05 + 0.0196))


def test_the_errors_are_the_covariance_s_and_the_bound_is_the_larger():
    """Standard errors squared are its diagonal; three of them count where they exceed CR."""
    found = identify(MEASURED, BEHIND_SERVO)
    errors = [found[one.name].standard_error for one in BEHIND_SERVO.free]
    assert np.diagonal(found.covariance) == pytest.approx(np.square(errors), rel=1e-12)
    assert not found.covariance.flags.writeable
    one = found["N_ped"]
    assert replace(one, cramer_rao=1.0, standard_error=0.5).bound == 1.5
    assert replace(one, cramer_rao=2.0, standard_error=0.5).bound == 2.0


def test_an_error_is_of_a_fixed_parameter():
    """A free one's is found, not given; one is 0 or more; each has its parameter."""
    with pytest.raises(InputError, match=r"'lag' has error 0.1 but is free"):
        Parameter("lag", "s", 0.05, error=0.1)
    with pytest.raises(InputError, match=r"error must be a number 0 or more, got -1.0"):
        Parameter("lag", "s", 0.05, fixed=True, error=-1.0)
    with pytest.raises(UnknownNameError, match=r"fixed parameter with an error 'N_r'"):
        BEHIND_SERVO.with_fixed({"lag": 0.05}, {"N_r": 0.1})
    again = Structure.from_dict(BEHIND_SERVO.to_dict())
    assert again.parameter("lag").error == 0.01


def test_the_misfit_is_what_the_structure_cannot_follow():
    """A first order fitted to itself times a ripple of 2 % leaves that ripple's rms."""
    ripple = 1.0 + 0.02 * np.sqrt(2.0) * np.cos(2.0 * np.pi * np.arange(GRID.size) / 2.5)
    found = identify(data(50.0 / (S + 0.7) * ripple), yaw_base, frequencies_per_response=30)
    decibel = 20.0 / math.log(10.0)
    # the ripple's own nonlinearity in dB, and the little that three parameters take from it
    assert found.misfit.magnitude["r/ped"] == pytest.approx(0.02 * decibel, rel=0.05)
    assert found.misfit.percent["r/ped"] == pytest.approx(2.0, rel=0.05)
    # a tenth of a ripple of 1.15 deg: the delay takes what it can of the uneven ends
    assert found.misfit.phase["r/ped"] < 0.1
    assert found.misfit.ratio is None
    assert "dB, " in str(found)


def test_beyond_noise_nothing_is_left_where_the_structure_is_right():
    """Residuals drawn from the errors' covariance: the ratio is 1, the misfit far below them."""
    spread = 0.02
    rng = np.random.default_rng(8)
    ratios, squares = [], []
    for _ in range(60):
        drawn = np.exp(spread * rng.normal(size=(GRID.size, 2)) @ [1.0, 1j])
        measured = data(50.0 / (S + 0.7) / (1.0 + 0.05 * S) * drawn)
        own = replace(
            select(measured, BEHIND_SERVO, band=None, responses=None, count=30),
            covariance=2.0 * spread**2 * np.eye(GRID.size, dtype=complex),
        )
        cost = Cost(BEHIND_SERVO, own)
        fit = identify(measured, BEHIND_SERVO, searches=1)
        x = np.array([fit.values[one.name] for one in BEHIND_SERVO.free])
        quality = accuracy(cost, x)
        ratios.append(quality.ratio)
        squares.append(np.sum(quality.noise) / own.measured.size)
    # 60 ratios of 58 squares each: their mean scatters by sqrt(2 / 58 / 60), 2.4 %
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.08)
    # 60 residuals and 2 parameters: 58 of 60 parts of the noise are left
    assert np.mean(squares) == pytest.approx(2.0 * spread**2 * 58.0 / 60.0, rel=0.02)
