"""Errors of a frequency response and their correlations.

An estimate is linear in the disturbance e = y - H u, of spectrum S: by windows, of transforms E_m,
dH(w) = sum_m q_m(w) E_m(w), so

    cov[dH(w), dH(w')] = (1/4 pi) integral K_w(v) S(v) K_w'(v)* dv ,
    K_w(v) = sum_m q_m(w) Hann(w - v) exp(j v t_m) ;

by lines of whole records the sum of q(w) q(w')* S over common lines. e is taken as stationary and
independent of the reference, which fails for the direct method under feedback.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.settings import Value

Index = Sequence[int] | NDArray[np.intp]

# Of ln w, over which systematic errors are alike: measured of the JR700's and the Blade 360's exact
# responses against their structures, and of 30 and 90 s sweeps' windows (correlation at 0.25, 0.5
# and 1: 0.5 to 0.7, 0.3 to 0.5, 0.1 to 0.3)
_REACH = 0.5
AVERAGES = 8.0  # no coherence is larger than what so many would need for the random error
_LOBES = 4.0  # half width of the Hann window's transform, bins: 0.0014 % of its power is outside


def alike(frequency: Real, pair: NDArray[np.intp]) -> Real:
    """Return the correlation of points' systematic errors, (n_point, n_point), 0 between pairs.

    `frequency` is (n_point,) rad/s, `pair` (n_point,) of each point's output and input.
    """
    apart = np.abs(np.subtract.outer(np.log(frequency), np.log(frequency)))
    return np.where(pair[:, None] == pair, np.exp(-apart / _REACH), 0.0)


def _bias_covariance(
    bias: Real,
    frequency: Real,
    output: NDArray[np.intp],
    input_: NDArray[np.intp],
    position: NDArray[np.intp],
) -> Real:
    size = bias[output, input_, position]
    return np.outer(size, size) * alike(frequency[position], output * bias.shape[1] + input_)


@dataclass(frozen=True, eq=False, repr=False)
class WindowWeights(Value):
    """Contribution of the windows of one `length`, s, to the response.

    `start` is (n_segment,) s, `flight` (n_segment,) indices, `weight` (n_freq, n_in, n_segment)
    q_m, `share` (n_out, n_in, n_freq) the length's part in the composite.
    """

    length: float
    start: Real
    flight: NDArray[np.intp]
    weight: Complex
    share: Real


@dataclass(frozen=True, eq=False, repr=False)
class Scatter(Value):
    """Error model of a composite of windows; errors are circular, E[dH_k dH_l] = 0.

    Points are arrays (n_point,) of indices of output, input and frequency. `durations` are in s,
    `noise` (n_freq, n_out, n_out) one-sided spectra, `bias` (n_out, n_in, n_freq), `gap` likewise,
    the composite less the local estimate of the same records.
    """

    frequency: Real
    windows: tuple[WindowWeights, ...]
    durations: tuple[float, ...]
    noise: Complex
    bias: Real
    gap: Complex

    def covariance(self, output: Index, input_: Index, position: Index) -> Complex:
        """Return E[dH_k dH_l*], (n_point, n_point)."""
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        total = np.zeros((w.size, w.size), dtype=np.complex128)
        for kernel, grid, spacing in self._kernels(o, i, w):
            for a in np.unique(o):
                for b in np.unique(o):
                    spectrum = np.interp(grid, self.frequency, self.noise[:, a, b])
                    block = (kernel[o == a] * spectrum) @ kernel[o == b].conj().T
                    total[np.ix_(o == a, o == b)] += block * (spacing / (4.0 * np.pi))
        total = 0.5 * (total + total.conj().T)
        return total + _bias_covariance(self.bias, self.frequency, o, i, w)

    def minus(self, other: Any) -> "Scatter":
        """Return the error model of the difference of two estimates from the same records."""
        taken = tuple(replace(one, share=-one.share) for one in other.windows)
        bias = np.sqrt(self.bias**2 + other.bias**2)
        return replace(self, windows=self.windows + taken, bias=bias, gap=self.gap - other.gap)

    def _kernels(
        self, o: NDArray[np.intp], i: NDArray[np.intp], w: NDArray[np.intp]
    ) -> Iterator[tuple[Complex, Real, float]]:
        """Yield for each flight K, (n_point, n_grid), the disturbance's frequencies, their step."""
        reach = 2.0 * np.pi * _LOBES / min(one.length for one in self.windows)
        low = max(self.frequency[w].min() - reach, 0.0)
        high = self.frequency[w].max() + reach
        longest = max(one.length for one in self.windows)
        distinct, which = np.unique(w, return_inverse=True)
        for flight, duration in enumerate(self.durations):
            spacing = 2.0 * np.pi / (duration + longest)
            grid = np.arange(low + 0.5 * spacing, high, spacing)
            kernel = np.zeros((w.size, grid.size), dtype=np.complex128)
            for one in self.windows:
                lobes = hann_lobe(self.frequency[distinct, None] - grid, one.length)
                mine, half = one.flight == flight, 0.5 * one.length
                middle = np.exp(1j * np.outer(one.start[mine] + half, grid))
                turned = one.share[o, i, w] * np.exp(-1j * half * self.frequency[w])
                phases = (one.weight[:, :, mine][w, i] * turned[:, None]) @ middle
                phases *= lobes[which]
                kernel += phases
            yield kernel, grid, spacing


