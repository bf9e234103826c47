"""Fits a structure to short records by maximum likelihood on their own Fourier transforms.

At the lines of a record of length T (multiples of 2 pi / T)

    j w M X = F X + G U + M d ,   Y = H0 X + H1 (j w X - d) + D U + j s / w + E

holds exactly with d = x(0) - x(T), delays apart; constants have no part in it, and s T is an
output's drift over the record. Each record's d and s are unknown and enter linearly; they are
projected out (E. Morelli and V. Klein, Aircraft System Identification, 2nd ed., 2016, ch. 7; R.
Pintelon and J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., 2012, ch.
6). The outputs' noise E is white over the band with a covariance that the residuals tell.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals

from helisim.base.arrays import Complex, Real
from helisim.base.errors import IdentificationError
from helisim.base.note import Note
from helisim.base.settings import Limits, convert
from helisim.ident.bounds import Accuracy
from helisim.ident.conditions import Conditions
from helisim.ident.cost import Band, Cost, select, within
from helisim.ident.diagnosis import delay_names, residual
from helisim.ident.evaluate import Sensitivity, response
from helisim.ident.evidence import evidence, left_of
from helisim.ident.fit import fitted_parameters
from helisim.ident.frf import (
    POINTS_PER_DECADE,
    check_records,
    faults,
    flight_span,
    flights_of,
)
from helisim.ident.local_fit import transform
from helisim.ident.rational import delay_grid
from helisim.ident.response import FrequencyResponse
from helisim.ident.result import Fit
from helisim.ident.search import linear_parameters, minimum, scattered
from helisim.ident.structure import Structure
from helisim.ident.structures import rational_form, transfer_function
from helisim.ident.windows import lowest_line
from helisim.records.missing import missing_of, with_more_missing
from helisim.records.record import FlightRecord, one_blas_thread, plain

SHORT = 20.0
"""Length, s, below which records have too few lines for a spectral estimate."""
# Rounds of the noise's covariance, at most, and the relative change at which it is known; share of
# an output's rms below which no residual is trusted
_ROUNDS, _SETTLED, _FLOOR = 10, 1e-3, 1e-4
# Relative difference of equal costs; scattered starts of which one is searched from, and the share
# with other signs; share of the inputs' power where delays have to be right for a start
_SAME, _CROWD, _FLIPPED, _MOSTLY = 1e-4, 4, 0.2, 0.9
# Least singular value, over the largest, of what can be told apart; deviations by which a parameter
# must move the residuals to be seen; residual of an undefined model
_APART, _FAINT, _HOPELESS = 1e-7, 1e-3, 1e3
# Poles up to which one more is tried, by so many starts; twice the log likelihood that it gains of
# what noise doesn't explain: it gave 4 at most of 27 right orders, 100 and more of wrong ones
_HIGHEST, _FEW, _LACKS = 3, 4, 20.0
_GROWTH = math.log(1e6)  # logarithm of a motion's growth within a record that no flight shows
# Lines over which the residuals' spectrum is averaged; as of a local estimate, no coherence is
# larger than so many averages would show
_COLOUR, _AVERAGES = 4.0, 8.0
_HIDDEN = (0.2, 0.4, 0.6, 0.8)  # of a record on, as many samples more are hidden as are missing


@one_blas_thread()
def identify_records(
    records: FlightRecord | Sequence[FlightRecord],
    structure: Structure,
    *,
    band: Band | None = None,
    searches: int = 12,
    seed: int = 0,
    use_ended: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> Fit:
    """Fit a structure to records themselves, such as doublets of 7 to 12 s.

    By maximum likelihood on the records' Fourier transforms, each record with an unknown initial
    state and unknown trends of its outputs. Inputs are linear between samples, and at their trim at
    a record's ends where they are delayed. Feedback biases it where there are gusts. `Fit.data` is
    the model's response with what of the residuals moves with each input.

    Args:
        records: with the structure's inputs and outputs.
        structure: of the model.
        band: lowest and highest frequency, rad/s; default from the longest record's first line up
            to ten samples a period.
        searches: most starts; fewer when two find the same minimum.
        seed: of the scattered starts.
        use_ended: accept flights that were terminated early.
        on_progress: called with the structure's name after each search.

    Raises InputError for arguments; IdentificationError if records have too few lines, an input
    is constant, a flight was terminated early, or the fit grows beyond what a record can show.
    """
    flights = flights_of(records)
    for name, count, low in (("searches", searches, 1), ("seed", seed, 0)):
        convert(int, count, name, Limits(low=low))
    check_records(flights, structure.inputs, structure.outputs, band=band, use_ended=use_ended)
    longest = max(one.duration for one in flights)
    sampled = max(one.sample_time for one in flights)
    edges = band or (2.0 * math.pi / longest, 0.2 * math.pi / sampled)
    turns = _HIDDEN if any(missing_of(one).any() for one in flights) else ()
    hidden = [[with_more_missing(one, later) for one in flights] for later in turns]
    lines, *fewer = (_transforms(some, structure, edges) for some in (flights, *hidden))
    left = np.stack([left_of(flights, name, lines.omega) for name in structure.inputs], axis=1)
    fresh = [one._replace(inputs=one.inputs / left) for one in fewer or [lines]]
    of = _Likelihood(structure, lines, fresh)
    x, agreeing, converged = _search(of, searches, seed, on_progress or (lambda _: None))
    _refuse_growth(structure, of.values(x), longest)
    data = _shown(of, x, flights)
    points = select(data, structure, band=None, responses=None, count=20)
    cost, quality = Cost(structure, points), of.accuracy(x)
    return Fit(
        structure=structure,
        parameters=fitted_parameters(structure, x, quality),
        correlation=quality.correlation,
        covariance=quality.covariance,
        carried=quality.carried,
        residual=residual(cost, x, None, None),
        costs=dict(zip(points.pairs, cost.per_response(x).tolist())),
        bands=dict(zip(points.pairs, points.bands)),
        dropped=(),
        converged=converged,
        searches_agreeing=agreeing,
        data=replace(data, evidence=(*evidence(flights, data, data), *_lacking(of, seed))),
        options=plain(
            {"band_rad_s": band, "searches": searches, "seed": seed, "lines": of.lines.omega.size}
        ),
    )


def falls_short(records: Sequence[FlightRecord], band: Band | None) -> bool:
    """Return whether records, s each, are too short for a spectral estimate in a band, rad/s.

    Those of less than 20 s are, unless a band is given in which they have windows.
    """
    durations = [one.duration for one in records]
    return max(durations) < SHORT and (band is None or band[0] < lowest_line(durations))


class _Lines(NamedTuple):
    """Lines of all records, (n_line,): rad/s, number of the record; signals (n_line, n_signal)."""

    omega: Real
    record: NDArray[np.intp]
    inputs: Complex
    outputs: Complex
    spacing: float


def _transforms(flights: Sequence[FlightRecord], structure: Structure, band: Band) -> _Lines:
    names, n_in = (*structure.inputs, *structure.outputs), len(structure.inputs)
    found = []
    for number, one in enumerate(flights):
        columns, step = one.select(names), one.sample_time
        # over the root of the noise's power in a line, which grows with length and sample interval;
        # a signal linear between its samples has sinc^2 of its spectrum
        rows = math.sqrt(step / one.duration) * transform(columns)
        omega = np.arange(len(rows), dtype=np.float64) * (2.0 * np.pi / one.duration)
        kept = within(omega, band) & (omega > 0.0)
        rows[:, :n_in] *= np.sinc(omega * step / (2.0 * np.pi))[:, None] ** 2
        found.append((omega[kept], np.full(int(kept.sum()), number), rows[kept]))
    omega, record, rows = (np.concatenate(one) for one in zip(*found))
    unknown = len(structure.free) + len(flights) * (len(structure.states) + len(structure.outputs))
    known = 2 * omega.size * len(structure.outputs)
    if known <= 2 * unknown:
        raise IdentificationError(
            f"the records have {omega.size} lines from {band[0]:.4g} to {band[1]:.4g} rad/s, which "
            f"are {known} numbers for {unknown} unknowns: {len(structure.free)} parameters, and "
            "each record's initial state and trends; widen the band, add records, or fix "
            "parameters",
            remedy="band,fix",
        )
    spacing = 2.0 * math.pi / max(one.duration for one in flights)
    return _Lines(omega, record, rows[:, :n_in], rows[:, n_in:], spacing)


def _with_ends(structure: Structure) -> Structure:
    """Return a structure with a further input for each state: what its record's ends differ by."""
    ends = tuple(f"{state} at the ends" for state in structure.states)
    minus = [
        [f"-({cell})" if cell not in ("0", "0.0") else "0" for cell in r] for r in structure.H1
    ]
    return replace(
        structure,
        inputs=(*structure.inputs, *ends),
        G=tuple((*row, *more) for row, more in zip(structure.G, structure.M)),
        D=tuple((*row, *more) for row, more in zip(structure.D, minus)),
    )


