"""Selects the measured points of a fit: some log-spaced ones of each coherent response."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident.model.paths import connected
from helisim.ident.model.structure import Structure
from helisim.ident.response import USABLE_COHERENCE, FrequencyResponse

PHASE_WEIGHT = 0.01745
"""Weight of a squared phase error in deg^2 against a squared magnitude error in dB^2."""

_FEWEST = 5
"""A response with fewer coherent points is left out: it has no shape."""

Band = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Points:
    """The measured points of a fit, response after response.

    Attributes:
        pairs: names of the responses that are used, such as "p/lat".
        dropped: names of those that are not coherent enough, or zero by the structure.
        bands: lowest and highest frequency of each response that is used, rad/s.
        frequency: (n_grid,) rad/s, all frequencies that occur.
        measured: (n_point,) response.
        weight: (n_point,) W_g 20 / n_w of the cost.
        output, input, position: (n_point,) where a point is in the model's response.
        pair: (n_point,) which of `pairs` it belongs to.
        covariance: (n_point, n_point) E[d_k d_l*] of the relative errors d = dH/H; None where
            the records are not known.
    """

    pairs: tuple[str, ...]
    dropped: tuple[str, ...]
    bands: tuple[Band, ...]
    frequency: NDArray[np.float64]
    measured: NDArray[np.complex128]
    weight: NDArray[np.float64]
    output: NDArray[np.intp]
    input: NDArray[np.intp]
    position: NDArray[np.intp]
    pair: NDArray[np.intp]
    covariance: NDArray[np.complex128] | None = None

    @property
    def deviation(self) -> NDArray[np.float64] | None:
        """Standard deviation of each point's relative error, real or imaginary part, (n_point,)."""
        if self.covariance is None:
            return None
        return np.sqrt(0.5 * np.real(np.diagonal(self.covariance)))


def select(
    frf: FrequencyResponse,
    structure: Structure,
    *,
    band: Band | Mapping[str, Band] | None,
    responses: Sequence[str] | None,
    count: int,
) -> Points:
    """Choose the points.

    Raises:
        UnknownNameError: a signal or response does not exist.
        InputError: a response that was asked for is zero by the structure.
        IdentificationError: no response is coherent enough.
    """
    wanted = _wanted(structure, responses)
    limits = {name: _limits(band, name, wanted) for name in wanted}
    kept, chosen = [], []
    reached = connected(structure)
    for name in wanted:
        if name not in reached:
            continue
        o, i = frf.index(*wanted[name])
        low, high = limits[name]
        inside = (frf.frequency >= low * (1 - 1e-9)) & (frf.frequency <= high * (1 + 1e-9))
        # A response of zero, such as an exact one's, has neither decibels nor a phase.
        usable = np.flatnonzero(inside & frf.usable()[o, i] & (frf.response[o, i] != 0.0))
        if usable.size >= _FEWEST:
            kept.append(name)
            chosen.append(_log_spaced(frf.frequency, usable, count))
    if not kept:
        raise IdentificationError(_too_incoherent(frf, wanted, limits))
    places = [frf.index(*wanted[name]) for name in kept]
    grid, position = np.unique(np.concatenate(chosen), return_inverse=True)
    coherence = np.concatenate([frf.coherence[o, i, k] for (o, i), k in zip(places, chosen)])
    measured = np.concatenate([frf.response[o, i, k] for (o, i), k in zip(places, chosen)])
    share = np.concatenate([np.full(k.size, 20.0 / k.size) for k in chosen])
    return Points(
        pairs=tuple(kept),
        dropped=tuple(name for name in wanted if name not in kept),
        bands=tuple((float(frf.frequency[k[0]]), float(frf.frequency[k[-1]])) for k in chosen),
        frequency=frf.frequency[grid],
        measured=measured,
        weight=share * (1.58 * (1.0 - np.exp(-coherence))) ** 2,
        output=_repeat([structure.outputs.index(wanted[name][0]) for name in kept], chosen),
        input=_repeat([structure.inputs.index(wanted[name][1]) for name in kept], chosen),
        position=position,
        pair=_repeat(range(len(kept)), chosen),
        covariance=_covariance(frf, places, chosen, measured),
    )


