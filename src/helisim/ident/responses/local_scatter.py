"""The errors of a local estimate and their correlations: random ones, and the bias that is left.

The estimate is linear in the lines of the disturbance e = y - H u,

    dH(w) = sum over flights and lines of  q(w) E ,

and lines of a record without a window are nearly independent, so

    cov[dH(w), dH(w')] = sum over the lines that both use of  q(w) q(w')* S ,

with S the disturbance's spectrum, which is smooth where q is not: it stands before the sum.
The bias that is left is added: the same for neighbours, unrelated further away. So is what the
widths of the band differ by around their average, each point for itself: which of them are used
is chosen by the data, which the sum above doesn't know.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.value import Value
from helisim.ident.responses.estimate import bias_covariance


@dataclass(frozen=True, eq=False, repr=False)
class LineWeights(Value):
    """By what a response at one frequency takes the lines of each flight.

    Attributes:
        part: (n_part,) which widths of the band have a share.
        first: (n_flight,) the line that `value` begins with.
        value: (n_part, n_in, n_flight, n_line) weights.
    """

    part: NDArray[np.intp]
    first: NDArray[np.intp]
    value: NDArray[np.complex64]


@dataclass(frozen=True, eq=False, repr=False)
class LocalScatter(Value):
    """The error of a local estimate, all correlations included.

    Attributes:
        frequency: (n_freq,) rad/s.
        weights: for each frequency.
        share: (n_width, n_out, n_in, n_freq) each width's share in the response.
        noise: (n_freq, n_out, n_out) one-sided spectra between the outputs' disturbances.
        bias: (n_out, n_in, n_freq) size of the systematic error that is left.
        spread: (n_out, n_in, n_freq) what the choice of widths adds at each point for itself;
            none by default.
    """

    frequency: NDArray[np.float64]
    weights: tuple[LineWeights, ...]
    share: NDArray[np.float64]
    noise: NDArray[np.complex128]
    bias: NDArray[np.float64]
    spread: NDArray[np.float64] | None = None

    def covariance(
        self,
        output: Sequence[int] | NDArray[np.intp],
        input_: Sequence[int] | NDArray[np.intp],
        position: Sequence[int] | NDArray[np.intp],
    ) -> NDArray[np.complex128]:
        """Return E[dH_k dH_l*] between points of the response, (n_point, n_point).

        Args:
            output: (n_point,) which output the points are of.
            input_: (n_point,) which input.
            position: (n_point,) index of the frequency.
        """
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        root = self.noise_root()[w, o]
        total = np.zeros((w.size, w.size), dtype=np.complex128)
        distinct = np.unique(w)
        mine = {int(at): np.flatnonzero(w == at) for at in distinct}
        mixed = {at: self._mixing(o[k], i[k], at) for at, k in mine.items()}
        for place, a in enumerate(map(int, distinct)):
            for b in map(int, distinct[place:]):
                shared = _product(self.weights[a], self.weights[b])
                if shared is None:
                    break
                block = mixed[a] @ shared @ mixed[b].T
                total[mine[a][:, None], mine[b]] = block
                total[mine[b][:, None], mine[a]] = block.conj().T
        total *= root @ root.conj().T
        total += bias_covariance(self.bias, self.frequency, o, i, w)
        if self.spread is not None:
            same = (o[:, None] == o) & (i[:, None] == i) & (w[:, None] == w)
            total += np.where(same, self.spread[o, i, w] ** 2, 0.0)
        return total

    def variance(
        self,
        output: Sequence[int] | NDArray[np.intp],
        input_: Sequence[int] | NDArray[np.intp],
        position: Sequence[int] | NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """Return E|dH_k|^2 of points, (n_point,) each; arguments as for `covariance`."""
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        total = np.zeros(w.size)
        for at in np.unique(w):
            k = np.flatnonzero(w == at)
            value = self.weights[at].value
            own = np.matmul(
                flat := value.reshape(*value.shape[:2], -1).swapaxes(0, 1),
                flat.conj().swapaxes(1, 2),
            )
            share = self.share[self.weights[at].part][:, o[k], i[k], at].T
            power = np.real(np.einsum("kc,kcd,kd->k", share, own[i[k]], share))
            total[k] = power * np.real(self.noise[at, o[k], o[k]])
        total += self.bias[o, i, w] ** 2
        return total if self.spread is None else total + self.spread[o, i, w] ** 2

    def minus(self, other: "LocalScatter") -> "LocalScatter":
        """Return the scatter of the difference of two estimates from the same records."""
        return replace(
            self,
            weights=tuple(
                _beside(one, another, self.share.shape[0])
                for one, another in zip(self.weights, other.weights)
            ),
            share=np.concatenate([self.share, -other.share]),
            bias=np.hypot(self.bias, other.bias),
            spread=_together(self.spread, other.spread),
        )

    def _mixing(
        self, output: NDArray[np.intp], input_: NDArray[np.intp], position: int
    ) -> NDArray[np.float64]:
        """Return how points at a frequency take its parts and inputs, (n_point, n_part n_in)."""
        part = self.weights[position].part
        mixing = np.zeros((output.size, part.size, self.share.shape[2]))
        share = self.share[part][:, output, input_, position]
        mixing[np.arange(output.size), :, input_] = share.T
        return mixing.reshape(output.size, -1)

    def noise_root(self) -> NDArray[np.complex128]:
        """Return R with S = R R*, smooth in frequency as S is, (n_freq, n_out, n_out)."""
        value, vector = np.linalg.eigh(self.noise)
        scaled = vector * np.sqrt(np.maximum(value, 0.0))[:, None, :]
        return scaled @ vector.conj().swapaxes(1, 2)


def _product(one: LineWeights, other: LineWeights) -> NDArray[np.complex128] | None:
    """Return the sum over common lines of q q'*, (n_row, n_row'); None without common lines."""
    rows = one.value.shape[0] * one.value.shape[1]
    columns = other.value.shape[0] * other.value.shape[1]
    total = np.zeros((rows, columns), dtype=np.complex128)
    found = False
    start = np.maximum(one.first, other.first)
    stop = np.minimum(one.first + one.value.shape[3], other.first + other.value.shape[3])
    cuts = np.stack([start - one.first, start - other.first, stop - start])
    for cut in np.unique(cuts, axis=1).T:
        if cut[2] <= 0:
            continue
        found = True
        flights = np.flatnonzero(np.all(cuts == cut[:, None], axis=0))
        left = one.value[:, :, flights, cut[0] : cut[0] + cut[2]].reshape(rows, -1)
        right = other.value[:, :, flights, cut[1] : cut[1] + cut[2]].reshape(columns, -1)
        total += left @ right.conj().T
    return total if found else None


def _together(
    one: NDArray[np.float64] | None, other: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    """Return two independent deviations' sum; None where neither is known."""
    known = [each for each in (one, other) if each is not None]
    return np.sqrt(sum(each**2 for each in known)) if known else None


def _beside(one: LineWeights, other: LineWeights, n_width: int) -> LineWeights:
    """Return the weights of two estimates at a frequency as parts of one, numbered onwards."""
    first = np.minimum(one.first, other.first)
    last = np.maximum(one.first + one.value.shape[3], other.first + other.value.shape[3])
    parts = []
    for each in (one, other):
        wide = np.zeros((*each.value.shape[:3], int(np.max(last - first))), dtype=np.complex64)
        for flight, shift in enumerate(each.first - first):
            length = each.value.shape[3]
            wide[:, :, flight, shift : shift + length] = each.value[:, :, flight]
        parts.append(wide)
    part = np.concatenate([one.part, other.part + n_width])
    return LineWeights(part, first, np.concatenate(parts))
