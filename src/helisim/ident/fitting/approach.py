"""Goes from afar towards a minimum of a cost by relative errors, which stay smooth through zero."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, least_squares

from helisim.ident.fitting.cost import Cost


def approach(cost: Cost, x: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """Return where at most `steps` steps lead from x, (n_free,), to fewer relative errors.

    Args:
        cost: of the fit.
        x: (n_free,) the free parameters.
        steps: evaluations of the cost.

    Returns:
        (n_free,).
    """
    limits = np.array([parameter.limits for parameter in cost.structure.free]).T
    return least_squares(
        cost.relative,
        inside(x, limits),
        jac=cost.relative_jacobian,  # pyright: ignore[reportArgumentType]
        bounds=Bounds(*limits),
        x_scale="jac",
        ftol=1e-4,
        xtol=1e-4,
        max_nfev=steps,
    ).x


def inside(x: NDArray[np.float64], limits: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return x, (n_free,), strictly within limits, (2, n_free), as a trust region: (n_free,)."""
    low, high = limits
    margin = np.where(np.isfinite(high - low), 1e-9 * (high - low), 0.0)
    return np.clip(x, low + margin, high - margin)
