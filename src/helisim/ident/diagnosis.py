"""Says what is doubtful in a fit: what it leaves, what data don't support, what its errors show.

A parameter's standard error says how far noise moves it. Where a structure can't follow the
response, what it leaves repeats in every record: more data narrow the errors, not this.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.special import fdtri

from helisim.base.note import Note, Option
from helisim.base.settings import FrozenMap, Value
from helisim.base.units import DB_PER_NEPER
from helisim.ident.cost import PHASE_WEIGHT, Cost, within
from helisim.ident.evaluate import matrices
from helisim.ident.fitted import FittedParameter
from helisim.ident.rational import FAST, order
from helisim.ident.response import FrequencyResponse
from helisim.ident.search import Minimum
from helisim.ident.structure import DELAYS, Structure
from helisim.ident.transfer import Rational, rational_form, transfer_function

DEGREES = 180.0 / math.pi
RATIO_LIMIT = 2.0
"""Residuals of more than this many times the noise's power are the structure's own."""
_BELIEVED, _NOTHING = 0.999, 1e-4
"""Probability up to which noise alone explains what a higher order gains: a cancelling pair looks
for the frequency where noise makes it most useful, so 95 % would believe too much; and the rise of
the average cost that is none, however little noise there is: 0.002 dB."""
_FAR = 5.0
"""A pole so many times above the band's top is not in the data, unless its errors say so."""
_RATIO, _PERCENT = 10.0, 5.0
"""Of noise's power, and of a response, from which what a model leaves is worth a word."""
_HIGH = 50.0
"""Cost of a response, from which what it leaves is looked at: below, it is excellent."""
_EXPLAINED = 0.75
"""Share of a response's cost that a delay, or an edge of the band, must take away."""
_LEAST_PHASE, _FLIPPED = 0.35, 2.4
"""rad: what a delay worth a word turns at the band's upper edge, and what the phase of a flipped
response is off at nearly all points."""
_EDGE = 0.34
"""Of a band's points, that count as its edge."""
_DOUBTFUL = 0.75
"""Mean coherence of a response below which its data are doubted."""

Real = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Misfit(Value):
    """The rms of what a model leaves of each response once noise's part is taken out.

    Attributes:
        magnitude: dB, by response ("p/lat").
        phase: deg, by response.
        ratio: the residuals' power over what noise alone would leave (s^2, near 1 where the
            structure can follow the response); None where the noise is not known, and then
            magnitude and phase hold the noise too.
    """

    magnitude: Mapping[str, float]
    phase: Mapping[str, float]
    ratio: float | None

    def __post_init__(self) -> None:
        for name in ("magnitude", "phase"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    def __str__(self) -> str:
        lines = [f"{name}: {self.words(name)}" for name in self.magnitude]
        return "\n".join([*lines, self.summary])

    @property
    def percent(self) -> dict[str, float]:
        """The rms of the relative error of each response, percent; magnitude and phase together."""
        return {
            name: 100.0 * math.hypot(self.magnitude[name] / DB_PER_NEPER, math.radians(phase))
            for name, phase in self.phase.items()
        }

    @property
    def summary(self) -> str:
        """What the ratio says, in a line."""
        if self.ratio is None:
            return "how much of the misfit is noise isn't known"
        said = f"what the model leaves is {self.ratio:.3g} times what noise would leave"
        if self.ratio > RATIO_LIMIT:
            said += (
                "; the structure itself can't follow, and no error of a parameter says by how much"
            )
        return said

    def words(self, name: str) -> str:
        """Return a response's misfit in words, such as "0.12 dB, 0.8 deg beyond noise"."""
        which = "noise included" if self.ratio is None else "beyond noise"
        return f"{self.magnitude[name]:.2g} dB, {self.phase[name]:.2g} deg {which}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "magnitude_db": dict(self.magnitude),
            "phase_deg": dict(self.phase),
            "percent": self.percent,
            "ratio": self.ratio,
        }


def misfit(cost: Cost, x: Real, noise: Real | None, ratio: float | None) -> Misfit:
    """Return what a fit that ended at x leaves beyond noise.

    Args:
        cost: the fit's cost.
        x: (n_free,) the free parameters.
        noise: (2 n_point,) variances of the relative errors, real then imaginary parts, that
            noise leaves after the fit; None where they are not known.
        ratio: the residuals' power over noise's.
    """
    z, _ = cost.ratio(x)
    with np.errstate(all="ignore"):
        squares = np.array([np.log(np.abs(z)) ** 2, np.angle(z) ** 2])
    if noise is not None:
        squares = squares - noise.reshape(2, -1)
    rms = {
        name: np.sqrt(np.maximum(squares[:, cost.points.pair == k].mean(axis=1), 0.0))
        for k, name in enumerate(cost.points.pairs)
    }
    return Misfit(
        magnitude={name: float(DB_PER_NEPER * one[0]) for name, one in rms.items()},
        phase={name: float(np.rad2deg(one[1])) for name, one in rms.items()},
        ratio=ratio,
    )