def hann_lobe(offset: Real, length: float) -> Real:
    """Return a centred Hann window's transform, (n_point, n_grid), at offsets in rad/s."""
    bins = offset * (length / (2.0 * np.pi))
    # sinc(x) / (1 - x^2) with its limit 1/2 at x = 1.
    near = np.abs(np.abs(bins) - 1.0) < 1e-6
    safe = np.where(near, 0.0, bins)
    shape = np.where(near, 0.5, np.sinc(safe) / (1.0 - safe**2))
    return np.where(np.abs(bins) > _LOBES, 0.0, 0.5 * length * shape)


@dataclass(frozen=True, eq=False, repr=False)
class LineWeights(Value):
    """Weights of the flights' lines in a response at one frequency.

    `part` is (n_part,) bandwidths with a share, `first` (n_flight,) first line of `value`, (n_part,
    n_in, n_flight, n_line).
    """

    part: NDArray[np.intp]
    first: NDArray[np.intp]
    value: NDArray[np.complex64]

    @classmethod
    def side_by_side(
        cls,
        part: Sequence[int] | NDArray[np.intp],
        weights: Sequence[tuple[NDArray[np.intp], NDArray[np.complex64]]],
    ) -> "LineWeights":
        """Join parts: first lines, (n_flight,), weights, (..., n_in, n_flight, n_line), each."""
        first = np.min([begin for begin, _ in weights], axis=0)
        last = np.max([begin + value.shape[-1] for begin, value in weights], axis=0)
        shape = (len(part), *weights[0][1].shape[-3:-1], int(np.max(last - first)))
        wide, row = np.zeros(shape, dtype=np.complex64), 0
        for begin, value in weights:
            value = value.reshape(-1, *value.shape[-3:])
            for flight, shift in enumerate(begin - first):
                at = slice(shift, shift + value.shape[-1])
                wide[row : row + len(value), :, flight, at] = value[:, :, flight]
            row += len(value)
        return cls(np.array(part, dtype=np.intp), first, wide)

    def only(self, used: NDArray[np.bool_]) -> "LineWeights":
        """Return some of the parts, without lines in which they have no weight."""
        lines = np.flatnonzero(np.any(self.value[used], axis=(0, 1, 2)))
        span = slice(lines[0], lines[-1] + 1) if lines.size else slice(0, 1)
        return LineWeights(self.part[used], self.first + span.start, self.value[used][..., span])


