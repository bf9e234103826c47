"""The cost of a model against measured points, as residuals with their exact Jacobian.

    J = sum over responses (20/n_w) sum_w W_g [ (dB error)^2 + 0.01745 (deg error)^2 ] ,
    W_g = [1.58 (1 - exp(-g2))]^2

(Tischler and Remple). The average J that is printed is this sum over the number of
responses; the accuracy analysis uses the sum.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError
from helisim.base.units import DB_PER_NEPER
from helisim.ident.fitting.points import PHASE_WEIGHT, Points
from helisim.ident.model.sensitivity import Sample, Sensitivity
from helisim.ident.model.structure import Structure

_PER_RADIAN = float(np.rad2deg(1.0) * np.sqrt(PHASE_WEIGHT))
"""By how much a radian of phase counts where a dB counts 1."""

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
        program, frequency = structure.program, points.frequency[points.position]
        self._where = Sensitivity(program, frequency, points.output, points.input)
        self._start = program.ordered(structure.starts)
        self._root = np.sqrt(points.weight)
        self._firsts = np.flatnonzero(np.diff(points.pair, prepend=-1))
        self._key = b""
        self._held: Sample | None = None

    def values(self, x: NDArray[np.float64]) -> dict[str, float]:
        """Return every parameter by name, the fixed ones too, for the free ones x, (n_free,)."""
        return {**self._fixed, **dict(zip(self._names, x.tolist()))}

    def ratio(self, x: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray]:
        """Return model over measured response at x, (n_free,), and its slope.

        Returns:
            (n_point,) and (n_free, n_point).
        """
        sample = self._sample(x)
        measured = self.points.measured
        return sample.response / measured, sample.slope(1.0 / measured).copy()

    def _sample(self, x: NDArray[np.float64]) -> Sample:
        key = x.tobytes()
        if self._held is None or key != self._key:
            self._held = self._where.at(self._parameters(x))
            self._key = key
        return self._held

    def _parameters(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return every parameter in the structure's order, (n_parameter,)."""
        parameters = self._start.copy()
        parameters[self.structure.program.free] = x
        return parameters

    def _ratio(self, x: NDArray[np.float64]) -> NDArray[np.complex128]:
        return self._sample(x).response / self.points.measured

    def _jacobian(
        self, x: NDArray[np.float64], scale: NDArray, imaginary: float = 1.0
    ) -> NDArray[np.float64]:
        """Return scaled slopes as (2 n_point, n_free), their imaginary parts by a factor more."""
        slope = self._sample(x).slope(scale)
        half = scale.size
        # A parameter's column stands in one piece, as the decompositions of a search want it.
        columns = np.empty((len(self._names), 2 * half))
        columns[:, :half] = slope.real
        np.multiply(slope.imag, imaginary, out=columns[:, half:])
        if not np.all(np.isfinite(columns)):
            columns[:] = 0.0
        return columns.T

    def log(self, x: NDArray[np.float64], *, unwrap: bool = True) -> NDArray[np.float64]:
        """Return the residuals of x, (n_free,), whose squares sum to J, (2 n_point,)."""
        z = self._ratio(x)
        if not np.all(np.isfinite(z)) or np.any(z == 0.0):
            return np.full(2 * z.size, _HOPELESS)
        phase = self._unwrapped(z) if unwrap else np.angle(z)
        decibel = DB_PER_NEPER * np.log(np.abs(z))
        return np.concatenate([self._root * decibel, self._root * (_PER_RADIAN * phase)])

    def log_jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of `log` by x, (n_free,): (2 n_point, n_free)."""
        with np.errstate(all="ignore"):
            scale = DB_PER_NEPER * self._root / self._sample(x).response
        return self._jacobian(x, scale, _PER_RADIAN / DB_PER_NEPER)

    def relative(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the relative errors of x, (n_free,), in dB of a small one, (2 n_point,)."""
        z = self._ratio(x)
        if not np.all(np.isfinite(z)):
            return np.full(2 * z.size, _HOPELESS)
        scaled = DB_PER_NEPER * self._root * (z - 1.0)
        return np.concatenate([scaled.real, scaled.imag])

    def relative_jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of `relative` by x, (n_free,): (2 n_point, n_free)."""
        return self._jacobian(x, DB_PER_NEPER * self._root / self.points.measured)

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
        z = self._ratio(x)
        if not np.all(np.isfinite(z)):
            return np.full(2 * z.size, _HOPELESS)
        scaled = (z - 1.0) / self.spread
        return np.concatenate([scaled.real, scaled.imag])

    def standardised_jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of `standardised` by x, (n_free,): (2 n_point, n_free)."""
        return self._jacobian(x, 1.0 / (self.points.measured * self.spread))

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
        where = Sensitivity(
            self.structure.program, at.frequency[at.position], at.output, at.input, by=names
        )
        sample = where.at(self._parameters(x))
        relative = sample.slope(1.0 / (at.measured if standardised else sample.response))
        scale = np.tile(1.0 / self.spread, 2) if standardised else self.log_scale()
        return scale[:, None] * np.concatenate([relative.real, relative.imag], axis=1).T

    def log_scale(self) -> NDArray[np.float64]:
        """Return what `log` multiplies the error of the response's logarithm by, (2 n_point,)."""
        return np.concatenate([self._root * DB_PER_NEPER, self._root * _PER_RADIAN])

    def per_response(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return J of each response for x, (n_free,), its phase within half a turn, (n_pair,)."""
        residual = self.log(x, unwrap=False) ** 2
        half = self.points.weight.size
        each = residual[:half] + residual[half:]
        return np.add.reduceat(each, self._firsts)

    def _unwrapped(self, z: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the phase error, continuous along each response and nearest to zero.

        A wrong delay then costs more the further it is off, also beyond half a turn.
        """
        phase = np.angle(z)
        turns = np.zeros_like(phase)
        turns[1:] = -np.round(np.diff(phase) / (2.0 * np.pi))
        turns[self._firsts] = 0.0
        turns = np.cumsum(turns)
        turns -= turns[self._firsts][self.points.pair]
        weight = self.points.weight
        curve = phase / (2.0 * np.pi) + turns
        total = np.add.reduceat(weight * curve, self._firsts)
        mean = total / np.add.reduceat(weight, self._firsts)
        return phase + 2.0 * np.pi * (turns - np.round(mean)[self.points.pair])
