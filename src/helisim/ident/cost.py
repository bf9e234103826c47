"""Cost of a model against measured points, as residuals with their exact Jacobian.

    J = sum over responses (20/n_w) sum_w W_g [ (dB error)^2 + 0.01745 (deg error)^2 ] ,
    W_g = [1.58 (1 - exp(-g2))]^2

(Tischler and Remple). The average J is this sum over the number of responses.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Real
from helisim.base.errors import IdentificationError, InputError, check_known
from helisim.base.settings import Limits, convert
from helisim.base.units import DB_PER_NEPER
from helisim.ident.evaluate import Sample, Sensitivity
from helisim.ident.response import USABLE_COHERENCE, FrequencyResponse
from helisim.ident.structure import Structure

PHASE_WEIGHT = 0.01745
"""Weight of a squared phase error in deg^2 against a squared magnitude error in dB^2."""
_FEWEST = 5  # coherent points for a response to be used
_PER_RADIAN = float(np.rad2deg(1.0) * np.sqrt(PHASE_WEIGHT))  # what a radian counts; a dB is 1
_HOPELESS = 1e3  # residual of an undefined model: worse than that of any other
# Relative error (rms of its real or imaginary part) below which no point is trusted, however quiet
# the record: windows smear responses of lightly damped modes by 0.05 to 0.3 %, and the base models
# with true parameters are 0.1 to 0.7 % rms from the JR700's exact responses, to 1 % from the
# Blade 360's. So it is the median of what a structure leaves out, before residuals tell of it, too
FLOOR = 0.005

Band = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Points:
    """Measured points of a fit, response after response, (n_point,) each.

    `frequency` is in rad/s, `weight` W_g 20 / n_w, `bands` in rad/s; `output`, `input` and `pair`
    are indices. `covariance` is (n_point, n_point) E[d_k d_l*] of the relative errors d = dH/H, or
    None; `gap` is (n_gap, n_point), the estimate less others of the same records, relative.
    """

    pairs: tuple[str, ...]
    dropped: tuple[str, ...]
    bands: tuple[Band, ...]
    frequency: Real
    measured: NDArray[np.complex128]
    weight: Real
    output: NDArray[np.intp]
    input: NDArray[np.intp]
    pair: NDArray[np.intp]
    covariance: NDArray[np.complex128] | None
    gap: NDArray[np.complex128]

    @property
    def deviation(self) -> Real:
        """Standard deviation of each point's relative error, real or imaginary part, (n_point,).

        Zero if the errors are unknown.
        """
        return (
            np.zeros(self.frequency.size)
            if self.covariance is None
            else np.sqrt(0.5 * np.real(np.diagonal(self.covariance)))
        )


def select(
    frf: FrequencyResponse,
    structure: Structure,
    *,
    band: Band | Mapping[str, Band] | None,
    responses: Sequence[str] | None,
    count: int,
) -> Points:
    """Choose log-spaced points of each coherent response for a fit.

    Raises UnknownNameError; InputError for a response that is zero by the structure;
    IdentificationError if none is coherent enough.
    """
    wanted = _wanted(structure, responses)
    places = {
        name: frf.index(structure.outputs[o], structure.inputs[i])
        for name, (o, i) in wanted.items()
        if name in structure.connected
    }
    limits = _limits(band, wanted)
    chosen, best = {}, []
    for name, (o, i) in places.items():
        inside = within(frf.frequency, limits[name])
        usable = np.flatnonzero(inside & coherent(frf, o, i))
        if usable.size >= _FEWEST:
            chosen[name] = _log_spaced(frf.frequency, usable, count)
        most = float(np.max(frf.coherence[o, i], where=inside, initial=0.0))
        best.append(f"{name} at most {most:.2f} at {int(inside.sum())} frequencies")
    if not chosen:
        raise IdentificationError(
            f"no response has {_FEWEST} points with a coherence of {USABLE_COHERENCE} in its band "
            f"(frequency response: {frf.frequency[0]:.4g} to {frf.frequency[-1]:.4g} rad/s): "
            f"{'; '.join(best)}; widen the band, add sweeps, or raise the sweep's amplitude",
            remedy="band",
        )
    kept, at = tuple(chosen), np.concatenate(list(chosen.values()))

    def each(values: Iterable[float], dtype: type = np.intp) -> NDArray:
        return np.repeat(np.array(list(values), dtype), [k.size for k in chosen.values()])

    o, i = (each(places[name][axis] for name in kept) for axis in (0, 1))
    measured = frf.response[o, i, at]
    covariance, gap = None, np.zeros((0, measured.size), dtype=np.complex128)
    if frf.scatter is not None:
        covariance = frf.scatter.covariance(o, i, at) / np.outer(measured, measured.conj())
        gap = (frf.scatter.gap + np.zeros(frf.scatter.bias.shape))[..., o, i, at]
        gap = gap.reshape(-1, measured.size) / measured
    share = each((20.0 / k.size for k in chosen.values()), np.float64)
    return Points(
        pairs=kept,
        dropped=tuple(name for name in wanted if name not in chosen),
        bands=tuple(
            (float(frf.frequency[k[0]]), float(frf.frequency[k[-1]])) for k in chosen.values()
        ),
        frequency=frf.frequency[at],
        measured=measured,
        weight=share * coherence_weight(frf.coherence[o, i, at]),
        output=each(wanted[name][0] for name in kept),
        input=each(wanted[name][1] for name in kept),
        pair=each(range(len(kept))),
        covariance=covariance,
        gap=gap,
    )


def within(frequency: Real, band: Band) -> NDArray[np.bool_]:
    """Return which frequencies, (n_freq,), a band holds but for rounding."""
    return (frequency >= band[0] * (1 - 1e-9)) & (frequency <= band[1] * (1 + 1e-9))


def coherence_weight(coherence: Real) -> Real:
    """Return W_g of the cost, in the shape of the coherences."""
    return (1.58 * (1.0 - np.exp(-coherence))) ** 2


def coherent(frf: FrequencyResponse, output: int, input: int) -> NDArray[np.bool_]:
    """Return where a response can be fitted, (n_freq,): coherent and not zero."""
    return frf.usable()[output, input] & (frf.response[output, input] != 0.0)


def enough(frf: FrequencyResponse, output: str, input: str) -> bool:
    """Return whether a response has enough coherent points for a fit. Raises UnknownNameError."""
    return int(np.count_nonzero(coherent(frf, *frf.index(output, input)))) >= _FEWEST


def _wanted(structure: Structure, responses: Sequence[str] | None) -> dict[str, tuple[int, int]]:
    pairs = structure.pairs
    if responses is None:
        return pairs
    names = (responses,) if isinstance(responses, str) else tuple(responses)
    check_known(f"response of {structure.name!r}", names, pairs)
    for name in names:
        if name not in structure.connected:
            output, _, input_ = name.partition("/")
            raise InputError(
                f"{name} is zero in {structure.name!r}, whatever its parameters are: no entry of "
                f"its matrices leads from {input_} to {output}; leave the response out, or add "
                f"what couples them; there are {', '.join(sorted(structure.connected))}",
                remedy="responses",
            )
    return {name: pairs[name] for name in names}


def _limits(band: Band | Mapping[str, Band] | None, wanted: Mapping[str, Any]) -> dict[str, Band]:
    bands = band if isinstance(band, Mapping) else dict.fromkeys(wanted, band)
    found = dict.fromkeys(wanted, (0.0, math.inf))
    check_known("response with a band", bands, wanted)
    for name, edges in bands.items():
        if edges is not None:
            low, high = convert(tuple[float, float], edges, "band", Limits(finite=False))
            if not 0.0 <= low < high:
                raise InputError(f"band is {low} to {high} rad/s, expected 0 <= lower < upper")
            found[name] = (low, high)
    return found


def _log_spaced(frequency: Real, usable: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    place = np.log(frequency[usable])
    targets = np.linspace(place[0], place[-1], count)
    right = np.clip(np.searchsorted(place, targets), 1, place.size - 1)
    nearer = np.where(targets - place[right - 1] < place[right] - targets, right - 1, right)
    return usable[np.unique(nearer)]


class Cost:
    """Residuals of a structure over points as a function of its free parameters.

    `log` residuals are J's; `relative` ones are (H_model - H) / |H|; `standardised` ones are over
    each point's standard deviation, `spread`, where the errors are known (`noisy`).
    """

    def __init__(self, structure: Structure, points: Points) -> None:
        self.structure = structure
        self.points = points
        self.noisy = bool(np.any(points.deviation > 0.0))
        self.spread = np.hypot(points.deviation, FLOOR)
        self.names = [parameter.name for parameter in structure.free]
        self.limits = np.array([one.limits for one in structure.free]).reshape(-1, 2).T
        self._where = Sensitivity(structure.program, points.frequency, points.output, points.input)
        self._start = structure.program.ordered(structure.starts)
        self._root = np.sqrt(points.weight)
        self._firsts = np.flatnonzero(np.diff(points.pair, prepend=-1))
        self._cached: tuple[bytes, Sample] | None = None

    def values(self, x: Real) -> dict[str, float]:
        """Return all parameters by name for the free ones x, (n_free,)."""
        return {**self.structure.starts, **dict(zip(self.names, x.tolist()))}

    def ratio(self, x: Real) -> tuple[NDArray[np.complex128], NDArray]:
        """Return model over measured response, (n_point,), and its slope, (n_free, n_point)."""
        return self._ratio(x), self._sample(x).slope(1.0 / self.points.measured).copy()

    def _sample(self, x: Real) -> Sample:
        key = x.tobytes()
        if self._cached is None or self._cached[0] != key:
            self._cached = key, self._where.at(self._parameters(x))
        return self._cached[1]

    def _parameters(self, x: Real) -> Real:
        """Return all parameters in the structure's order, (n_parameter,)."""
        parameters = self._start.copy()
        parameters[self.structure.program.free] = x
        return parameters

    def _ratio(self, x: Real) -> NDArray[np.complex128]:
        return self._sample(x).response / self.points.measured

    def _jacobian(self, x: Real, scale: NDArray, imaginary: float = 1.0) -> Real:
        slope = self._sample(x).slope(scale)
        half = scale.size
        # columns contiguous, for the decompositions of a search
        columns = np.empty((len(self.names), 2 * half))
        columns[:, :half] = slope.real
        np.multiply(slope.imag, imaginary, out=columns[:, half:])
        if not np.all(np.isfinite(columns)):
            columns[:] = 0.0
        return columns.T

    def log(self, x: Real, *, unwrap: bool = True) -> Real:
        """Return the residuals of x, (n_free,), whose squares sum to J, (2 n_point,)."""
        z = self._ratio(x)
        if not np.all(np.isfinite(z)) or np.any(z == 0.0):
            return np.full(2 * z.size, _HOPELESS)
        phase = self._unwrapped(z) if unwrap else np.angle(z)
        decibel = DB_PER_NEPER * np.log(np.abs(z))
        return np.concatenate([self._root * decibel, self._root * (_PER_RADIAN * phase)])

    def log_jacobian(self, x: Real) -> Real:
        """Return the derivatives of `log` by x, (n_free,): (2 n_point, n_free)."""
        with np.errstate(all="ignore"):
            scale = DB_PER_NEPER * self._root / self._sample(x).response
        return self._jacobian(x, scale, _PER_RADIAN / DB_PER_NEPER)

    def relative(self, x: Real) -> Real:
        """Return the relative errors of x, (n_free,), in dB of a small one, (2 n_point,)."""
        return self._parts(DB_PER_NEPER * self._root * (self._ratio(x) - 1.0))

    def relative_jacobian(self, x: Real) -> Real:
        """Return the derivatives of `relative` by x, (n_free,): (2 n_point, n_free)."""
        return self._jacobian(x, DB_PER_NEPER * self._root / self.points.measured)

    @property
    def certainty(self) -> Real:
        """Weight of a squared relative error in the search for a start, (n_point,)."""
        return 1.0 / self.spread**2 if self.noisy else self.points.weight

    def standardised(self, x: Real) -> Real:
        """Return the relative errors of x, (n_free,), over their deviations, (2 n_point,)."""
        return self._parts((self._ratio(x) - 1.0) / self.spread)

    def standardised_jacobian(self, x: Real) -> Real:
        """Return the derivatives of `standardised` by x, (n_free,): (2 n_point, n_free)."""
        return self._jacobian(x, 1.0 / (self.points.measured * self.spread))

    @staticmethod
    def _parts(errors: NDArray[np.complex128]) -> Real:
        return (
            np.concatenate([errors.real, errors.imag])
            if np.all(np.isfinite(errors))
            else np.full(2 * errors.size, _HOPELESS)
        )

    def jacobian_by(self, x: Real, names: Sequence[str], *, standardised: bool) -> Real:
        """Return derivatives of a residual by parameters that aren't free, (2 n_point, n_name)."""
        at = self.points
        where = Sensitivity(self.structure.program, at.frequency, at.output, at.input, by=names)
        sample = where.at(self._parameters(x))
        relative = sample.slope(1.0 / (at.measured if standardised else sample.response))
        scale = np.tile(1.0 / self.spread, 2) if standardised else self.log_scale()
        return scale[:, None] * np.concatenate([relative.real, relative.imag], axis=1).T

    def log_scale(self) -> Real:
        """Return the factor of `log` on the error of the response's logarithm, (2 n_point,)."""
        return np.concatenate([self._root * DB_PER_NEPER, self._root * _PER_RADIAN])

    def per_response(self, x: Real) -> Real:
        """Return J of each response for x, (n_free,), phase within half a turn, (n_pair,)."""
        residual = self.log(x, unwrap=False) ** 2
        half = self.points.weight.size
        return np.add.reduceat(residual[:half] + residual[half:], self._firsts)

    def _unwrapped(self, z: NDArray[np.complex128]) -> Real:
        phase = np.angle(z)
        turns = np.zeros_like(phase)
        turns[1:] = -np.round(np.diff(phase) / (2.0 * np.pi))
        turns[self._firsts] = 0.0
        turns = np.cumsum(turns)
        turns -= turns[self._firsts][self.points.pair]
        weight = self.points.weight
        total = np.add.reduceat(weight * (phase / (2.0 * np.pi) + turns), self._firsts)
        mean = total / np.add.reduceat(weight, self._firsts)
        return phase + 2.0 * np.pi * (turns - np.round(mean)[self.points.pair])