def enough(frf: FrequencyResponse, output: str, input_: str) -> bool:
    """Return whether a response has enough coherent points for a fit. Raises UnknownNameError."""
    at = frf.index(output, input_)
    return int(np.count_nonzero(frf.usable()[at] & (frf.response[at] != 0.0))) >= _FEWEST


def _covariance(
    frf: FrequencyResponse,
    places: list[tuple[int, int]],
    chosen: list[NDArray[np.intp]],
    measured: NDArray[np.complex128],
) -> NDArray[np.complex128] | None:
    """Return the covariance of the points' relative errors, where it is known."""
    if frf.scatter is None:
        return None
    absolute = frf.scatter.covariance(
        _repeat([o for o, _ in places], chosen),
        _repeat([i for _, i in places], chosen),
        np.concatenate(chosen),
    )
    return absolute / np.outer(measured, measured.conj())


def _repeat(values: Sequence[int] | range, chosen: list[NDArray[np.intp]]) -> NDArray[np.intp]:
    return np.repeat(np.array(values, dtype=np.intp), [k.size for k in chosen])


def _wanted(structure: Structure, responses: Sequence[str] | None) -> dict[str, tuple[str, str]]:
    pairs = {
        f"{output}/{input_}": (output, input_)
        for output in structure.outputs
        for input_ in structure.inputs
    }
    if responses is None:
        return pairs
    names = (responses,) if isinstance(responses, str) else tuple(responses)
    for name in names:
        if name not in pairs:
            raise UnknownNameError(f"response of {structure.name!r}", name, pairs)
        if name not in connected(structure):
            output, input_ = pairs[name]
            raise InputError(
                f"{name} is zero in {structure.name!r}, whatever its parameters are: no entry of "
                f"its matrices leads from {input_} to {output}; leave the response out "
                f"(--responses), or add what couples them; there are "
                f"{', '.join(sorted(connected(structure)))}"
            )
    return {name: pairs[name] for name in names}


def _limits(
    band: Band | Mapping[str, Band] | None, name: str, wanted: Mapping[str, object]
) -> Band:
    if isinstance(band, Mapping):
        for key in band:
            if key not in wanted:
                raise UnknownNameError("response with a band", key, wanted)
        band = band.get(name)
    if band is None:
        return 0.0, math.inf
    try:
        low, high = (float(edge) for edge in band)
    except (TypeError, ValueError):
        raise InputError(f"band is {band!r}, expected two frequencies in rad/s") from None
    if not 0.0 <= low < high:
        raise InputError(f"band is {low} to {high} rad/s, expected 0 <= lower < upper")
    return low, high


def _log_spaced(
    frequency: NDArray[np.float64], usable: NDArray[np.intp], count: int
) -> NDArray[np.intp]:
    """Return up to `count` usable grid points, closest to log-spaced ones."""
    place = np.log(frequency[usable])
    targets = np.linspace(place[0], place[-1], count)
    right = np.clip(np.searchsorted(place, targets), 1, place.size - 1)
    nearer = np.where(targets - place[right - 1] < place[right] - targets, right - 1, right)
    return usable[np.unique(nearer)]


def _too_incoherent(
    frf: FrequencyResponse,
    wanted: Mapping[str, tuple[str, str]],
    limits: Mapping[str, Band],
) -> str:
    best_by_name = []
    for name, pair in wanted.items():
        o, i = frf.index(*pair)
        low, high = limits[name]
        inside = (frf.frequency >= low) & (frf.frequency <= high)
        best = float(np.max(frf.coherence[o, i], where=inside, initial=0.0))
        best_by_name.append(f"{name} at most {best:.2f} at {int(inside.sum())} frequencies")
    return (
        f"no response has {_FEWEST} points with a coherence of {USABLE_COHERENCE} in its band "
        f"(frequency response: {frf.frequency[0]:.4g} to {frf.frequency[-1]:.4g} rad/s): "
        f"{'; '.join(best_by_name)}; widen the band (--band LO HI), add sweeps, or raise the "
        "sweep's amplitude"
    )
