"""Computes how well a fit determines its parameters: Cramér-Rao bounds, insensitivities, errors.

With H the Hessian of the summed cost J (second derivatives, so 2 J_r^T J_r for residuals r):

    CR_i = 2 sqrt((H^-1)_ii)   the bound, with Tischler and Remple's factor 2 for real data
    I_i  = 1 / sqrt(H_ii)      change that raises the cost by as much with all others held

Both assume unit residual noise. J printed in a fit is the average over responses; these
figures use the sum, as Tischler and Remple's do.

Standard errors are stated from the errors of the response. With A = (J^T J)^-1 J^T of the
residuals that the fit minimised, and S the covariance that the response's errors give those
residuals (`scatter`), the parameters' covariance is

    A S A^T .

So neighbouring frequencies that share windows do not count twice. What a structure can't follow
is not in it: that is the same in every record, so a fit says it apart (`Misfit`), by the ratio

    s^2 = r^T r / E[r^T r]

of what was left to what noise leaves. Where S is not known, residuals are taken as independent
with the variance that the fit left over.

Known parameters that have an error, such as a servo's from a bench, add what it makes of the
others: a change dk of a known one moves the minimum by -A J_k dk, with J_k the residuals'
derivatives by it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.ident.cost import Cost

_NULL = 1e-13
"""A direction of the scaled Hessian with a smaller eigenvalue is not seen in the data."""
_FAINT = 1e-6
"""A parameter whose change by its own size moves all residuals by less, in dB, is not seen: what
is left of its derivative is rounding, whose errors would be anything."""
_FARTHEST = 1e9
"""A size is believed up to so many times the order of magnitude that the structure states: far
enough for coefficients of high order; one that only rounding sees runs to 1e16."""

Real = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Accuracy of the free parameters, in their units.

    Attributes:
        cramer_rao: (n_free,) CR_i; infinite where the data do not see the parameter.
        insensitivity: (n_free,) I_i.
        covariance: (n_free, n_free) of the parameters' errors, whose diagonal is the squared
            standard errors; infinite there where the data do not see the parameter.
        carried: (n_free, n_known) by how much a parameter errs for one standard error of each
            known one that has any.
        correlation: (n_free, n_free), from the Hessian, as CIFER's.
        noise: (2 n_point,) variances of the relative errors, real then imaginary parts, that
            noise leaves after the fit; None where the response's errors are not known.
        ratio: the residuals' power over what noise would leave; None likewise.
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
        """(n_free,) standard deviations to expect of the parameters."""
        return np.sqrt(np.diagonal(self.covariance))


def accuracy(cost: Cost, x: Real, *, standardised: bool = False) -> Accuracy:
    """Return the accuracy of a fit that ended at x.

    Args:
        cost: the fit's cost.
        x: (n_free,) the free parameters.
        standardised: the fit minimised standardised residuals instead of J.
    """
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
    # the pseudo-inverse, (n_free, n_residual), whatever units the parameters have
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
    """Return what the response's own errors make of the parameters and leave in the residuals.

    The parameters' covariance, `noise` and `ratio` of an `Accuracy`; None where the errors are not
    known.
    """
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
    """Return the Hessian of J = sum r^2 without the residuals' curvature, (n_free, n_free).

    Args:
        jacobian: (n_residual, n_free) of the residuals r.
    """
    return 2.0 * jacobian.T @ jacobian


def _inverse(hessian: Real) -> tuple[Real, NDArray[np.bool_]]:
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
