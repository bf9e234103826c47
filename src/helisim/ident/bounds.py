"""Computes how well a fit determines its parameters: Cramér-Rao bounds, insensitivities, errors.

With H the Hessian of the summed cost J (second derivatives, so 2 J_r^T J_r for residuals r):

    CR_i = 2 sqrt((H^-1)_ii)   the bound, with Tischler and Remple's factor 2 for real data
    I_i  = 1 / sqrt(H_ii)      change that raises the cost by as much with all others held

Both assume unit residual noise. J printed in a fit is the average over responses; these
figures use the sum, as Tischler and Remple's do.

Standard errors are stated from the errors of the response. With A = (J^T J)^-1 J^T of the
residuals that the fit minimised, and S the covariance that the response's errors give those
residuals (`scatter`), the parameters' covariance is

    s^2 A S A^T ,   s^2 = max(1, r^T r / E[r^T r]) .

So neighbouring frequencies that share windows do not count twice. s^2 is the residual scaling:
what the fit left over, relative to what noise would leave; it grows where the structure
does not fit. Where S is not known, residuals are taken as independent with the variance that
the fit left over.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.ident.cost import Cost

_NULL = 1e-13
"""A direction of the scaled Hessian with a smaller eigenvalue is not seen in the data."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Accuracy of the free parameters, in their units.

    Attributes:
        cramer_rao: (n_free,) CR_i; infinite where the data do not see the parameter.
        insensitivity: (n_free,) I_i.
        standard_error: (n_free,) residual-scaled standard error.
        correlation: (n_free, n_free).
    """

    cramer_rao: NDArray[np.float64]
    insensitivity: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    correlation: NDArray[np.float64]


def accuracy(cost: Cost, x: NDArray[np.float64], *, standardised: bool = False) -> Accuracy:
    """Return the accuracy of a fit that ended at x.

    Args:
        cost: the fit's cost.
        x: (n_free,) the free parameters.
        standardised: the fit minimised standardised residuals instead of J.
    """
    jacobian = cost.log_jacobian(x)
    residual = cost.log(x, unwrap=False)
    hessian = gauss_newton_hessian(jacobian)
    inverse, seen = _inverse(hessian)
    variance = np.diagonal(inverse)
    freedom = max(residual.size - x.size, 1)
    noise = float(residual @ residual) / freedom
    plain = np.sqrt(2.0 * noise * variance)
    stated = _stated(cost, x, standardised)
    with np.errstate(divide="ignore"):
        insensitivity = 1.0 / np.sqrt(np.diagonal(hessian))
    unseen = np.where(seen, 0.0, np.inf)
    root = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    correlation = inverse / root[:, None] / root[None, :]
    np.fill_diagonal(correlation, 1.0)
    return Accuracy(
        cramer_rao=2.0 * np.sqrt(variance) + unseen,
        insensitivity=insensitivity,
        standard_error=(plain if stated is None else stated) + unseen,
        correlation=np.clip(correlation, -1.0, 1.0),
    )


def _stated(cost: Cost, x: NDArray[np.float64], standardised: bool) -> NDArray[np.float64] | None:
    """Return standard errors from the response's own errors, None where they are not known."""
    relative = cost.points.covariance
    if relative is None or x.size == 0:
        return None
    covariance = 0.5 * np.block([[relative.real, -relative.imag], [relative.imag, relative.real]])
    if standardised:
        residual, jacobian = cost.standardised(x), cost.standardised_jacobian(x)
        scale = np.tile(1.0 / cost.spread, 2)
    else:
        residual, jacobian = cost.log(x, unwrap=False), cost.log_jacobian(x)
        scale = cost.log_scale()
    covariance *= np.outer(scale, scale)
    gain = np.linalg.pinv(jacobian)
    spread = gain @ covariance @ gain.T
    # E[r^T r] = tr[(1 - J A) S], as the projection is symmetric and idempotent.
    expected = float(np.trace(covariance) - np.trace(gain @ covariance @ jacobian))
    if expected <= 0.0:
        return None
    scaling = max(1.0, float(residual @ residual) / expected)
    return np.sqrt(scaling * np.maximum(np.diagonal(spread), 0.0))


def gauss_newton_hessian(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Hessian of J = sum r^2 without the residuals' curvature, (n_free, n_free).

    Args:
        jacobian: (n_residual, n_free) of the residuals r.
    """
    return 2.0 * jacobian.T @ jacobian


def _inverse(
    hessian: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the (pseudo-)inverse and which parameters are seen, scaled to a unit diagonal."""
    if hessian.size == 0:
        return hessian, np.ones(0, dtype=np.bool_)
    diagonal = np.sqrt(np.diagonal(hessian))
    scale = np.where(diagonal > 0.0, diagonal, 1.0)
    eigenvalue, vector = np.linalg.eigh(hessian / scale[:, None] / scale[None, :])
    null = eigenvalue < _NULL * max(float(eigenvalue[-1]), 1.0)
    seen = np.sum(vector[:, null] ** 2, axis=1) < 1e-6
    inverse = (vector[:, ~null] / eigenvalue[~null]) @ vector[:, ~null].T
    return inverse / scale[:, None] / scale[None, :], seen
