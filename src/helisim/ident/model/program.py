"""A structure's matrices compiled once, to be filled with parameters thousands of times.

All matrices and delays stand in one array. Entries that are affine in the parameters, nearly all
of them, are filled by one product with a constant matrix, and their derivatives are constants.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError
from helisim.ident.model.forms import Form, value_at

if TYPE_CHECKING:
    from helisim.ident.model.structure import Structure


class Dependence(NamedTuple):
    """How one matrix entry depends on one parameter, by its place."""

    place: int
    matrix: str
    row: int
    column: int
    slope: Form


class Program:
    """Fills a structure's matrices.

    Attributes:
        names: the parameters, in the order in which `fill` takes them.
        free: (n_free,) places of the free ones among them.
        dependences: every entry that depends on a parameter.
    """

    def __init__(self, structure: "Structure") -> None:
        n, n_in, n_out = len(structure.states), len(structure.inputs), len(structure.outputs)
        shapes = {
            "M": (n, n),
            "F": (n, n),
            "G": (n, n_in),
            "H0": (n_out, n),
            "H1": (n_out, n),
            "D": (n_out, n_in),
            "D1": (n_out, n_in),
            "input_delays": (1, n_in),
            "output_delays": (n_out, 1),
            "delays": (n_out, n_in),
        }
        self.names = structure.names
        places = {name: k for k, name in enumerate(self.names)}
        self.free = np.array([places[one.name] for one in structure.free], dtype=np.intp)
        self._shapes, self._starts, end = shapes, {}, 0
        for matrix, (rows, columns) in shapes.items():
            self._starts[matrix] = end
            end += rows * columns
        self._base = np.zeros(end)
        affine: list[tuple[int, dict[int, Form]]] = []
        self._others: list[tuple[int, Form]] = []
        self.dependences: list[Dependence] = []
        for matrix, row, column, expression in structure.entries:
            value, slopes = expression.compiled(places, structure.constants)
            at = self._starts[matrix] + row * shapes[matrix][1] + column
            if any(callable(slope) for slope in slopes.values()):
                self._others.append((at, value))
            else:
                self._base[at] = value_at(value, [0.0] * len(self.names))
                affine.append((at, slopes))
            self.dependences += [
                Dependence(place, matrix, row, column, slope)
                for place, slope in slopes.items()
                if slope != 0.0
            ]
        kept = [(at, slopes) for at, slopes in affine if slopes]
        self._at = np.array([at for at, _ in kept], dtype=np.intp)
        self._linear = np.zeros((len(kept), len(self.names)))
        for row, (_, slopes) in enumerate(kept):
            for place, slope in slopes.items():
                self._linear[row, place] = value_at(slope, ())

    def ordered(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return parameters as `fill` takes them, (n_parameter,).

        Raises UnknownNameError if one is missing.
        """
        for name in self.names:
            if name not in values:
                raise UnknownNameError("parameter", name, values)
        return np.array([values[name] for name in self.names], dtype=np.float64)

    def fill(self, parameters: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return each matrix by name; an entry that is undefined is nan.

        Args:
            parameters: (n_parameter,) in the order of `names`.
        """
        flat = self._base.copy()
        flat[self._at] += self._linear @ parameters
        if self._others:
            listed = parameters.tolist()
            for at, value in self._others:
                flat[at] = value_at(value, listed)
        return {
            matrix: flat[start : start + shape[0] * shape[1]].reshape(shape)
            for (matrix, start), shape in zip(self._starts.items(), self._shapes.values())
        }