Degenerate = tuple[tuple[str, ...], frozenset[str]]
"""What is degenerate in a fit: what to do, a line each, and the parameters concerned."""


def degenerate(
    cost: Cost,
    best: Minimum,
    bounds: Real,
    squares: Callable[[Cost, Minimum], float],
    fitted: Callable[[Cost], Minimum],
) -> Degenerate:
    """Return whether a fit has more than the data: dynamics beyond the band, cancelled, not needed.

    A transfer function with a pole to spare puts it where it does no harm: at a million rad/s, or
    onto a zero. Its coefficients then mean nothing alone, and its delay has taken over what the
    pole stands for, however small their bounds. Such a fit is compared with transfer functions of
    lower order: the lowest that leaves no more than noise can explain is what the data support.

    Args:
        cost: the fit's.
        best: where it ended.
        bounds: (n_free,) Cramér-Rao bounds.
        squares: returns the sum of the squared residuals that the fit minimised.
        fitted: fits another structure to the same points, likewise.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        unknown = bounds >= np.abs(best.x)  # only then are lower orders tried
    if not np.any(unknown):
        return (), frozenset()
    form = _polynomials(cost.structure)
    if form is None:
        return _far_poles(cost, best.x, unknown)
    lower = _lower_order(cost, best, form, squares, fitted)
    if lower is None:
        return (), frozenset()
    zeros, poles, average = lower
    advice = (
        f"degenerate: {_reason(cost, best.x, form)}; fit tf:{zeros}/{poles} instead, whose J of "
        f"{average:.4g} is no worse but for noise"
    )
    return (advice,), frozenset(cost.structure.names)


def _polynomials(structure: Structure) -> Rational | None:
    """Return the form of a transfer function whose coefficients are all free; None of others."""
    form = rational_form(structure)
    known = form is None or not form.names or any(one.fixed for one in structure.parameters)
    return None if known else form


def _lower_order(
    cost: Cost,
    best: Minimum,
    form: Rational,
    squares: Callable[[Cost, Minimum], float],
    fitted: Callable[[Cost], Minimum],
) -> tuple[int, int, float] | None:
    """Return zeros, poles and J of the lowest order that is as good, None if there is none."""
    (input_,), (output,) = cost.structure.inputs, cost.structure.outputs
    full = squares(cost, best)
    freedom = max(2 * cost.points.weight.size - best.x.size, 1)
    count = len(cost.points.pairs)
    found, seen, waiting = None, set(), [(form.zeros, form.poles)]
    while waiting:
        zeros, poles = waiting.pop(0)
        for lower in ((zeros, poles - 1), (zeros - 1, poles), (zeros - 1, poles - 1)):
            if lower in seen or not 0 <= lower[0] <= lower[1]:
                continue
            seen.add(lower)
            smaller = transfer_function(
                zeros=lower[0], poles=lower[1], input=input_, output=output, delay=form.delay
            )
            other = Cost(smaller, cost.points)
            end = fitted(other)
            given_up = form.zeros + form.poles - sum(lower)
            allowed = float(fdtri(given_up, freedom, _BELIEVED)) * given_up / freedom
            if squares(other, end) <= full * (1.0 + allowed) + _NOTHING * count:
                waiting.append(lower)
                if found is None or sum(lower) < sum(found[:2]):
                    found = (*lower, end.cost / count)
    return found


def _reason(cost: Cost, x: Real, form: Rational) -> str:
    """Return what is wrong with a transfer function that a lower order replaces."""
    values = [cost.values(x)[name] for name in form.names]
    zeros = np.roots(values[form.zeros :: -1])
    poles = np.roots([1.0, *reversed(values[form.zeros + 1 :])])
    top = float(np.max(cost.points.frequency))
    worst = max(np.abs([*poles, *zeros]), default=0.0)
    if worst > _FAR * top:
        kind = "pole" if worst in np.abs(poles) else "zero"
        return f"a {kind} at {worst:.3g} rad/s is far above the band's {top:.3g} rad/s"
    if zeros.size and poles.size:
        gap = np.abs(zeros[:, None] - poles[None, :]) / np.abs(poles)[None, :]
        _, nearest = np.unravel_index(np.argmin(gap), gap.shape)
        if np.min(gap) < 0.1:
            return f"a zero cancels the pole at {np.abs(poles[nearest]):.3g} rad/s"
    return "the data do not see all of its coefficients"


def _far_poles(cost: Cost, x: Real, unknown: NDArray[np.bool_]) -> Degenerate:
    """Return poles beyond the band that parameters of no known value have put there."""
    structure, top = cost.structure, float(np.max(cost.points.frequency))
    values = cost.values(x)
    delays = delay_names(structure)

    def fastest(at: dict[str, float]) -> float:
        numbers = matrices(structure, at)
        if not (np.all(np.isfinite(numbers.M)) and np.all(np.isfinite(numbers.F))):
            return np.nan
        poles = np.abs(eigvals(numbers.F, numbers.M)) if numbers.F.size else np.zeros(1)
        return float(np.max(poles))

    worst = fastest(values)
    if not worst > _FAR * top:
        return (), frozenset()
    moving = []
    for name, lost in zip(cost.names, unknown):
        step = 1e-3 * (abs(values[name]) or structure.parameter(name).magnitude)
        moved = fastest({**values, name: values[name] + step})
        if lost and name not in delays and not abs(moved - worst) <= 1e-4 * worst:
            moving.append(name)
    if not moving:
        return (), frozenset()
    advice = (
        f"degenerate: a pole at {worst:.3g} rad/s is far above the band's {top:.3g} rad/s, and the "
        f"data do not see what puts it there; fix {' or '.join(moving)}, or leave that lag out"
    )
    return (advice,), frozenset([*moving, *(set(cost.names) & delays)])


def delay_names(structure: Structure) -> set[str]:
    """Return the parameters that stand in a structure's delays."""
    entries = (one for one in structure.entries if one.matrix in DELAYS)
    return {name for entry in entries for name in entry.expression.names}


