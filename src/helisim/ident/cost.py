"""The cost of a model against measured points, as residuals with their exact Jacobian.

    J = sum over responses (20/n_w) sum_w W_g [ (dB error)^2 + 0.01745 (deg error)^2 ] ,
    W_g = [1.58 (1 - exp(-g2))]^2

(Tischler and Remple). The average J that is printed is this sum over the number of
responses; the accuracy analysis uses the sum.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.errors import IdentificationError
from helisim.ident.evaluate import response_and_slope
from helisim.ident.points import PHASE_WEIGHT, Points
from helisim.ident.structure import Structure
from helisim.units import DB_PER_NEPER

_HOPELESS = 1e3
"""Residual where the model is undefined: worse than any response that is defined."""


_FLOOR = 0.005
"""No point is trusted more than this, as a fraction of its response, however quiet the record.
Windows smear noise-free responses of lightly damped modes by 0.05 to 0.3 %."""


class Cost:
    """Residuals of a structure over points as a function of its free parameters.

    `log` residuals are those of J. `relative` ones, (H_model - H) / |H|, stay smooth through
    zero gain, so they lead a search from far away into the right signs. `standardised` ones
    are relative ones over each point's own standard deviation: linear in the measured
    response, so noise does not bias them, and a point counts by what it knows.
    """

    def __init__(self, structure: Structure, points: Points) -> None:
        self.structure = structure
        self.points = points
        deviation = points.deviation
        self._spread = None if deviation is None else np.hypot(deviation, _FLOOR)
        self._fixed = structure.starts
        self._names = [parameter.name for parameter in structure.free]
        self._key = b""
        self._held: tuple[NDArray[np.complex128], NDArray[np.complex128]] | None = None

    def values(self, x: NDArray[np.float64]) -> dict[str, float]:
        """Return every parameter by name, the fixed ones too, for the free ones x, (n_free,)."""
        return {**self._fixed, **dict(zip(self._names, x.tolist()))}

    def ratio(self, x: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray]:
        """Return model over measured response at x, (n_free,), and its slope.

        Returns:
            (n_point,) and (n_free, n_point).
        """
        key = x.tobytes()
        if self._held is None or key != self._key:
            at = self.points
            total, slope = response_and_slope(self.structure, self.values(x), at.frequency)
            place = (at.output, at.input, at.position)
            self._held = (total[place] / at.measured, slope[:, *place] / at.measured)
            self._key = key
        return self._held

    def log(self, x: NDArray[np.float64], *, unwrap: bool = True) -> NDArray[np.float64]:
        """Return the residuals of x, (n_free,), whose squares sum to J, (2 n_point,)."""
        z, _ = self.ratio(x)
        if not np.all(np.isfinite(z)) or np.any(z == 0.0):
            return np.full(2 * z.size, _HOPELESS)
        phase = self._unwrapped(z) if unwrap else np.angle(z)
        root = np.sqrt(self.points.weight)
        degrees = np.rad2deg(phase) * np.sqrt(PHASE_WEIGHT)
        return np.concatenate([root * DB_PER_NEPER * np.log(np.abs(z)), root * degrees])

    def log_jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of `log` by x, (n_free,): (2 n_point, n_free)."""
        z, slope = self.ratio(x)
        with np.errstate(all="ignore"):
            step = slope / z
        if not np.all(np.isfinite(step)):
            return np.zeros((2 * z.size, len(self._names)))
        root = np.sqrt(self.points.weight)
        degree = np.rad2deg(1.0) * np.sqrt(PHASE_WEIGHT)
        return np.concatenate(
            [root * DB_PER_NEPER * step.real, root * degree * step.imag], axis=1
        ).T

    def relative(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the relative errors of x, (n_free,), in dB of a small one, (2 n_point,)."""
        z, _ = self.ratio(x)
        if not np.all(np.isfinite(z)):
            return np.full(2 * z.size, _HOPELESS)
        scaled = DB_PER_NEPER * np.sqrt(self.points.weight) * (z - 1.0)
        return np.concatenate([scaled.real, scaled.imag])

    def relative_jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of `relative` by x, (n_free,): (2 n_point, n_free)."""
        _, slope = self.ratio(x)
        if not np.all(np.isfinite(slope)):
            return np.zeros((2 * self.points.weight.size, len(self._names)))
        scaled = DB_PER_NEPER * np.sqrt(self.points.weight) * slope
        return np.concatenate([scaled.real, scaled.imag], axis=1).T

    @property
    def certainty(self) -> NDArray[np.float64]:
        """What a squared relative error counts by where a start is looked for, (n_point,)."""
        deviation = self.points.deviation
        if self._spread is None or deviation is None or not np.any(deviation > 0.0):
            return self.points.weight
        return 1.0 / self._spread**2

    @property
    def spread(self) -> NDArray[np.float64]:
        """Standard deviation by which `standardised` residuals are divided, (n_point,)."""
        if self._spread is None:
            raise IdentificationError(
                "the points' errors are not known, as the response was not estimated from records"
            )
        return self._spread

    def standardised(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the relative errors of x, (n_free,), over their deviations, (2 n_point,)."""
        z, _ = self.ratio(x)
        if not np.all(np.isfinite(z)):
            return np.full(2 * z.size, _HOPELESS)
        scaled = (z - 1.0) / self.spread
        return np.concatenate([scaled.real, scaled.imag])

    def standardised_jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of `standardised` by x, (n_free,): (2 n_point, n_free)."""
        _, slope = self.ratio(x)
        if not np.all(np.isfinite(slope)):
            return np.zeros((2 * self.points.weight.size, len(self._names)))
        scaled = slope / self.spread
        return np.concatenate([scaled.real, scaled.imag], axis=1).T

    def jacobian_by(
        self, x: NDArray[np.float64], names: Sequence[str], *, standardised: bool
    ) -> NDArray[np.float64]:
        """Return the derivatives by other parameters than the free ones, such as known ones.

        Args:
            x: (n_free,) the free parameters.
            names: of the others.
            standardised: of `standardised` residuals; otherwise of `log`.

        Returns:
            (2 n_point, n_name).
        """
        at = self.points
        place = (at.output, at.input, at.position)
        total, slope = response_and_slope(self.structure, self.values(x), at.frequency, by=names)
        relative = slope[:, *place] / (at.measured if standardised else total[place])
        scale = np.tile(1.0 / self.spread, 2) if standardised else self.log_scale()
        return scale[:, None] * np.concatenate([relative.real, relative.imag], axis=1).T

    def log_scale(self) -> NDArray[np.float64]:
        """Return what `log` multiplies the error of the response's logarithm by, (2 n_point,)."""
        root = np.sqrt(self.points.weight)
        return np.concatenate(
            [root * DB_PER_NEPER, root * (np.rad2deg(1.0) * np.sqrt(PHASE_WEIGHT))]
        )

    def per_response(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return J of each response for x, (n_free,), its phase within half a turn, (n_pair,)."""
        residual = self.log(x, unwrap=False) ** 2
        half = self.points.weight.size
        each = residual[:half] + residual[half:]
        pairs = range(len(self.points.pairs))
        return np.array([float(np.sum(each[self.points.pair == pair])) for pair in pairs])

    def _unwrapped(self, z: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the phase error, continuous along each response and nearest to zero.

        A wrong delay then costs more the further it is off, also beyond half a turn.
        """
        phase = np.angle(z)
        for pair in range(len(self.points.pairs)):
            mine = self.points.pair == pair
            curve = np.unwrap(phase[mine])
            weight = self.points.weight[mine]
            mean = np.sum(weight * curve) / np.sum(weight)
            phase[mine] = curve - 2.0 * np.pi * np.round(mean / (2.0 * np.pi))
        return phase
