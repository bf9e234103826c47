"""Accuracy of a fit's parameters: Cramér-Rao bounds, insensitivities, standard errors.

With H = 2 J^T J and unit noise, CR_i = 2 sqrt((H^-1)_ii), I_i = 1 / sqrt(H_ii) (Tischler, Remple).
With A = (J^T J)^-1 J^T of residuals r with covariance S (`scatter`; unknown: independent), the
parameters' covariance is A S A^T; a known one's error dk adds -A J_k dk, and a gap g between the
response and another estimate of it A g, the difference of the two fits. What the structure leaves
out is one more random error of the response, correlated by `alike` (K; Kennedy and O'Hagan, J.
Royal Statistical Society B 63, 2001), and adds s^2 A K A^T. Of s the residuals' power tells:
r^T r is tr C times a chi-square variable over its degrees of freedom, tr(C)^2 / tr(C^2) (F. E.
Satterthwaite, Biometrics 2, 1946), with C = P (S + s^2 K) P and P = 1 - J A. s^2 is its expected
value by that and by a half Cauchy beforehand (A. Gelman, Bayesian Analysis 1, 2006) whose median is
`FLOOR`, what base models leave: no more than residuals can hide where they are small, what explains
them where they are large, and about the median where they tell nothing.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.ident.cost import FLOOR, Cost
from helisim.ident.scatter import alike

_SIZES = (1e-4, 1e5, 600)  # of s over its median: first, last and number that are tried
_NULL = 1e-13  # least eigenvalue of the scaled Hessian for a direction to be seen
_FAINT = 1e-6  # dB: a parameter that moves all residuals by less is not seen
_FARTHEST = 1e9  # largest value, in its orders of magnitude, for a parameter to be seen
_TRIED = 0.5  # rad of phase that the lag that is tried makes at the band's top
_KNOWN = 0.2  # error of a parameter, over its value, from which its shift says nothing
_BEYOND_CHANCE = 3.0  # errors: chance brings so much to one input in 700


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Accuracy of the free parameters, in their units; infinite for unseen ones.

    `cramer_rao` and `insensitivity` are (n_free,), `covariance` and `correlation` (the Hessian's)
    (n_free, n_free), `carried` (n_free, n_known) for one standard error of each known parameter.
    `structural` (n_free,) standard deviations, within those of `covariance`, are of what the
    structure leaves. `noise` (2 n_point,) are expected variances, real then imaginary parts,
    `ratio` the residuals' power over the expected; None if the response's errors are unknown.
    `omitted` are inputs whose lag the structure lacks: name, s, its errors, and the largest shift
    of a parameter, as a share of it.
    """

    cramer_rao: Real
    insensitivity: Real
    covariance: Real
    carried: Real
    correlation: Real
    structural: Real
    noise: Real | None = None
    ratio: float | None = None
    omitted: tuple[tuple[str, float, float, float], ...] = ()

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
    hessian = 2.0 * jacobian.T @ jacobian  # of sum r^2, without curvature
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
    scatter = _scatter(cost, scale)
    freedom = max(residual.size - x.size, 1)
    covariance = 2.0 * float(residual @ residual) / freedom * inverse
    structural, noise, ratio, omitted = np.zeros_like(covariance), None, None, ()
    if scatter is not None and np.trace(expected := _left(scatter, minimised, gain)) > 0.0:
        noise = np.diagonal(expected) / np.maximum(scale**2, 1e-300)
        ratio = float(left @ left / np.trace(expected))
        structural = _structural(cost, left, expected, minimised, scale, gain)
        covariance = gain @ scatter @ gain.T + structural
        # each an error of its own: together they could cancel
        gaps = scale * np.hstack([cost.points.gap.real, cost.points.gap.imag])
        covariance = covariance + (moved := gain @ gaps.T) @ moved.T
        omitted = tuple(
            _omitted_lags(cost, x, left, minimised / unit, unit, scale, scatter + gaps.T @ gaps)
        )
    known = cost.structure.uncertain
    carried = np.zeros((x.size, len(known)))
    if carried.size:
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
    return Accuracy(
        bound,
        insensitivity,
        covariance,
        carried,
        correlation,
        np.sqrt(np.maximum(np.diagonal(structural), 0.0)),
        noise,
        ratio,
        omitted,
    )


def _scatter(cost: Cost, scale: Real) -> Real | None:
    """Return the covariance of the residuals, (2 n_point, 2 n_point); None if it is unknown."""
    relative = cost.points.covariance
    if relative is None:
        return None
    real, imag = np.real(relative), np.imag(relative)
    return 0.5 * np.block([[real, -imag], [imag, real]]) * np.outer(scale, scale)


def _left(covariance: Real, jacobian: Real, gain: Real) -> Real:
    """Return P S P, what a fit leaves of a covariance, (n_residual, n_residual)."""
    half = covariance - jacobian @ (gain @ covariance)
    return half - (half @ gain.T) @ jacobian.T


def _structural(
    cost: Cost, residual: Real, noise: Real, jacobian: Real, scale: Real, gain: Real
) -> Real:
    """Return the covariance, (n_free, n_free), by what the structure leaves out.

    `noise` is the residuals' covariance without it, (n_residual, n_residual).
    """
    both = np.kron(np.eye(2), alike(cost.points.frequency, cost.points.pair))
    same = np.asarray(both * np.outer(scale, scale), np.float64)
    own, square = _left(same, jacobian, gain), (FLOOR * np.geomspace(*_SIZES)) ** 2
    power, chance, share = float(residual @ residual), np.trace(noise), max(np.trace(own), 1e-300)
    shown = noise + max(power - chance, 0.0) / share * own  # C that explains the power
    freedom, mean = np.trace(shown) ** 2 / np.sum(shown**2), chance + square * share
    likelihood = -0.5 * freedom * (np.log(mean) + power / mean)
    likely = np.exp(likelihood - np.max(likelihood)) * np.sqrt(square) / (1.0 + square / FLOOR**2)
    return float(np.average(square, weights=likely)) * gain @ same @ gain.T


def _omitted_lags(
    cost: Cost, x: Real, left: Real, jacobian: Real, unit: Real, scale: Real, scatter: Real
) -> Iterator[tuple[str, float, float, float]]:
    """Yield inputs that a lag beyond their delay would explain better, by a score test.

    `jacobian` (2 n_point, n_free) is by parameters over `unit`. To its first order a lag is a
    delay, so that what shows is its square.
    """
    at, value = cost.points, np.maximum(np.abs(x), 1e-300)
    tried = _TRIED / float(np.max(at.frequency))
    turned = 1j * at.frequency * tried
    column = turned - np.log1p(turned)
    for number, name in enumerate(cost.structure.inputs):
        mine = np.where(at.input == number, column, 0.0)
        slope = scale * np.concatenate([np.real(mine), np.imag(mine)])
        gain = np.linalg.pinv(np.column_stack([jacobian, slope]))
        *shift, size = -(gain @ left)
        *errors, error = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", gain, scatter, gain), 0.0))
        moved = np.abs(shift / unit) / value
        known = np.array(errors) / unit < _KNOWN * value
        if size > _BEYOND_CHANCE * error:
            lag = tried * math.sqrt(size)
            yield name, lag, float(size / error), float(np.max(moved, where=known, initial=0.0))


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
