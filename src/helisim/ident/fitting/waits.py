"""The delays of a structure: which they are, where to look for them, and what they fit best."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.ident.fitting.cost import Cost
from helisim.ident.fitting.rational import STEP, delay_grid


class Waits:
    """The free delays of a structure, as a vector of free parameters has them.

    Attributes:
        index: (n_delay,) where they are among the free parameters.
        grids: the values to look at of each, s.
        apart: (n_delay,) s, by which two must differ to be different starts: what turns the top
            of the band by half a radian, or half of what the bounds leave.
    """

    def __init__(self, cost: Cost) -> None:
        structure, points = cost.structure, cost.points
        names = [parameter.name for parameter in structure.free]
        known = {**structure.constants, **structure.starts}
        slope = np.zeros((len(names), len(structure.outputs), len(structure.inputs)))
        for matrix, row, column, expression in structure.entries:
            if not matrix.endswith("delays"):
                continue
            place: tuple[object, object] = (row, column)
            if matrix == "input_delays":
                place = (slice(None), column)
            elif matrix == "output_delays":
                place = (row + column, slice(None))
            for name, derivative in expression.evaluate(known)[1].items():
                if name in names:
                    slope[names.index(name), *place] += derivative
        self.index = np.flatnonzero(np.any(slope != 0.0, axis=(1, 2)))
        self.grids = [delay_grid(points.frequency, *structure.free[k].limits) for k in self.index]
        step = STEP / float(np.max(points.frequency))
        self.apart = np.array([min(step, 0.5 * np.ptp(grid)) for grid in self.grids])
        # rad by which a second of each delay turns each point
        at = points.frequency[points.position]
        self._turn = at * slope[self.index][:, points.output, points.input]

    def differ(self, one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
        """Return whether two vectors of delays, each (n_delay,) s, are a step apart."""
        return bool(np.any(np.abs(one - other) >= 0.99 * self.apart))

    def scan(
        self,
        cost: Cost,
        x: NDArray[np.float64],
        gains: NDArray[np.intp],
        taken: Sequence[NDArray[np.float64]] = (),
    ) -> NDArray[np.float64]:
        """Return free parameters with the best delays: all alike first, then one at a time.

        The gains are solved at each. A delay turns the response that is known at x, so nothing is
        evaluated but that.

        Args:
            cost: of the fit.
            x: (n_free,) the free parameters.
            gains: which of them act linearly, (n_gain,).
            taken: delays to stay a step away from, each (n_delay,) s, where the bounds allow it.

        Returns:
            (n_free,).
        """
        z, slope = cost.ratio(x)
        if not (np.all(np.isfinite(z)) and np.all(np.isfinite(slope))):
            return x
        here = x[self.index]
        root = np.sqrt(cost.certainty)
        linear = _real(root * slope[gains])
        rest = z - x[gains] @ slope[gains]
        size = np.linalg.norm(linear, axis=1)
        size[size == 0.0] = 1.0
        seen = np.linalg.svd(linear / size[:, None], full_matrices=False)
        basis = seen.Vh[1e-9 * np.max(seen.S, initial=0.0) < seen.S]

        def misfits(delays: NDArray[np.float64]) -> NDArray[np.float64]:
            # |turn (g s + rest) - 1| = |g s + rest - 1 / turn|, so what gains can do never changes
            back = np.exp(1j * ((delays - here) @ self._turn))
            target = _real(root * (back - rest))
            return np.sum(target**2, axis=1) - np.sum((target @ basis.T) ** 2, axis=1)

        def best(delays: NDArray[np.float64]) -> NDArray[np.float64] | None:
            apart = [all(self.differ(one, other) for other in taken) for one in delays]
            delays = delays[apart]
            return delays[np.argmin(misfits(delays))] if delays.size else None

        longest = max(self.grids, key=len)
        limits = np.array([(grid[0], grid[-1]) for grid in self.grids])
        alike = np.clip(np.repeat(longest[:, None], here.size, axis=1), *limits.T)
        chosen = best(np.concatenate([alike, here[None, :]]))
        if chosen is None:
            return x
        for k, grid in [*enumerate(self.grids)] * (2 if here.size > 1 else 0):
            each = np.repeat(chosen[None, :], grid.size, axis=0)
            each[:, k] = grid
            better = best(each)
            chosen = chosen if better is None else better
        found = x.copy()
        found[self.index] = chosen
        return found


def _real(rows: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.concatenate([rows.real, rows.imag], axis=-1)
