"""The random errors of a frequency response and their correlations, for a fit to state its own.

An estimate is linear in the disturbance e = y - H u that the records hold beside the response:

    dH(w) = sum over windows m of  q_m(w) E_m(w) ,

where E_m is the windowed transform of e and q_m follows from the reference (or the inputs)
alone. Windows overlap, several lengths are combined, and the Hann window couples neighbouring
frequencies, so the errors at two frequencies, of two inputs and of two outputs belong
together. All of that is known: in terms of the disturbance's own spectrum, S(v),

    E_m(w) = integral of e's transform at v times Hann(w - v) exp(j v t_m) ,
    cov[dH(w), dH(w')] = (1/4 pi) integral K_w(v) S(v) K_w'(v)* dv ,
    K_w(v) = sum_m q_m(w) Hann(w - v) exp(j v t_m) .

So a sweep that passes a frequency once, in three of forty windows, has the error of three.
What is assumed: the disturbance is stationary and independent of the reference. S comes from
the residuals, smoothed by the windows. What the windows smear is added as a bias.
With the direct method the second assumption fails under feedback, and this error doesn't know of
the bias.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.value import Value
from helisim.ident.responses.estimate import bias_covariance

_LOBES = 4.0
"""Half width of the Hann window's transform that is kept, in bins: 0.0014 % of its power is
outside."""


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
    """The random error of a frequency response, all correlations included.

    Attributes:
        frequency: (n_freq,) rad/s.
        windows: what the windows of each length contribute.
        durations: of the flights, s.
        noise: (n_freq, n_out, n_out) one-sided spectra between the outputs' disturbances.
        bias: (n_out, n_in, n_freq) size of the windows' systematic error; none by default.
    """

    frequency: NDArray[np.float64]
    windows: tuple[WindowWeights, ...]
    durations: tuple[float, ...]
    noise: NDArray[np.complex128]
    bias: NDArray[np.float64] | None = None

    def covariance(
        self,
        output: Sequence[int] | NDArray[np.intp],
        input_: Sequence[int] | NDArray[np.intp],
        position: Sequence[int] | NDArray[np.intp],
    ) -> NDArray[np.complex128]:
        """Return E[dH_k dH_l*] between points, (n_point, n_point).

        The errors are circular: E[dH_k dH_l] = 0.

        Args:
            output: (n_point,) positions of each point's output,
            input_: (n_point,) of its input,
            position: (n_point,) and of its frequency in the response.
        """
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        total = np.zeros((w.size, w.size), dtype=np.complex128)
        for kernel, grid, spacing in self._kernels(o, i, w):
            for a in np.unique(o):
                for b in np.unique(o):
                    block = (kernel[o == a] * self._spectrum(a, b, grid)) @ kernel[o == b].conj().T
                    total[np.ix_(o == a, o == b)] += block * (spacing / (4.0 * np.pi))
        total = 0.5 * (total + total.conj().T)
        if self.bias is None:
            return total
        return total + bias_covariance(self.bias, self.frequency, o, i, w)

    def variance(
        self,
        output: Sequence[int] | NDArray[np.intp],
        input_: Sequence[int] | NDArray[np.intp],
        position: Sequence[int] | NDArray[np.intp],
    ) -> NDArray[np.float64]:
        """Return E|dH_k|^2 of points, (n_point,) each; arguments as for `covariance`."""
        o, i, w = (np.asarray(index, dtype=np.intp) for index in (output, input_, position))
        total = np.zeros(w.size)
        for kernel, grid, spacing in self._kernels(o, i, w):
            power = np.stack([np.real(self._spectrum(a, a, grid)) for a in o])
            total += np.sum(np.abs(kernel) ** 2 * power, axis=1) * (spacing / (4.0 * np.pi))
        return total if self.bias is None else total + self.bias[o, i, w] ** 2

    def minus(self, other: "Scatter") -> "Scatter":
        """Return the scatter of the difference of two estimates from the same records."""
        taken = tuple(replace(one, share=-one.share) for one in other.windows)
        known = [one for one in (self.bias, other.bias) if one is not None]
        bias = np.sqrt(sum(one**2 for one in known)) if known else None
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
                    lobes[key] = _lobe(self.frequency[distinct, None] - grid, one.length)
                phases = self._windowed(one, flight, o, i, w, grid)
                phases *= lobes[key][which]
                kernel += phases
            yield kernel, grid, spacing

    def _windowed(
        self,
        window: WindowWeights,
        flight: int,
        o: NDArray[np.intp],
        i: NDArray[np.intp],
        w: NDArray[np.intp],
        grid: NDArray[np.float64],
    ) -> NDArray[np.complex128]:
        """Return K of one flight's windows of one length but for the lobe, (n_point, n_grid)."""
        mine = window.flight == flight
        half = 0.5 * window.length
        middle = np.exp(1j * np.outer(window.start[mine] + half, grid))
        turned = window.share[o, i, w] * np.exp(-1j * half * self.frequency[w])
        return (window.weight[:, :, mine][w, i] * turned[:, None]) @ middle

    def _spectrum(
        self, first: int, second: int, grid: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        cross = self.noise[:, first, second]
        return np.interp(grid, self.frequency, cross)


def _lobe(offset: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return the transform of a Hann window around its own middle, real."""
    bins = offset * (length / (2.0 * np.pi))
    # sinc(x) / (1 - x^2) with its limit 1/2 at x = 1.
    near = np.abs(np.abs(bins) - 1.0) < 1e-6
    safe = np.where(near, 0.0, bins)
    shape = np.where(near, 0.5, np.sinc(safe) / (1.0 - safe**2))
    return np.where(np.abs(bins) > _LOBES, 0.0, 0.5 * length * shape)