def doubt(
    structure: Structure,
    data: FrequencyResponse,
    band: tuple[float, float],
    poles: Iterable[complex],
    left: Misfit | None,
) -> Note | None:
    """Return what makes a converged fit doubtful that its cost doesn't show, None if nothing does.

    That is an unstable pole in the upper part of the band, which with too long a delay stands for
    a lag that the structure lacks; and errors many times noise, with the order that would follow.

    Args:
        structure: that was fitted.
        data: to what.
        band: lowest and highest frequency that was used, rad/s.
        poles: of the model, 1/s.
        left: what it leaves.
    """
    fast = max((abs(z) for z in poles if z.real > 0.0 and abs(z) > FAST * band[1]), default=0.0)
    worst = max(left.percent, key=lambda name: left.percent[name]) if left and left.phase else ""
    if fast:
        text = (
            f"an unstable pole at {fast:.3g} rad/s, where the band ends at {band[1]:.3g}: hardly "
            "the vehicle's, it makes up with the delay for a lag that the structure lacks"
        )
    elif left and (left.ratio or 0.0) >= _RATIO and left.percent[worst] >= _PERCENT:
        text = (
            f"{worst} is off by {left.percent[worst]:.2g} % rms where noise explains little of "
            "it: modes and derivatives can be off by more than their errors say"
        )
    else:
        return None
    kind = "unstable" if fast else "residual"
    larger = _larger(structure, data, band)
    if not larger:
        return Note(kind, f"{text}; try a structure with more states")
    return Note(kind, f"{text}; try the structure {larger}", (Option("structure", larger),))


def _larger(structure: Structure, data: FrequencyResponse, band: tuple[float, float]) -> str:
    """Return the transfer function that would follow where one doesn't, or nothing."""
    form = _polynomials(structure)
    if form is None:
        return ""
    o, i = data.index(structure.outputs[0], structure.inputs[0])
    inside = within(data.frequency, band) & data.usable()[o, i]
    if np.count_nonzero(inside) < 2:
        return ""
    begun = (form.zeros, form.poles)
    found = order(
        data.frequency[inside],
        data.response[o, i, inside],
        begun=begun,
        enough=_PERCENT / 100.0,
    )
    return f"tf:{found[0]}/{found[1]}" if found != begun else ""


class Residual(NamedTuple):
    """What a model leaves of a response.

    Attributes:
        name: of the response.
        omega: (n_freq,) rad/s.
        ratio: (n_freq,) measured over model.
        weight: (n_freq,) of the cost, which sums to J with the squares in dB and degrees.
        coherence: (n_freq,).
        delay: of the response, its input or its output; None where the structure has none.
    """

    name: str
    omega: Real
    ratio: NDArray[np.complex128]
    weight: Real
    coherence: Real
    delay: FittedParameter | None

    def cost(self, decibel: Real | float, phase: Real) -> Real:
        """Return each frequency's part of J of a ratio in dB and rad, (n_freq,)."""
        return self.weight * (decibel**2 + PHASE_WEIGHT * (DEGREES * phase) ** 2)

    @property
    def decibel(self) -> Real:
        """The ratio's magnitude, dB, (n_freq,)."""
        return DB_PER_NEPER * np.log(np.abs(self.ratio))

    @property
    def phase(self) -> Real:
        """The ratio's phase, rad, continuous and within half a turn in the middle, (n_freq,)."""
        phase = np.unwrap(np.angle(self.ratio))
        return phase - 2.0 * np.pi * np.round(np.median(phase) / (2.0 * np.pi))


