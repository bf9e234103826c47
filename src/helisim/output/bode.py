"""What a Bode plot shows of a response: decibels, degrees, and the unit of their ratio."""

import numpy as np
from numpy.typing import NDArray

from helisim.ident import FrequencyResponse
from helisim.units import decibel

DEGREES = (0.5, 1.0, 2.0, 5.0, 15.0, 45.0, 90.0, 180.0, 360.0)
"""Steps between ticks of a phase."""


def decibels(line: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the gain, dB, (n_freq,), of a response (n_freq,); a zero is drawn at -240 dB."""
    return decibel(np.maximum(np.abs(line), 1e-12))


def phase_degrees(line: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the phase, degrees, (n_freq,), of a response (n_freq,), without jumps."""
    return np.rad2deg(np.unwrap(np.angle(line)))


def on_turn(phase: NDArray[np.float64], reference: float) -> NDArray[np.float64]:
    """Move a phase in degrees by whole turns to lie around a reference; (n_freq,) each."""
    return phase + 360.0 * np.round((reference - middle(phase)) / 360.0)


def middle(phase: NDArray[np.float64]) -> float:
    """Return the median of a phase (n_freq,), degrees."""
    return float(np.median(phase))


def ratio_unit(data: FrequencyResponse | None, output: str, input_: str) -> str:
    """Return the unit of output over input; "SI" where no response tells it."""
    if data is None:
        return "SI"
    o, i = data.index(output, input_)
    over, under = data.output_units[o] or "1", data.input_units[i] or "1"
    return over if under == "1" else f"{over} / {under}"
