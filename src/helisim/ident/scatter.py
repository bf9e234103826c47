"""The errors of a frequency response and their correlations, for a fit to state its own.

An estimate is linear in the disturbance e = y - H u that the records hold beside the response. By
windows dH(w) = sum_m q_m(w) E_m(w), with E_m the windowed transform of e, and so

    cov[dH(w), dH(w')] = (1/4 pi) integral K_w(v) S(v) K_w'(v)* dv ,
    K_w(v) = sum_m q_m(w) Hann(w - v) exp(j v t_m) ,

S being e's spectrum; by the lines of whole records, which are nearly independent, it is the sum of
q(w) q(w')* S over the lines that both use. S comes from the residuals; e is taken to be stationary
and independent of the reference, which the direct method under feedback can't be. A bias that is
left is added, the same for neighbours, unrelated further away.
"""

import base64
import binascii
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import Value

Index = Sequence[int] | NDArray[np.intp]

_REACH = 0.25
"""Two biases are related if their frequencies differ by less than about this, as a fraction."""
_LOBES = 4.0
"""Half width of the Hann window's transform that is kept, in bins: 0.0014 % of its power is
outside."""


def _bias_covariance(
    bias: NDArray[np.float64],
    frequency: NDArray[np.float64],
    output: NDArray[np.intp],
    input_: NDArray[np.intp],
    position: NDArray[np.intp],
) -> NDArray[np.float64]:
    """Return what a bias of unknown sign, which neighbours share, adds between points."""
    at = np.log(frequency[position])
    apart = np.subtract.outer(at, at) / _REACH
    same = (output[:, None] == output) & (input_[:, None] == input_)
    size = bias[output, input_, position]
    return np.where(same, np.outer(size, size) * np.exp(-0.5 * apart**2), 0.0)


@dataclass(frozen=True, eq=False, repr=False)
class WindowWeights(Value):
    """What each window of one length contributes to the response.

    Attributes:
        length: of the windows, s.
        start: (n_segment,) when they start within their flight, s.
        flight: (n_segment,) which flight they belong to.
        weight: (n_freq, n_in, n_segment) q_m.
        share: (n_out, n_in, n_freq) the length's part in the composite; sums to 1 over lengths.
    """

    length: float
    start: NDArray[np.float64]
    flight: NDArray[np.intp]
    weight: NDArray[np.complex128]
    share: NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Scatter(Value):
    """The error of a composite of windows, all correlations included.

    Points are given by three arrays, (n_point,) each: of which output, of which input, and the
    frequency's index. Errors are circular: E[dH_k dH_l] = 0.

    Attributes:
        frequency: (n_freq,) rad/s.
        windows: what the windows of each length contribute.
        durations: of the flights, s.
        noise: (n_freq, n_out, n_out) one-sided spectra between the outputs' disturbances.
        bias: (n_out, n_in, n_freq) size of the windows' systematic error.
    """

    frequency: NDArray[np.float64]
    windows: tuple[WindowWeights, ...]
    durations: tuple[float, ...]
    noise: NDArray[np.complex128]
    bias: NDArray[np.float64]

    def covariance(self, output: Index, input_: Index, position: Index) -> NDArray[np.complex128]:
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

    def variance(self, output: Index, input_: Index, position: Index) -> NDArray[np.float64]:
        """Return E|dH_k|^2 of points, (n_point,)."""
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        total = np.zeros(w.size)
        for kernel, grid, spacing in self._kernels(o, i, w):
            power = [np.real(np.interp(grid, self.frequency, self.noise[:, a, a])) for a in o]
            total += np.sum(np.abs(kernel) ** 2 * np.stack(power), axis=1) * (
                spacing / (4.0 * np.pi)
            )
        return total + self.bias[o, i, w] ** 2

    def minus(self, other: Any) -> "Scatter":
        """Return the errors of the difference of two estimates from the same records."""
        taken = tuple(replace(one, share=-one.share) for one in other.windows)
        bias = np.sqrt(self.bias**2 + other.bias**2)
        return replace(self, windows=self.windows + taken, bias=bias)

    def _kernels(
        self, o: NDArray[np.intp], i: NDArray[np.intp], w: NDArray[np.intp]
    ) -> Iterator[tuple[NDArray[np.complex128], NDArray[np.float64], float]]:
        """Yield for each flight K, (n_point, n_grid), the disturbance's frequencies, their step."""
        reach = 2.0 * np.pi * _LOBES / min(one.length for one in self.windows)
        low = max(self.frequency[w].min() - reach, 0.0)
        high = self.frequency[w].max() + reach
        longest = max(one.length for one in self.windows)
        distinct, which = np.unique(w, return_inverse=True)
        lobes: dict[tuple[float, float], NDArray[np.float64]] = {}
        for flight, duration in enumerate(self.durations):
            spacing = 2.0 * np.pi / (duration + longest)
            grid = np.arange(low + 0.5 * spacing, high, spacing)
            kernel = np.zeros((w.size, grid.size), dtype=np.complex128)
            for one in self.windows:
                key = (duration, one.length)
                if key not in lobes:
                    lobes[key] = hann_lobe(self.frequency[distinct, None] - grid, one.length)
                mine, half = one.flight == flight, 0.5 * one.length
                middle = np.exp(1j * np.outer(one.start[mine] + half, grid))
                turned = one.share[o, i, w] * np.exp(-1j * half * self.frequency[w])
                phases = (one.weight[:, :, mine][w, i] * turned[:, None]) @ middle
                phases *= lobes[key][which]
                kernel += phases
            yield kernel, grid, spacing