def shapes(residuals: Iterable[Residual], costs: Mapping[str, float]) -> Iterator[Note]:
    """Yield what the shape of a failing fit's errors says, at most one cause a response.

    Args:
        residuals: of each fitted response.
        costs: J of each; what is low enough isn't looked at.
    """
    for left in residuals:
        if costs[left.name] > _HIGH:
            found = (rule(left) for rule in (_flipped, _delayed, _edge, _incoherent))
            yield from [note for note in found if note is not None][:1]


def _flipped(left: Residual) -> Note | None:
    """Return a sign, where data and model are half a turn apart throughout."""
    off = np.abs(np.angle(left.ratio))
    if np.quantile(off, 0.1) < _FLIPPED:
        return None
    output = left.name.partition("/")[0]
    text = (
        f"{left.name}: data and model are {DEGREES * float(np.median(off)):.0f} deg apart over the "
        "whole band: a sign is wrong, the output's or the input's"
    )
    return Note("sign", text, (Option("channel", f"{output}=COLUMN:UNIT:sign=-1"),))


def _delayed(left: Residual) -> Note | None:
    """Return a delay, where the phase that is left is a straight line over frequency."""
    phase, omega = left.phase, left.omega
    weight = left.weight / np.sum(left.weight)
    slope = float(np.sum(weight * omega * phase) / np.sum(weight * omega**2))
    in_phase = np.sum(left.cost(0.0, phase))
    explained = 1.0 - np.sum(left.cost(0.0, phase - slope * omega)) / in_phase
    if (
        abs(slope) * omega[-1] < _LEAST_PHASE
        or explained < _EXPLAINED
        or in_phase < 0.5 * np.sum(left.cost(left.decibel, phase))
    ):
        return None
    whose, remedy = "; the structure has none there: give it one", ()
    if left.delay is not None:
        name, fixed, (low, high) = left.delay.name, left.delay.fixed, left.delay.definition.limits
        value = left.delay.value - slope
        whose = f" than {name}{', which is fixed' if fixed else ''}"
        if fixed or low < value < high:
            remedy = (Option("fix" if fixed else "start", f"{name}={value:.3g}"),)
        else:
            whose += f", beyond its bounds of {low:.3g} to {high:.3g} s"
    text = (
        f"{left.name}: the phase {'falls' if slope < 0 else 'rises'} beyond the model's in "
        f"proportion to frequency, {DEGREES * abs(slope) * omega[-1]:.0f} deg at "
        f"{omega[-1]:.3g} rad/s ({100 * explained:.0f} % of its cost in phase): a delay "
        f"{'longer' if slope < 0 else 'shorter'} by {abs(slope):.3g} s{whose}"
    )
    return Note("delay", text, remedy)


def _edge(left: Residual) -> Note | None:
    """Return a band, where the cost is concentrated at one of its ends."""
    cost, omega = left.cost(left.decibel, left.phase), left.omega
    place = np.log(omega / omega[0]) / np.log(omega[-1] / omega[0])
    for side, there in (("lower", place <= _EDGE), ("upper", place >= 1.0 - _EDGE)):
        share, rest = float(np.sum(cost[there]) / np.sum(cost)), omega[~there]
        if share < _EXPLAINED or rest.size < 5:
            continue
        below = side == "lower"
        low, high = (rest[0], omega[-1]) if below else (omega[0], rest[-1])
        text = (
            f"{left.name}: {100 * share:.0f} % of its cost is at the band's {side} edge, "
            f"{'below' if below else 'above'} {low if below else high:.3g} rad/s, where the "
            "structure doesn't follow or the data are poor"
        )
        return Note("band", text, (Option("band", f"{low:.2g} {high:.2g}"),))
    return None


def _incoherent(left: Residual) -> Note | None:
    """Return data to doubt, where the coherence is low throughout."""
    mean = float(np.mean(left.coherence))
    if mean >= _DOUBTFUL:
        return None
    return Note.of(
        "coherence",
        f"{left.name}: coherence is {mean:.2f} on average: something else moves "
        f"{left.name.partition('/')[0]}, or the sweep is short or small; name what else acts, or "
        "leave the response out",
        remedy="conditioning,responses",
    )