@dataclass(frozen=True, eq=False, repr=False)
class LocalScatter(Value):
    """Error model of a local estimate; points as in `Scatter`.

    `share` is (n_width, n_out, n_in, n_freq), `noise` (n_freq, n_out, n_out) one-sided spectra,
    `bias` (n_out, n_in, n_freq) and `spread` likewise, an independent error from the choice of
    widths; `gap` as in `Scatter`, to others.
    """

    frequency: Real
    weights: tuple[LineWeights, ...]
    share: Real
    noise: Complex
    bias: Real
    spread: Real
    gap: Complex | float = 0.0

    def covariance(self, output: Index, input_: Index, position: Index) -> Complex:
        """Return E[dH_k dH_l*], (n_point, n_point)."""
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
        total += _bias_covariance(self.bias, self.frequency, o, i, w)
        same = (o[:, None] == o) & (i[:, None] == i) & (w[:, None] == w)
        return total + np.where(same, self.spread[o, i, w] ** 2, 0.0)

    def variance(self, output: Index, input_: Index, position: Index) -> Real:
        """Return E|dH_k|^2, (n_point,)."""
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        total = np.zeros(w.size)
        for at in np.unique(w):
            k = np.flatnonzero(w == at)
            value = self.weights[at].value
            flat = value.reshape(*value.shape[:2], -1).swapaxes(0, 1)
            own = np.matmul(flat, flat.conj().swapaxes(1, 2))
            share = self.share[self.weights[at].part][:, o[k], i[k], at].T
            power = np.real(np.einsum("kc,kcd,kd->k", share, own[i[k]], share))
            total[k] = power * np.real(self.noise[at, o[k], o[k]])
        return total + self.bias[o, i, w] ** 2 + self.spread[o, i, w] ** 2

    def minus(self, other: Any) -> "LocalScatter":
        """Return the error model of the difference of two estimates from the same records."""
        n_width = self.share.shape[0]
        return replace(
            self,
            weights=tuple(
                LineWeights.side_by_side(
                    np.concatenate([one.part, another.part + n_width]),
                    [(one.first, one.value), (another.first, another.value)],
                )
                for one, another in zip(self.weights, other.weights)
            ),
            share=np.concatenate([self.share, -other.share]),
            bias=np.hypot(self.bias, other.bias),
            spread=np.sqrt(self.spread**2 + other.spread**2),
        )

    def _mixing(self, output: NDArray[np.intp], input_: NDArray[np.intp], position: int) -> Real:
        """Return the weights of a frequency's parts and inputs, (n_point, n_part n_in)."""
        part = self.weights[position].part
        mixing = np.zeros((output.size, part.size, self.share.shape[2]))
        mixing[np.arange(output.size), :, input_] = self.share[part][:, output, input_, position].T
        return mixing.reshape(output.size, -1)

    def noise_root(self) -> Complex:
        """Return R with S = R R*, smooth in frequency, (n_freq, n_out, n_out)."""
        value, vector = np.linalg.eigh(self.noise)
        return (vector * np.sqrt(np.maximum(value, 0.0))[:, None, :]) @ vector.conj().swapaxes(1, 2)


def _product(one: LineWeights, other: LineWeights) -> Complex | None:
    """Return the sum over common lines of q q'*, (n_row, n_row'); None without common lines."""
    start = np.maximum(one.first, other.first)
    stop = np.minimum(one.first + one.value.shape[3], other.first + other.value.shape[3])
    cuts = np.stack([start - one.first, start - other.first, stop - start])
    if not np.any(cuts[2] > 0):
        return None
    rows, columns = (np.prod(each.value.shape[:2], dtype=int) for each in (one, other))
    total = np.zeros((rows, columns), dtype=np.complex128)
    for a, b, count in np.unique(cuts[:, cuts[2] > 0], axis=1).T:
        flights = np.flatnonzero(np.all(cuts == [[a], [b], [count]], axis=0))
        left = one.value[:, :, flights, a : a + count].reshape(rows, -1)
        right = other.value[:, :, flights, b : b + count].reshape(columns, -1)
        total += left @ right.conj().T
    return total


ErrorModel = Scatter | LocalScatter


class Estimate(NamedTuple):
    """An estimator's result, (n_out, n_in, n_freq); `multiple` is (n_out, n_freq)."""

    response: Complex
    coherence: Real
    multiple: Real
    random_error: Real
    scatter: ErrorModel

    @classmethod
    def stated(
        cls, response: Complex, coherence: Real, multiple: Real, scatter: LocalScatter
    ) -> "Estimate":
        """Return an estimate with its errors, no more coherent than these allow."""
        o, i, w = np.indices(response.shape).reshape(3, -1)
        variance = scatter.variance(o, i, w).reshape(response.shape)
        relative = variance / np.maximum(np.abs(response) ** 2, 1e-300)
        most = 1.0 / (1.0 + AVERAGES * relative)
        return cls(
            response, np.minimum(coherence, most), multiple, np.sqrt(0.5 * relative), scatter
        )