def hann_lobe(offset: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return the transform of a Hann window of so many s around its own middle, real.

    It is (n_point, n_grid), as the offset is, (n_point, n_grid) in rad/s.
    """
    bins = offset * (length / (2.0 * np.pi))
    # sinc(x) / (1 - x^2) with its limit 1/2 at x = 1.
    near = np.abs(np.abs(bins) - 1.0) < 1e-6
    safe = np.where(near, 0.0, bins)
    shape = np.where(near, 0.5, np.sinc(safe) / (1.0 - safe**2))
    return np.where(np.abs(bins) > _LOBES, 0.0, 0.5 * length * shape)


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

    @classmethod
    def side_by_side(
        cls,
        part: Sequence[int] | NDArray[np.intp],
        weights: Sequence[tuple[NDArray[np.intp], NDArray[np.complex64]]],
    ) -> "LineWeights":
        """Return numbered parts as one, from the first line of any to the last.

        They are first lines, (n_flight,), and weights, (..., n_in, n_flight, n_line), each.
        """
        first = np.min([begin for begin, _ in weights], axis=0)
        last = np.max([begin + value.shape[-1] for begin, value in weights], axis=0)
        wide = np.zeros(
            (len(part), *weights[0][1].shape[-3:-1], int(np.max(last - first))), dtype=np.complex64
        )
        row = 0
        for begin, value in weights:
            value = value.reshape(-1, *value.shape[-3:])
            rows = slice(row, row := row + len(value))
            for flight, shift in enumerate(begin - first):
                at = slice(shift, shift + value.shape[-1])
                wide[rows, :, flight, at] = value[:, :, flight]
        return cls(np.array(part, dtype=np.intp), first, wide)


@dataclass(frozen=True, eq=False, repr=False)
class LocalScatter(Value):
    """The error of a local estimate, all correlations included; points are as for `Scatter`.

    Attributes:
        frequency: (n_freq,) rad/s.
        weights: for each frequency.
        share: (n_width, n_out, n_in, n_freq) each width's share in the response.
        noise: (n_freq, n_out, n_out) one-sided spectra between the outputs' disturbances.
        bias: (n_out, n_in, n_freq) size of the systematic error that is left.
        spread: (n_out, n_in, n_freq) what the choice of widths adds at each point for itself.
    """

    frequency: NDArray[np.float64]
    weights: tuple[LineWeights, ...]
    share: NDArray[np.float64]
    noise: NDArray[np.complex128]
    bias: NDArray[np.float64]
    spread: NDArray[np.float64]

    def covariance(self, output: Index, input_: Index, position: Index) -> NDArray[np.complex128]:
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

    def variance(self, output: Index, input_: Index, position: Index) -> NDArray[np.float64]:
        """Return E|dH_k|^2 of points, (n_point,)."""
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
        """Return the errors of the difference of two estimates from the same records."""
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
    rows, columns = (np.prod(each.value.shape[:2], dtype=int) for each in (one, other))
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


ErrorModel = Scatter | LocalScatter


class Estimate(NamedTuple):
    """A response as an estimator found it; arrays are (n_out, n_in, n_freq).

    `multiple` is (n_out, n_freq).
    """

    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    multiple: NDArray[np.float64]
    random_error: NDArray[np.float64]
    scatter: ErrorModel


# In a file all numbers stand to the last bit: arrays as base64 of their bytes, little-endian, with
# type and shape, for as text they would take three times the space. A digest says to which
# response they belong.

_KINDS = {kind.__name__: kind for kind in (Scatter, WindowWeights, LocalScatter, LineWeights)}

_TYPES = ("<f8", "<f4", "<c16", "<c8", "<i8", "<i4")


def scatter_to_plain(scatter: ErrorModel, response: NDArray[np.complex128]) -> dict[str, Any]:
    """Return an error model of a response, (n_out, n_in, n_freq), as plain data for JSON."""
    plain = _plain(scatter)
    return {"digest": _digest(plain, response), "model": plain}


def scatter_from_plain(data: Any, response: NDArray[np.complex128]) -> ErrorModel:
    """Return what `scatter_to_plain` wrote of that response, (n_out, n_in, n_freq).

    Raises:
        InputError: it is of another response, or was changed.
    """
    try:
        if data["digest"] != _digest(data["model"], response):
            raise InputError(
                "the error model ('scatter') isn't that of the response: one of them was changed "
                "after helisim wrote them; take 'scatter' out to use the response without"
            )
        return _value(data["model"])
    except InputError:
        raise
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        raise InputError(f"the error model ('scatter') can't be read: {error}") from None


def _plain(item: Any) -> Any:
    if is_dataclass(item):
        held = {one.name: _plain(getattr(item, one.name)) for one in fields(item)}
        return {"kind": type(item).__name__, **held}
    if isinstance(item, np.ndarray):
        little = np.ascontiguousarray(item, dtype=item.dtype.newbyteorder("<"))
        text = base64.b64encode(little.tobytes()).decode("ascii")
        return {"type": little.dtype.str, "shape": list(item.shape), "base64": text}
    return [_plain(one) for one in item] if isinstance(item, tuple) else item


def _value(item: Any) -> Any:
    if isinstance(item, list):
        return tuple(map(_value, item))
    if not isinstance(item, Mapping):
        return item
    if "kind" in item:
        kind = _KINDS[item["kind"]]
        return kind(**{name: _value(one) for name, one in item.items() if name != "kind"})
    if item["type"] not in _TYPES:
        raise InputError(f"an array has the type {item['type']!r}, expected {', '.join(_TYPES)}")
    try:
        data = base64.b64decode(item["base64"])
    except binascii.Error as error:
        raise InputError(f"an array isn't base64: {error}") from None
    array = np.frombuffer(data, dtype=np.dtype(item["type"])).reshape(item["shape"])
    array.flags.writeable = False
    return array


def _digest(plain: Any, response: NDArray[np.complex128]) -> str:
    digest = hashlib.blake2b(np.ascontiguousarray(response).tobytes(), digest_size=12)
    for part in _parts(plain):
        digest.update(part.encode())
    return digest.hexdigest()


def _parts(plain: Any) -> Iterator[str]:
    """Yield texts that say what plain data hold, in one way only."""
    if isinstance(plain, Mapping):
        for name in sorted(plain):
            yield f"{name}:"
            yield from _parts(plain[name])
    elif isinstance(plain, list):
        yield f"[{len(plain)}"
        for one in plain:
            yield from _parts(one)
    else:
        yield f"{plain!r};"