class _Likelihood:
    """Whitened residuals of all lines without what the records' ends and trends explain."""

    def __init__(
        self,
        structure: Structure,
        lines: _Lines,
        fewer: Sequence[_Lines] = (),
        white: Real | None = None,
    ) -> None:
        self.structure, self.lines, self._fewer = structure, lines, fewer
        self.names = [one.name for one in structure.free]
        self.limits = np.array([one.limits for one in structure.free]).reshape(-1, 2).T
        self._wide = _with_ends(structure)
        self.shape = (lines.omega.size, len(structure.outputs), len(self._wide.inputs))
        self._where = self._sensitivity()
        self._level = np.sqrt(np.mean(np.abs(lines.outputs) ** 2, axis=0))
        self.white: Real = (
            np.diag(1.0 / np.maximum(self._level, 1e-300)) if white is None else white
        )
        self._cached: tuple[bytes, Complex, Complex] | None = None
        self._taken = np.zeros(self.shape[:2])

    def _sensitivity(self, by: Sequence[str] | None = None) -> Sensitivity:
        line, output, input_ = np.indices(self.shape).reshape(3, -1)
        return Sensitivity(self._wide.program, self.lines.omega[line], output, input_, by=by)

    def errors(self, x: Real, by: Sequence[str] | None = None) -> tuple[Complex, Complex]:
        """Return whitened errors, (n_line, n_out), and slopes, (n_free, n_line, n_out)."""
        if by is None and self._cached is not None and self._cached[0] == x.tobytes():
            return self._cached[1:]
        parameters = self.structure.program.ordered(self.values(x))
        sample = (self._where if by is None else self._sensitivity(by)).at(parameters)
        gain, slope = sample.response.reshape(self.shape), sample.slope().reshape(-1, *self.shape)
        if not (np.all(np.isfinite(gain)) and np.all(np.isfinite(slope))):
            return np.full(self.shape[:2], _HOPELESS * (1.0 + 1.0j)), np.zeros_like(slope[..., 0])
        lines, n_in = self.lines, self.lines.inputs.shape[1]
        error = lines.outputs - np.einsum("loi,li->lo", gain[..., :n_in], lines.inputs)
        error, slope = error @ self.white.T, np.asarray(self.white @ slope)
        trend = 1j / lines.omega[:, None, None] * np.eye(self.shape[1])
        nuisance = self.white @ np.concatenate([gain[..., n_in:], trend], axis=2)
        moved, taken = np.zeros_like(slope[..., 0]), np.zeros(self.shape[:2])
        for number in range(int(lines.record[-1]) + 1):
            mine = lines.record == number
            columns = _parts(np.moveaxis(nuisance[mine], 2, 0)).T
            size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            u, s, v = np.linalg.svd(columns / size, full_matrices=False)
            kept = s > _APART * np.max(s, initial=0.0)
            basis, (flat,) = u[:, kept], _parts(error[None, mine])
            taken[mine] = _share(basis, error[mine].shape)
            ends = (v[kept].T @ (basis.T @ flat / s[kept]) / size)[: self.shape[2] - n_in]
            driven = np.pad(lines.inputs[mine], ((0, 0), (0, ends.size)))
            driven[:, n_in:] = ends
            moved[:, mine] = -np.einsum("floi,li->flo", slope[:, mine], driven)
            rows = _parts(np.concatenate([error[None, mine], moved[:, mine]]))
            rows -= rows @ basis @ basis.T
            real, imag = np.split(rows, 2, axis=1)
            left = (real + 1j * imag).reshape(-1, *error[mine].shape)
            error[mine], moved[:, mine] = left[0], left[1:]
        if by is None:
            self._cached, self._taken = (x.tobytes(), error, moved), taken
        return error, moved

    def values(self, x: Real) -> dict[str, float]:
        """Return all parameters by name for the free ones x, (n_free,)."""
        return {**self.structure.starts, **dict(zip(self.names, x.tolist()))}

    def residual(self, x: Real) -> Real:
        """Return the whitened residuals of x, (n_free,), real parts first, (2 n_line n_out,)."""
        return _parts(self.errors(x)[0][None])[0]

    def jacobian(self, x: Real) -> Real:
        """Return the derivatives of `residual` by x, (n_free,): (2 n_line n_out, n_free)."""
        return _parts(self.errors(x)[1]).T

    def weigh(self, x: Real) -> float:
        """Take the noise from the residuals of x, (n_free,); return its relative change."""
        error = self.errors(x)[0]
        freedom = 2.0 * len(error) - (np.sum(self._taken) + len(x)) / len(error.T)
        power = np.real(error.T @ error.conj()) / freedom
        change = float(np.max(np.abs(power - np.eye(len(power)))))
        back = np.linalg.inv(self.white)
        noise = back @ power @ back.T + np.diag((_FLOOR * self._level) ** 2)
        self.white, self._cached = np.linalg.inv(np.linalg.cholesky(noise)).astype(np.float64), None
        return change

    def accuracy(self, x: Real) -> Accuracy:
        """Return the accuracy at x, (n_free,), for noise of the colour that the residuals have."""
        jacobian = self.jacobian(x)
        length = np.linalg.norm(jacobian, axis=0)
        magnitude = [one.magnitude for one in self.structure.free]
        clear = length * np.maximum(np.abs(x), magnitude) > _FAINT
        unit = np.where(clear, length, 1.0)
        u, s, v = np.linalg.svd(jacobian * clear / unit, full_matrices=False)
        kept = s > _APART * np.max(s, initial=0.0)
        seen = np.sum(v[~kept] ** 2, axis=0) < 1e-6
        gain = (v[kept].T / s[kept]) @ u[:, kept].T / unit[:, None]
        error, place = self.errors(x)[0], self.lines.omega / (_COLOUR * self.lines.spacing)
        near = np.exp(-0.5 * np.subtract.outer(place, place) ** 2)
        free = np.sqrt(near @ (2.0 - self._taken - _share(u[:, kept], error.shape)))
        local = np.real(np.einsum("lm,ma,mb->lab", near, error, error.conj())) / (
            free[:, :, None] * free[:, None, :]
        )
        rows = gain.reshape(len(x), 2, *self.shape[:2])
        covariance = np.einsum("ipla,lab,jplb->ij", rows, local, rows)
        known = self.structure.uncertain
        slope = self.errors(x, [one.name for one in known])[1]
        carried = -(gain @ _parts(slope).T) * np.array([one.error for one in known])
        covariance = covariance + carried @ carried.T
        for lines in self._fewer:
            other = _Likelihood(self.structure, lines, white=self.white)
            moved = _descended(other, x)[1] - x
            covariance += np.outer(moved, moved) / len(self._fewer)
        bound = np.where(seen, 2.0 * np.linalg.norm(gain, axis=1), np.inf)
        root = np.sqrt(np.maximum(np.diagonal(covariance), 1e-300))
        correlation = np.clip(covariance / np.outer(root, root), -1.0, 1.0)
        np.fill_diagonal(correlation, 1.0)
        np.fill_diagonal(covariance, np.where(seen, np.diagonal(covariance), np.inf))
        return Accuracy(
            bound,
            np.where(clear, 1.0 / unit, np.inf),
            covariance,
            carried,
            correlation,
            np.zeros(len(x)),
        )


