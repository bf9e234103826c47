"""What a Bode plot shows of a response: decibels, degrees, and the unit of their ratio."""

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import decibel
from helisim.ident import FrequencyResponse

DEGREES = (0.5, 1.0, 2.0, 5.0, 15.0, 45.0, 90.0, 180.0, 360.0)
"""Steps between ticks of a phase."""

_HIGHEST = 135.0
"""Degrees: where a phase starts at most, less than a turn lower at least. So an integrator starts
at -90, two at -180, and a lead at 90."""


def decibels(line: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the gain, dB, (n_freq,), of a response (n_freq,); a zero is drawn at -240 dB."""
    return decibel(np.maximum(np.abs(line), 1e-12))


def phase_degrees(
    line: NDArray[np.complex128], good: NDArray[np.bool_] | None = None
) -> NDArray[np.float64]:
    """Return the phase, degrees, (n_freq,), without jumps, from -225 to 135 where it starts.

    Args:
        line: (n_freq,) the response.
        good: (n_freq,) where it is coherent: it starts at the first such point, and is followed
            from one to the next; between them each point lies where it is nearest to their line.
            Everywhere by default.
    """
    angle = np.rad2deg(np.angle(line))
    sure = np.flatnonzero(np.ones(angle.size, dtype=np.bool_) if good is None else good)
    if sure.size == 0:
        sure = np.arange(angle.size)
    followed = np.unwrap(angle[sure], period=360.0)
    followed -= 360.0 * np.ceil((followed[0] - _HIGHEST) / 360.0)
    return nearest_turn(angle, np.interp(np.arange(angle.size), sure, followed))


def nearest_turn(phase: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a phase, degrees, by whole turns nearest to another, each of (n_freq,) points."""
    return phase + 360.0 * np.round((other - phase) / 360.0)


def beside(
    frequency: NDArray[np.float64],
    line: NDArray[np.complex128],
    other: NDArray[np.float64],
    phase: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the phase of a response, degrees, moved as a whole to the turn of another phase.

    Args:
        frequency: (n_freq,) of the response, rad/s.
        line: (n_freq,) the response.
        other: (m_freq,) frequencies of the other phase, rad/s, none at least.
        phase: (m_freq,) degrees, of each of them.
    """
    own = phase_degrees(line)
    if other.size == 0:
        return own
    apart = phase - np.interp(np.log(other), np.log(frequency), own)
    return own + 360.0 * np.round(np.median(apart) / 360.0)


def ratio_unit(data: FrequencyResponse | None, output: str, input_: str) -> str:
    """Return the unit of output over input; "SI" where no response tells it."""
    if data is None:
        return "SI"
    o, i = data.index(output, input_)
    over, under = data.output_units[o] or "1", data.input_units[i] or "1"
    return over if under == "1" else f"{over} / {under}"
