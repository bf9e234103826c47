"""Local fits by several widths of the band, brought to responses of outputs to inputs."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.ident.responses.local_choice import smoothed
from helisim.ident.responses.local_fit import ORDER, TRANSIENT, BandFit, fit_band
from helisim.ident.responses.local_lines import Lines
from helisim.ident.responses.local_scatter import LineWeights

WIDTHS: NDArray[np.float64] = 0.06 * 2.0 ** np.arange(7, dtype=np.float64)
"""Half widths of the band over its middle: 0.06 to 3.84."""

WIDEST = 1.0
"""Beyond it a band is only used where the lines allow one narrower at most: of a single one
nobody knows the bias."""

_MOST = 4
"""Widths that are compared at a frequency."""

_PLENTY = 100.0
"""Lines for each parameter in a band beyond which no wider one is asked."""

_SPARE = 1.5
"""Lines that a band needs for each parameter: the kernel lets two of three count."""

_FREE = 4.0
"""Lines beyond the parameters, to see what is left."""

_TRANSIENT_RATIO = 1.5
"""Transients are estimated where their lines hold so much more power than the disturbance."""

_TRANSIENT_STEP = 4
"""At every so many frequencies it is looked for transients."""

_CHUNK = 100_000
"""Numbers of a design that are worked on at once."""


class _Weights(NamedTuple):
    """Weights of one width at a frequency: (n_in, n_flight, n_line), and the first lines."""

    first: NDArray[np.intp]
    value: NDArray[np.complex64]


@dataclass(frozen=True, eq=False)
class Task:
    """What is estimated.

    Attributes:
        lines: of the flights.
        drive: places of the driving signals: the references, or the inputs that were active.
        output: places of the outputs.
        active: with references, places of the inputs that were active; else empty.
        n_in: how many of the inputs are wanted, the first ones.
        frequency: (n_freq,) rad/s.
    """

    lines: Lines
    drive: list[int]
    output: list[int]
    active: list[int]
    n_in: int
    frequency: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Bands:
    """The responses by every width.

    Attributes:
        gain: (n_width, n_out, n_in, n_freq), zero where a width isn't used.
        valid: (n_width, n_freq) where it is used.
        residual: (n_width, n_freq, n_out, n_out) spectra of y - H u.
        freedom: (n_width, n_freq) equivalent number of lines that it averages.
        full_gain: (n_freq, n_out, n_active) the narrowest width's, conditioning inputs too.
        active_gain: (n_freq, n_active, n_drive) its response of the inputs to the references.
        weights: for each frequency the first line, (n_flight,), and for each width that is used
            its number and weights, (n_in, n_flight, n_line).
    """

    gain: NDArray[np.complex128]
    valid: NDArray[np.bool_]
    residual: NDArray[np.complex128]
    freedom: NDArray[np.float64]
    full_gain: NDArray[np.complex128]
    active_gain: NDArray[np.complex128]
    weights: tuple[dict[int, _Weights], ...]

    def shared(self) -> NDArray[np.float64]:
        """Return the covariance between widths for a unit disturbance, (n_width, n_width, ...).

        The last axes are (n_in, n_freq).
        """
        n_width, _, n_in, n_freq = self.gain.shape
        shared = np.zeros((n_width, n_width, n_in, n_freq))
        for f in range(n_freq):
            widths = sorted(self.weights[f])
            value = _laid_out([self.weights[f][width] for width in widths], widths).value
            flat = value.reshape(len(widths), n_in, -1).swapaxes(0, 1)
            product = np.real(flat @ flat.conj().swapaxes(1, 2))
            shared[np.ix_(widths, widths, range(n_in), [f])] = product.transpose(1, 2, 0)[..., None]
        return shared

    def packed(self, share: NDArray[np.float64]) -> tuple[LineWeights, ...]:
        """Return the weights of the widths that have a share at each frequency.

        Args:
            share: (n_width, n_out, n_in, n_freq).
        """
        packed = []
        for f in range(share.shape[3]):
            used = [width for width in sorted(self.weights[f]) if np.any(share[width, ..., f])]
            packed.append(_laid_out([self.weights[f][width] for width in used], used))
        return tuple(packed)


def estimate_bands(task: Task) -> Bands:
    """Fit every width at every frequency where the lines allow it."""
    transient = _transients(task)
    valid = _usable_widths(task, transient)
    n_width, n_freq = valid.shape
    n_out, n_drive = len(task.output), len(task.drive)
    n_active = len(task.active) or n_drive
    gain = np.zeros((n_width, n_out, task.n_in, n_freq), dtype=np.complex128)
    residual = np.zeros((n_width, n_freq, n_out, n_out), dtype=np.complex128)
    freedom = np.zeros((n_width, n_freq))
    full = np.zeros((n_freq, n_out, n_active), dtype=np.complex128)
    active = np.zeros((n_freq, n_active, n_drive), dtype=np.complex128)
    weights: tuple[dict[int, _Weights], ...] = tuple({} for _ in range(n_freq))
    for width in range(n_width)[::-1]:
        for chosen, with_transient in _chunks(task, valid[width], transient, WIDTHS[width]):
            fit = _fit(task, chosen, width, transient=with_transient)
            response = _Response.of(task, fit)
            ok = fit.fits | (np.sum(valid[:, chosen], axis=0) == 1)
            valid[width, chosen] = ok
            k = chosen[ok]
            gain[width][:, :, k] = np.moveaxis(response.gain[ok, :, : task.n_in], 0, 2)
            residual[width, k] = response.residual[ok]
            freedom[width, k] = fit.freedom[ok]
            full[k], active[k] = response.gain[ok], response.into[ok]
            for f, at in zip(np.flatnonzero(ok), k):
                weights[at][width] = _Weights(fit.first[f], response.weight[f, : task.n_in])
    return Bands(gain, valid, residual, freedom, full, active, weights)


@dataclass(frozen=True, eq=False)
class _Response:
    """Responses of outputs to all active inputs, from those to the driving signals.

    With references r the inputs follow as u = R r, and H = H_yr R*(R R*)^-1 in the metric of r;
    what is left of y - H u is the disturbance, whatever feedback carries of it into u.
    """

    gain: NDArray[np.complex128]
    into: NDArray[np.complex128]
    weight: NDArray[np.complex64]
    residual: NDArray[np.complex128]

    @classmethod
    def of(cls, task: Task, fit: BandFit) -> "_Response":
        n_out, n_freq = len(task.output), fit.gain.shape[0]
        if not task.active:
            same = np.broadcast_to(np.eye(len(task.drive)), (n_freq,) + 2 * (len(task.drive),))
            weight = fit.weight.astype(np.complex64)
            return cls(fit.gain, same.astype(np.complex128), weight, fit.residual)
        into = fit.gain[:, n_out:]
        back = np.linalg.pinv(into, rcond=1e-10)
        gain = fit.gain[:, :n_out] @ back
        weight = np.einsum("fra,frel->fael", back, fit.weight).astype(np.complex64)
        one = np.broadcast_to(np.eye(n_out), (n_freq, n_out, n_out))
        left = np.concatenate([one, -gain], axis=2)
        return cls(gain, into, weight, left @ fit.residual @ left.conj().swapaxes(1, 2))


def _fit(
    task: Task, chosen: NDArray[np.intp], width: int, *, transient: bool, poles: bool = True
) -> BandFit:
    frequency = task.frequency[chosen]
    return fit_band(
        task.lines,
        task.drive,
        [*task.output, *task.active],
        frequency,
        WIDTHS[width] * frequency,
        transient=transient,
        poles=poles,
    )


def _usable_widths(task: Task, transient: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which widths have lines enough, (n_width, n_freq): the narrowest and some more."""
    needed = _SPARE * (len(task.drive) * (ORDER + 1) + _FREE)
    lines = np.zeros((WIDTHS.size, task.frequency.size), dtype=np.intp)
    for width, relative in enumerate(WIDTHS):
        half = relative * task.frequency
        _, count = task.lines.within(task.frequency - half, task.frequency + half)
        lost = np.where(transient, TRANSIENT, 0)[:, None]
        lines[width] = np.sum(np.maximum(count - lost, 0), axis=1)
    enough = lines >= needed
    enough[-1] |= ~np.any(enough, axis=0)
    narrowest = np.argmax(enough, axis=0)
    number = np.arange(WIDTHS.size)[:, None]
    within = (WIDTHS[:, None] <= WIDEST) | (number <= narrowest + 1)
    plenty = np.roll(lines >= _PLENTY * len(task.drive) * (ORDER + 1), 1, axis=0)
    plenty[0] = False
    return enough & within & (number < narrowest + _MOST) & (~plenty | (number == narrowest))


