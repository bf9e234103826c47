"""CIFER's estimator: Hann windows of several lengths, conditioned spectra, their composite."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.responses.composite import Composite, compose, composite_noise, window_lengths
from helisim.ident.responses.conditioning import condition, cross_control
from helisim.ident.responses.estimate import Estimate
from helisim.ident.responses.local import Local
from helisim.ident.responses.local_choice import smoothed
from helisim.ident.responses.scatter import Scatter, WindowWeights
from helisim.ident.responses.spectra import cross_spectra
from helisim.records.record import FlightRecord

_NEIGHBOURS = 0.15
"""Over which share of the frequency the windows' systematic error is averaged."""

_FLOOR = 0.005**2
"""Squared relative differences with a smaller variance are equally well known."""


class Windows:
    """Spectra of records over windows of several lengths, for any responses between signals.

    Args:
        records: of the flights, each with all signals.
        names: of the signals.
        frequency: (n_freq,) rad/s.
        windows: lengths, s.
        overlap: share of a window that the next one covers at least.
    """

    def __init__(
        self,
        records: Sequence[FlightRecord],
        names: Sequence[str],
        frequency: NDArray[np.float64],
        *,
        windows: tuple[float, ...],
        overlap: float,
    ) -> None:
        self.windows = windows
        self._durations = tuple(record.duration for record in records)
        self._frequency = frequency
        self._local = Local(records, names, frequency)
        self._spectra = cross_spectra(records, names, frequency, windows=windows, overlap=overlap)

    def cross_control(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the coherence between signals, (n_name, n_name, n_freq).

        Averaged over the window lengths: the long ones alone have too few averages.
        """
        return np.mean([cross_control(one, names) for one in self._spectra], axis=0)

    def estimate(
        self,
        inputs: Sequence[str],
        outputs: Sequence[str],
        others: Sequence[str],
        reference: Sequence[str],
    ) -> Estimate:
        """Return the composite response, and how its errors hang together.

        What windows smear is what the composite differs from the local estimate by, beyond chance.
        """
        each = [condition(one, inputs, outputs, others, reference or None) for one in self._spectra]
        composite = compose(each)
        scatter = Scatter(
            frequency=self._frequency,
            windows=tuple(
                WindowWeights(one.window, one.start, one.flight, conditioned.weight, share)
                for one, conditioned, share in zip(self._spectra, each, composite.share)
            ),
            durations=self._durations,
            noise=composite_noise(each),
        )
        local = self._local.estimate(inputs, outputs, others, reference)
        bias = self._leakage(composite, local)
        relative = bias / np.maximum(np.abs(composite.response), 1e-300)
        return Estimate(
            response=composite.response,
            coherence=composite.coherence,
            multiple=composite.multiple,
            random_error=np.sqrt(composite.random_error**2 + 0.5 * relative**2),
            scatter=replace(scatter, bias=bias),
        )

    def _leakage(self, composite: Composite, local: Estimate) -> NDArray[np.float64]:
        """Return the size of the windows' systematic error, (n_out, n_in, n_freq)."""
        size = np.maximum(np.abs(composite.response), 1e-300)
        gap = (np.abs(composite.response - local.response) / size) ** 2
        chance = 2.0 * np.maximum(composite.random_error, local.random_error) ** 2
        counted = 1.0 / (chance + _FLOOR) ** 2
        excess = smoothed(gap - chance, self._frequency, counted, _NEIGHBOURS)
        return np.sqrt(np.maximum(excess, 0.0)) * size


def chosen_windows(
    records: Sequence[FlightRecord],
    band: tuple[float, float],
    windows: float | Sequence[float] | None,
) -> tuple[float, ...]:
    """Return the window lengths asked for, or those of the published rules.

    Raises:
        InputError: a length isn't positive, or doesn't resolve the band's lower edge.
        IdentificationError: a window doesn't fit into a record, or the records are too short.
    """
    durations = [len(record) * record.sample_time for record in records]
    if windows is None:
        return window_lengths(durations, band)
    lengths = (windows,) if isinstance(windows, int | float) else tuple(windows)
    longest = max(lengths, default=0.0)
    if not lengths or not all(math.isfinite(length) and length > 0.0 for length in lengths):
        raise InputError(f"windows are {lengths}, expected positive lengths in s")
    if longest > min(durations):
        raise IdentificationError(
            f"a window of {longest:.4g} s does not fit into a record of {min(durations):.4g} s; "
            "shorten the window (--windows S) or leave the record out (--min-duration S)"
        )
    if 2.0 * np.pi / longest > band[0] * (1.0 + 1e-9):
        raise InputError(
            f"the longest window, {longest:.4g} s, resolves frequencies from "
            f"{2.0 * np.pi / longest:.4g} rad/s, but the band starts at {band[0]:.4g} rad/s; "
            "lengthen the window (--windows S) or raise the band's lower edge (--band LO HI)"
        )
    return tuple(float(length) for length in lengths)
