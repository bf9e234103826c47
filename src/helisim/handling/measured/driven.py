"""Responses of many signals to what was injected, and samples of them by their errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from helisim.base.value import Value
from helisim.handling.measured.margins import Cut, error_root
from helisim.ident.frf import frequency_response
from helisim.ident.scatter import LocalScatter
from helisim.records.record import FlightRecord

Complex = NDArray[np.complex128]


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
        off = np.sqrt(0.5) * pairs(count, self.root.shape[1], seed) @ self.root.T
        return self.response + off.reshape(count, *self.response.shape)


def pairs(count: int, size: int, seed: int) -> Complex:
    """Return complex normal numbers, (count, size), in pairs of opposite sign; 1 in each part."""
    normal = np.random.default_rng(seed).standard_normal((2, (count + 1) // 2, size))
    one = normal[0] + 1j * normal[1]
    return np.concatenate([one, -one])[:count]


def estimate_driven(
    records: Sequence[FlightRecord],
    drives: Sequence[str],
    outputs: Sequence[str],
    band: tuple[float, float],
    late: Mapping[str, float],
    cuts: Sequence[Cut] = (),
) -> list[Driven]:
    """Estimate what signals answer to each that was injected, the others' effect taken out.

    What was injected is outside the loop and known without error, so that no feedback biases it.

    Args:
        records: all with these channels.
        drives: what was injected.
        outputs: the signals that answer.
        band: rad/s.
        late: channel -> s, by which its record is late; 0 if not given.
        cuts: whose two sides differ by what was injected.

    Raises:
        IdentificationError: the records are too short, or what was injected moved as one.
    """
    found = frequency_response(records, inputs=drives, outputs=outputs, band=band)
    scatter, alike = found.scatter, _alike(found.outputs, cuts)
    assert isinstance(scatter, LocalScatter)  # of the default estimator
    driven = []
    for place, drive in enumerate(found.inputs):
        lag = np.array([late.get(name, 0.0) - late.get(drive, 0.0) for name in found.outputs])
        turn = np.exp(1j * np.outer(lag, found.frequency))
        response = found.response[:, place]
        root = error_root(scatter, place, alike) * turn.reshape(-1, 1)
        response = response * turn
        driven.append(Driven(drive, found.outputs, found.frequency, response, root, found.flags))
    return driven


def _alike(outputs: Sequence[str], cuts: Sequence[Cut]) -> NDArray[np.intp]:
    """Return a number for each output, equal for the two sides of a cut."""
    number = {name: place for place, name in enumerate(outputs)}
    for cut in cuts:
        if set(cut.outputs) <= set(outputs):
            number |= dict.fromkeys(cut.outputs, number[cut.outputs[0]])
    return np.array([number[name] for name in outputs], dtype=np.intp)
