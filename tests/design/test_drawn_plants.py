from dataclasses import replace

import numpy as np
import pytest

from helisim import ident
from helisim.base.errors import InputError
from helisim.design.plant import sample_parameters

OMEGA = np.geomspace(1.0, 40.0, 60)


@pytest.fixture(scope="module")
def fit():
    """A fit of two parameters, given a third with an error, with a covariance of the test's."""
    structure = ident.structures.yaw_base.with_fixed({"tau_r_base": 0.05}, {"tau_r_base": 0.002})
    response = 40.0 / (1j * OMEGA + 1.2) * np.exp(-0.05j * OMEGA)
    exact = ident.FrequencyResponse.exact(
        OMEGA, response[None, None], inputs=["ped"], outputs=["r"]
    )
    carried = np.array([[0.03], [-0.5]])
    own = np.array([[0.01, 0.06], [0.06, 4.0]])
    found = ident.identify(exact, structure)
    return replace(found, carried=carried, covariance=own + carried @ carried.T)


def test_drawn_parameters_scatter_as_the_covariance_says(fit):
    """5000 draws: a variance is then known to 2 % of itself, one standard deviation."""
    rng = np.random.default_rng(1)
    drawn = np.array([list(sample_parameters([fit], rng)[0].values()) for _ in range(5_000)])
    found = np.cov(drawn.T)
    errors = np.append(np.sqrt(np.diagonal(fit.covariance)), 0.002)
    whole = np.block([[fit.covariance, fit.carried * 0.002], [fit.carried.T * 0.002, 4e-6]])
    np.testing.assert_allclose(
        found / np.outer(errors, errors), whole / np.outer(errors, errors), atol=0.07
    )
    np.testing.assert_allclose(drawn.mean(axis=0), list(fit.values.values()), atol=0.1, rtol=2e-3)


def test_fits_that_share_a_known_value_share_its_error(fit):
    one, other = sample_parameters([fit, fit], np.random.default_rng(2))
    assert one["tau_r_base"] == other["tau_r_base"] != 0.05
    assert one["N_ped"] != other["N_ped"]


def test_a_fit_without_covariance_is_refused(fit):
    with pytest.raises(InputError, match="'yaw_base' doesn't state its covariance"):
        sample_parameters([replace(fit, covariance=None)], np.random.default_rng(1))


def test_a_parameter_that_the_data_do_not_see_is_refused(fit):
    unseen = np.diag([np.inf, 1.0])
    with pytest.raises(InputError, match="don't see N_r"):
        sample_parameters([replace(fit, covariance=unseen)], np.random.default_rng(1))