def _share(basis: Real, shape: tuple[int, ...]) -> Real:
    """Return how much a basis, (2 n_line n_out, n), takes of real and imaginary parts, `shape`."""
    return np.sum(basis**2, axis=1).reshape(2, *shape).sum(axis=0)


def _parts(rows: NDArray[np.complexfloating]) -> Real:
    """Return real, then imaginary parts of (n_row, n_line, n_out): (n_row, 2 n_line n_out)."""
    flat = rows.reshape(len(rows), math.prod(rows.shape[1:]))
    return np.concatenate([flat.real, flat.imag], axis=1, dtype=np.float64)


def _search(
    of: _Likelihood, searches: int, seed: int, on_progress: Callable[[str], None]
) -> tuple[Real, int, bool]:
    """Return the best minimum, how many starts ended there, and whether it converged."""
    random, found, agreeing = np.random.default_rng(seed), [], 0
    while len(found) < searches and agreeing < 2:
        crowd = [np.array([one.start for one in of.structure.free])]
        if found:
            crowd = [scattered(of.structure, random, _FLIPPED) for _ in range(_CROWD)]
        # by all delays, and by its own alone: poles that are far off may fit a delay that is, too
        starts = [_solved(of, np.clip(one, *of.limits), not len(found) % 2) for one in crowd]
        found.append(_descended(of, min(starts, key=lambda one: one[0])[1]))
        on_progress(of.structure.name)
        found.sort(key=lambda one: one[0])
        agreeing = sum(one[0] <= found[0][0] * (1.0 + _SAME) + 1e-9 for one in found)
    for _ in range(_ROUNDS):
        change = of.weigh(found[0][1])
        found[0] = _descended(of, found[0][1])
        if change < _SETTLED:
            break
    return found[0][1], agreeing, found[0][2]


