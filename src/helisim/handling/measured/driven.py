"""Responses of many signals to what was injected, and samples of them by their errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from helisim.ident.responses.estimate import ErrorModel
from helisim.ident.responses.frf import frequency_response
from helisim.ident.responses.local_scatter import LocalScatter
from helisim.records.record import FlightRecord
from helisim.records.value import Value

Complex = NDArray[np.complex128]

_RIDGE = 1e-10
"""Of a covariance, over its largest variance: rounding leaves no eigenvalue below zero."""


@dataclass(frozen=True, eq=False)
class Driven(Value):
    """What signals answer to one that was injected, everything else that was injected held.

    Attributes:
        drive: what was injected.
        outputs: the signals that answer.
        frequency: (n_freq,) rad/s.
        response: (n_out, n_freq).
        root: (n_out n_freq, n_out n_freq) a root R of the errors' covariance, R R*.
        flags: what is to be doubted.
    """

    drive: str
    outputs: tuple[str, ...]
    frequency: NDArray[np.float64]
    response: Complex
    root: Complex = field(repr=False)
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("frequency", "response", "root"):
            array = np.array(getattr(self, name))
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def drawn(self, count: int, seed: int) -> Complex:
        """Return responses as they may as well be, (count, n_out, n_freq), in pairs about this.

        Args:
            count: how many, even.
            seed: of the draws.
        """
        rng = np.random.default_rng(seed)
        normal = rng.standard_normal((2, self.root.shape[1], (count + 1) // 2))
        off = (self.root @ (normal[0] + 1j * normal[1]) * np.sqrt(0.5)).T
        off = np.concatenate([off, -off])[:count].reshape(count, *self.response.shape)
        return self.response + off


def estimate_driven(
    records: Sequence[FlightRecord],
    drives: Sequence[str],
    outputs: Sequence[str],
    band: tuple[float, float],
    late: Mapping[str, float],
) -> list[Driven]:
    """Estimate what signals answer to each that was injected, the others' effect taken out.

    What was injected is outside the loop and known without error, so that no feedback biases it.

    Args:
        records: all with these channels.
        drives: what was injected.
        outputs: the signals that answer.
        band: rad/s.
        late: channel -> s, by which its record is late; 0 if not given.

    Raises:
        IdentificationError: the records are too short, or what was injected moved as one.
    """
    found = frequency_response(records, inputs=drives, outputs=outputs, band=band)
    scatter = found.scatter
    assert scatter is not None
    driven = []
    for place, drive in enumerate(found.inputs):
        lag = np.array([late.get(name, 0.0) - late.get(drive, 0.0) for name in found.outputs])
        turn = np.exp(1j * np.outer(lag, found.frequency))
        root = _root(scatter, place, turn.shape) * turn.reshape(-1, 1)
        response = found.response[:, place] * turn
        driven.append(Driven(drive, found.outputs, found.frequency, response, root, found.flags))
    return driven


def _root(scatter: ErrorModel, place: int, shape: tuple[int, int]) -> Complex:
    """Return a root of the covariance between all outputs and frequencies for one input."""
    output, position = np.indices(shape).reshape(2, -1)
    covariance = _smooth(scatter).covariance(output, np.full(output.size, place), position)
    size = np.sqrt(np.maximum(np.real(np.diagonal(covariance)), 1e-300))
    related = covariance / np.outer(size, size)
    np.fill_diagonal(related, 1.0 + _RIDGE)
    try:
        return size[:, None] * np.linalg.cholesky(related)
    except np.linalg.LinAlgError:
        value, vector = np.linalg.eigh(related)
        return size[:, None] * vector * np.sqrt(np.maximum(value, 0.0))


def _smooth(scatter: ErrorModel) -> ErrorModel:
    """Return the errors with what the choice of widths adds shared by neighbours, as the bias is.

    Each point for itself it would make curves rough, and rough curves cross what smooth don't.
    """
    if not isinstance(scatter, LocalScatter) or scatter.spread is None:
        return scatter
    return replace(scatter, bias=np.hypot(scatter.bias, scatter.spread), spread=None)
