"""Accuracy of a fit's parameters: Cramér-Rao bounds, insensitivities, standard errors.

With H = 2 J^T J and unit noise, CR_i = 2 sqrt((H^-1)_ii), I_i = 1 / sqrt(H_ii) (Tischler, Remple).
With A = (J^T J)^-1 J^T of residuals r with covariance S (`scatter`; unknown: independent), the
parameters' covariance is A S A^T without misfit (`Misfit`); a known one's error dk adds -A J_k dk.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.ident.cost import Cost

_NULL = 1e-13  # least eigenvalue of the scaled Hessian for a direction to be seen
_FAINT = 1e-6  # dB: a parameter that moves all residuals by less is not seen
_FARTHEST = 1e9  # largest value, in its orders of magnitude, for a parameter to be seen
Real = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Accuracy of the free parameters, in their units; infinite for unseen ones.

    `cramer_rao` and `insensitivity` are (n_free,), `covariance` and `correlation` (the Hessian's)
    (n_free, n_free), `carried` (n_free, n_known) for one standard error of each known parameter.
    `noise` (2 n_point,) are expected variances, real then imaginary parts, `ratio` the residuals'
    power over the expected; None if the response's errors are unknown.
    """

    cramer_rao: Real
    insensitivity: Real
    covariance: Real
    carried: Real
    correlation: Real
    noise: Real | None = None
    ratio: float | None = None

    @property
    def standard_error(self) -> Real:
        """Standard deviations of the parameters, (n_free,)."""
        return np.sqrt(np.diagonal(self.covariance))


def accuracy(cost: Cost, x: Real, *, standardised: bool = False) -> Accuracy:
    """Return the accuracy of a fit at x, (n_free,), by either kind of residual."""
    jacobian = cost.log_jacobian(x)
    magnitude = np.array([one.magnitude for one in cost.structure.free], dtype=np.float64)
    size = np.clip(np.abs(x), magnitude, _FARTHEST * magnitude)
    clear = np.linalg.norm(jacobian, axis=0) * size > _FAINT
    jacobian = jacobian * clear
    residual = cost.log(x, unwrap=False)
    hessian = gauss_newton_hessian(jacobian)
    inverse, seen = _inverse(hessian)
    variance = np.diagonal(inverse)
    minimised, scale, left = jacobian, cost.log_scale(), residual
    if standardised:
        minimised, scale = cost.standardised_jacobian(x) * clear, np.tile(1.0 / cost.spread, 2)
        left = cost.standardised(x)
    # the pseudo-inverse, (n_free, n_residual), scaled for the parameters' units
    length = np.linalg.norm(minimised, axis=0)
    unit = np.where(length > 0.0, length, 1.0)
    gain = np.linalg.pinv(minimised / unit) / unit[:, None]
    spread = _spread(cost, left, minimised, scale, gain)
    if spread is None:
        freedom = max(residual.size - x.size, 1)
        spread = 2.0 * float(residual @ residual) / freedom * inverse, None, None
    covariance, noise, ratio = spread
    known = [one for one in cost.structure.parameters if one.error > 0.0]
    carried = np.zeros((x.size, len(known)))
    if known and x.size:
        by_known = cost.jacobian_by(x, [one.name for one in known], standardised=standardised)
        carried = -(gain @ by_known) * [one.error for one in known]
    covariance = covariance + carried @ carried.T
    np.fill_diagonal(covariance, np.where(seen, np.maximum(np.diagonal(covariance), 0.0), np.inf))
    with np.errstate(divide="ignore"):
        insensitivity = 1.0 / np.sqrt(np.diagonal(hessian))
    root = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    correlation = inverse / root[:, None] / root[None, :]
    np.fill_diagonal(correlation, 1.0)
    bound = 2.0 * np.sqrt(variance) + np.where(seen, 0.0, np.inf)
    correlation = np.clip(correlation, -1.0, 1.0)
    return Accuracy(bound, insensitivity, covariance, carried, correlation, noise, ratio)


def _spread(
    cost: Cost, residual: Real, jacobian: Real, scale: Real, gain: Real
) -> tuple[Real, Real, float] | None:
    relative = cost.points.covariance
    if relative is None:
        return None
    covariance = 0.5 * np.block([[relative.real, -relative.imag], [relative.imag, relative.real]])
    covariance *= np.outer(scale, scale)
    taken = gain @ covariance
    left = covariance - jacobian @ taken
    # of (1 - J A) S (1 - J A)^T, as the projection is symmetric and idempotent
    noise = np.diagonal(left) - np.einsum("ij,ij->i", left @ gain.T, jacobian)
    expected = float(np.sum(noise))
    if expected <= 0.0:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        plain = np.where(scale > 0.0, noise / scale**2, 0.0)
    return taken @ gain.T, plain, float(residual @ residual) / expected


def gauss_newton_hessian(jacobian: Real) -> Real:
    """Return the Hessian of sum r^2 without curvature for a Jacobian (n_residual, n_free)."""
    return 2.0 * jacobian.T @ jacobian


def _inverse(hessian: Real) -> tuple[Real, NDArray[np.bool_]]:
    if hessian.size == 0:
        return hessian, np.ones(0, dtype=np.bool_)
    diagonal = np.sqrt(np.diagonal(hessian))
    scale = np.where(diagonal > 0.0, diagonal, 1.0)
    eigenvalue, vector = np.linalg.eigh(hessian / scale[:, None] / scale[None, :])
    null = eigenvalue < _NULL
    seen = np.sum(vector[:, null] ** 2, axis=1) < 1e-6
    inverse = (vector[:, ~null] / eigenvalue[~null]) @ vector[:, ~null].T
    return inverse / scale[:, None] / scale[None, :], seen