def _descended(of: _Likelihood, x: Real) -> tuple[float, Real, bool]:
    """Return the cost and place, (n_free,), of the minimum below x, and whether it converged."""
    if not x.size:
        return 0.0, x, True
    end = minimum(of.limits, of.residual, of.jacobian, x)
    return float(end.cost), end.x, end.status > 0


def _solved(of: _Likelihood, x: Real, delays: bool) -> tuple[float, Real]:
    """Return the least squares of x, (n_free,), and x with its gains solved.

    `delays` is whether a grid of delays is tried, the same one for all inputs and outputs.
    """
    late = [k for k, name in enumerate(of.names) if name in delay_names(of.structure)]
    gains, found = linear_parameters(of.structure), []
    order = np.argsort(of.lines.omega)
    power = np.cumsum(np.sum(np.abs(of.lines.inputs[order]) ** 2, axis=1))
    reached = of.lines.omega[order[: np.searchsorted(power, _MOSTLY * power[-1]) + 1]]
    for delay in [None, *(delay_grid(reached) if late and delays else ())]:
        one = x.copy()
        one[late] = x[late] if delay is None else delay
        one = np.clip(one, *of.limits)
        residual, jacobian = of.residual(one), of.jacobian(one)[:, gains]
        change = np.linalg.lstsq(jacobian, residual, rcond=1e-9)[0]
        one[gains] -= change
        found.append((float(np.sum((residual - jacobian @ change) ** 2)), np.clip(one, *of.limits)))
    return min(found, key=lambda end: end[0])