def _chunks(
    task: Task, valid: NDArray[np.bool_], transient: NDArray[np.bool_], relative: float
) -> list[tuple[NDArray[np.intp], bool]]:
    """Return groups of frequencies that are worked on together, of similar numbers of lines."""
    n_flight, columns = task.lines.spacing.size, len(task.drive) * (ORDER + 1)
    columns += len(task.output) + len(task.active)
    groups = []
    for with_transient in (False, True):
        left = np.flatnonzero(valid & (transient == with_transient))
        while left.size:
            widest = 2.0 * relative * task.frequency[left] / np.min(task.lines.spacing) + 1.0
            size = (np.arange(left.size) + 1) * widest * n_flight * columns
            small = (size <= _CHUNK) & (task.frequency[left] <= 1.5 * task.frequency[left[0]])
            count = max(int(np.count_nonzero(small)), 1)
            groups.append((left[:count], with_transient))
            left = left[count:]
    return groups


def _transients(task: Task) -> NDArray[np.bool_]:
    """Return where transients are to be estimated, (n_freq,).

    Their lines are compared with the disturbance's, where there are enough for both. Flights
    that begin and end in trim have none, and at the lowest frequencies could not afford them.
    """
    all_on = np.ones(task.frequency.size, dtype=np.bool_)
    valid = _usable_widths(task, all_on)
    ratio, counted = np.zeros(task.frequency.size), np.zeros(task.frequency.size)
    narrowest = np.argmax(valid, axis=0)
    for width in range(WIDTHS.size):
        looked = np.zeros(task.frequency.size, dtype=np.bool_)
        looked[::_TRANSIENT_STEP] = narrowest[::_TRANSIENT_STEP] == width
        for chosen, _ in _chunks(task, looked, all_on, WIDTHS[width]):
            whole = _fit(task, chosen, width, transient=False, poles=False)
            less = _fit(task, chosen, width, transient=True, poles=False)
            more, power = (
                np.real(np.diagonal(fit.residual, axis1=1, axis2=2)) * fit.freedom[:, None]
                for fit in (whole, less)
            )
            spent = (whole.freedom - less.freedom)[:, None]
            ok = whole.fits & less.fits & (less.freedom > 1.0) & (spent[:, 0] > 0.5)
            with np.errstate(all="ignore"):
                each = (more - power) / spent / (power / less.freedom[:, None])
            counted[chosen[ok]] = less.freedom[ok]
            ratio[chosen[ok]] = np.mean(each[ok], axis=1)
    if not np.any(counted):
        return ~all_on
    mean = smoothed(ratio, task.frequency, counted, 0.35)
    known = smoothed(np.ones_like(ratio), task.frequency, counted, 0.35) > 0.5
    overall = np.sum(ratio * counted) / np.sum(counted)
    return np.where(known, mean, overall) > _TRANSIENT_RATIO


def _laid_out(parts: list[_Weights], numbers: list[int]) -> LineWeights:
    """Return the weights of several widths side by side, as parts of one."""
    first = np.min([one.first for one in parts], axis=0)
    last = np.max([one.first + one.value.shape[2] for one in parts], axis=0)
    n_in, n_flight, _ = parts[0].value.shape
    wide = np.zeros((len(parts), n_in, n_flight, int(np.max(last - first))), dtype=np.complex64)
    for row, one in zip(wide, parts):
        for flight, shift in enumerate(one.first - first):
            row[:, flight, shift : shift + one.value.shape[2]] = one.value[:, flight]
    return LineWeights(np.array(numbers, dtype=np.intp), first, wide)
