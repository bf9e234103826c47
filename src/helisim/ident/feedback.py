"""What a response leaves of an output, and how that comes back in what drives: feedback.

What is left, E = Y - H D, is gusts and noise. Where they go round a loop into the drive, S_ed/S_dd
of it goes with D: the more, the less the drive is swept there (R. Rigobon, Review of Economics and
Statistics 85, 2003). So E = D a + q D b is solved by least squares over cells of time around a
frequency, with q = 1 / (1 + |D|^2 / P), P the drive's median power. Without feedback b is 0,
whatever the drive does; -a is the bias of such an H.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from helisim.base.arrays import Complex, Real

# Of a cell: its Hann window passes a third of the frequency either way; cells that begin within one
_PERIODS, _OVERLAP = 3.0, 4
# of Hann windows 1/4, 1/2 and 3/4 of their length apart: the correlation of white noise in them
_CORRELATION = (1.0, 0.659, 0.167, 0.0075)
# of such cells: 1 over the sum of the correlations' squares, and of their fourth powers
_INDEPENDENT, _OF_POWERS = 0.52, 0.725
_CELLS_APART = 1.4  # from one frequency to the next: cells of neighbours have little in common
_CELLS, _FAINT = 8, 1e-3  # for each unknown; of a drive's mean power, below which it is at rest


def answered(
    flights: Sequence[tuple[Real, Real, Real]],
    steps: Sequence[float],
    band: tuple[float, float],
    tested: int,
) -> tuple[Real, Real]:
    """Return frequencies, (n_freq,), and how the rest of outputs answers, (n_freq, 4, n_out).

    `flights` are drive, (n_time, n_drive), of which the first `tested` signals count, what the
    response leaves of the outputs, and what it makes of them, (n_time, n_out), `steps` between
    samples in s, `band` in rad/s. Of four numbers the first, surprise, is |b|^2 over its variance,
    by chance 1 on average with an exponential tail; bias is the mean square of what the response's
    bias and this one's error make, over that of what the response makes. The last two are how much
    of what the response makes is in the rest, in power, where it makes more, and that in standard
    deviations by chance.
    """
    n, n_out = flights[0][0].shape[1], flights[0][1].shape[1]
    count = math.log(band[1] / band[0]) / math.log(_CELLS_APART)
    found = []
    for k in range(1, int(count)):  # at an edge half of a cell's lines are beyond the band
        omega = band[0] * _CELLS_APART ** (k + 0.5 * (count % 1.0))
        each = [_cells(np.hstack(one), step, omega) for one, step in zip(flights, steps)]
        d, e, y = np.split(np.concatenate(each), [n, n + n_out], axis=1)
        if len(d) >= _CELLS * (n + tested):
            found.append((omega, *_regressed(d, e, y, [len(one) for one in each], tested)))
    numbers = np.array([one[1:] for one in found]).reshape(-1, 4, n_out)
    return np.array([one[0] for one in found]), numbers


def _cells(signals: Real, step: float, omega: float) -> Complex:
    """Return transforms of Hann windows at a frequency, (n_cell, n_signal)."""
    length = round(_PERIODS * 2.0 * math.pi / (omega * step))
    if length > len(signals):
        return np.zeros((0, signals.shape[1]), dtype=np.complex128)
    place = np.arange(length) + 0.5
    kernel = np.sin(np.pi * place / length) ** 2 * np.exp(-1j * omega * step * place)
    hop = max(length // _OVERLAP, 1)
    windows = sliding_window_view(signals, length, axis=0)[::hop]
    # phases by one clock, so that noise in cells that overlap is alike, and not turned
    turned = np.exp(-1j * omega * step * hop * np.arange(len(windows)))
    return np.asarray(windows @ kernel, np.complex128) * (turned * math.sqrt(step))[:, None]


def _regressed(
    d: Complex, e: Complex, y: Complex, counts: Sequence[int], tested: int
) -> tuple[Real, Real, Real, Real]:
    """Return the four numbers of outputs, (n_out,); cells are of flights in a row."""
    mine, n = d[:, :tested], d.shape[1]
    power = np.abs(mine) ** 2
    usual = np.maximum(np.median(power, axis=0), _FAINT * power.mean(axis=0))
    by = np.hstack([d, mine / (1.0 + power / np.maximum(usual, 1e-300))])
    size = np.sqrt(np.mean(np.abs(by) ** 2, axis=0)) + 1e-300
    gain = np.linalg.pinv(by / size) / size[:, None]
    unit, first = np.zeros(2 * (n + tested,)), 0  # the covariance by white noise of unit power
    for count in counts:
        own = gain[:, first : first + count]
        for lag, alike in enumerate(_CORRELATION[:count]):
            pair = alike * np.real(own[:, lag:] @ own[:, : count - lag].conj().T)
            unit += pair + pair.T if lag else pair
        first += count
    found = gain @ e
    freedom = max(len(d) - float(np.sum(unit * np.real(by.conj().T @ by))), 1.0)
    left = np.sum(np.abs(e - by @ found) ** 2, axis=0) / freedom + 1e-300
    quiet, inverse = found[n:], np.linalg.pinv(unit[n:, n:])
    ratio = np.real(np.einsum("ko,kl,lo->o", quiet.conj(), inverse, quiet)) / (tested * left)
    apart = _INDEPENDENT * freedom
    surprise = apart * np.log1p(ratio / apart)  # as rare as of a variance that is known
    made = np.mean(np.abs(y) ** 2, axis=0) + 1e-300
    bias = np.mean(np.abs(mine @ found[:tested]) ** 2, axis=0) / made
    more, rest = np.abs(y) ** 2 - made, np.abs(e) ** 2
    size = np.sum(more**2, axis=0) + 1e-300
    grows = np.sum(more * rest, axis=0) / size
    sure = grows * np.sqrt(_OF_POWERS * size) / (rest.mean(axis=0) + 1e-300)
    return surprise, bias, grows, sure