def _lacking(of: _Likelihood, seed: int) -> Iterator[Note]:
    """Yield a note if one more zero and pole explain what noise does not."""
    form = rational_form(of.structure)
    if form is None or of.structure.free != of.structure.parameters or form.poles > _HIGHEST:
        return
    (input_,), (output,) = of.structure.inputs, of.structure.outputs
    order = {"zeros": form.zeros + 1, "poles": form.poles + 1, "delay": form.delay}
    other = _Likelihood(transfer_function(**order, input=input_, output=output), of.lines)
    _search(other, _FEW, seed, lambda _: None)
    sharper = np.linalg.slogdet(other.white)[1] - np.linalg.slogdet(of.white)[1]
    if (gain := 4.0 * of.lines.omega.size * float(sharper)) > _LACKS:
        yield Note(
            "residual",
            f"tf:{order['zeros']}/{order['poles']} follows the record better, by {gain:.3g} in "
            "twice the log likelihood, where noise gives 4: modes and coefficients can be off by "
            "more than their errors say",
        )


def _refuse_growth(structure: Structure, values: dict[str, float], duration: float) -> None:
    """Raise IdentificationError where a model grows more in `duration`, s, than a record shows."""
    numbers = structure.matrices(values)
    poles = eigvals(numbers["F"], numbers["M"]) if structure.states else ()
    worst = max((float(z.real) for z in poles if np.isfinite(z)), default=0.0)
    if worst * duration > _GROWTH:
        raise IdentificationError(
            f"the fitted {structure.name!r} has an unstable pole of {worst:.3g} rad/s, which grows "
            f"by a factor of {math.exp(min(worst * duration, 500.0)):.1g} in {duration:.4g} s; no "
            "record shows that: give other starts or bounds, shorter records, or a structure with "
            "fewer states",
            remedy="start,bounds",
        )


def _shown(of: _Likelihood, x: Real, flights: Sequence[FlightRecord]) -> FrequencyResponse:
    """Return the model's response with what of the residuals moves with each input."""
    structure, lines = of.structure, of.lines
    low, high = float(np.min(lines.omega)), float(np.max(lines.omega))
    omega = np.geomspace(low, high, 32 + math.ceil(POINTS_PER_DECADE * math.log10(high / low)))
    near = np.exp(-0.5 * (np.subtract.outer(omega, lines.omega) / lines.spacing) ** 2)
    back, drive = np.linalg.inv(of.white), np.abs(lines.inputs.T) ** 2
    error, noise = of.errors(x)[0] @ back.T, 2.0 * np.sum(back**2, axis=1)[:, None, None]
    power = np.maximum(drive @ near.T, 1e-300)
    found = response(structure, of.values(x), omega)
    found += np.einsum("fl,lo,li->oif", near, error, lines.inputs.conj()) / power
    relative = noise * (drive @ (near**2).T) / np.maximum(power * np.abs(found), 1e-300) ** 2
    signal = np.abs(found) ** 2 * power / near.sum(axis=1)
    across = np.abs(np.einsum("fl,li,lj->ijf", near, lines.inputs, lines.inputs.conj())) ** 2
    return FrequencyResponse(
        frequency=omega,
        response=found,
        coherence=np.minimum(signal / (signal + noise), 1.0 / (1.0 + _AVERAGES * relative)),
        multiple_coherence=1.0 / (1.0 + noise[:, 0] / signal.sum(axis=1)),
        cross_control_coherence=across / (power[:, None] * power),
        random_error=np.sqrt(0.5 * relative),
        inputs=structure.inputs,
        outputs=structure.outputs,
        input_units=tuple(flights[0].unit(name) for name in structure.inputs),
        output_units=tuple(flights[0].unit(name) for name in structure.outputs),
        estimator="likelihood",
        flags=tuple(faults(flights, (*structure.inputs, *structure.outputs))),
        sources=tuple(one.digest for one in flights),
        spans=tuple(filter(None, map(flight_span, flights))),
        conditions=Conditions.of(flights),
    )
