"""Says why a fit may fail: what its data show of units, signs, columns, delays and bands.

Two ways, both from the fit and its frequency response alone: the shape of what the model leaves
(a phase that keeps falling is a delay, one of half a turn a sign, an edge of the band a band), and
trials: the same structure fitted to the data as they would be with another unit or sign, or with
columns swapped.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import HelisimError
from helisim.base.units import DB_PER_NEPER
from helisim.ident.fitting.points import PHASE_WEIGHT
from helisim.ident.fitting.trials import DEGREES, Kind, trials
from helisim.ident.model.structure import Structure
from helisim.ident.response import FrequencyResponse

if TYPE_CHECKING:
    from helisim.ident.fitting.result import Fit

_HIGH = 50.0
"""Cost of a response, from which what it leaves is looked at: below, it is excellent."""
_EXPLAINED = 0.75
"""Share of a response's cost that a delay, or an edge of the band, must take away."""
_LEAST_PHASE = 0.35
"""rad, at the band's upper edge: a smaller delay isn't worth a word."""
_FLIPPED = 2.4
"""rad, of half a turn, that a flipped response's phase is off at nearly all points."""
_EDGE = 0.34
"""Of a band's points, that count as its edge."""
_DOUBTFUL = 0.75
"""Mean coherence of a response below which its data are doubted."""
_BETTER = 0.3
"""Of the cost, that a trial may leave at most to be worth a word."""
_TOLD, _CLOSE = 3, 3.0
"""Trials that are told: those that leave no more than three times as much as the best."""
_TRIALS = 24
_LARGEST = 12
"""Trials, and free parameters of a structure that is tried: so that it takes seconds at most."""
_SEARCHES = 3


@dataclass(frozen=True)
class Suspicion:
    """A likely cause of a fit that fails.

    Attributes:
        kind: "delay", "sign", "band", "coherence", "unit", "columns" or "order".
        text: what the data show, how clearly, and what to try.
        option: of the command line, to try.
    """

    kind: Kind
    text: str
    option: str = ""

    def to_dict(self) -> dict[str, str]:
        """Return plain data for JSON."""
        return {"kind": self.kind, "text": self.text, "option": self.option}


class _Left(NamedTuple):
    """What a model leaves of a response.

    Attributes:
        name: of the response.
        omega: (n_freq,) rad/s.
        ratio: (n_freq,) measured over model.
        weight: (n_freq,) of the cost, which sums to J with the squares in dB and degrees.
    """

    name: str
    omega: NDArray[np.float64]
    ratio: NDArray[np.complex128]
    weight: NDArray[np.float64]

    def cost(self, log_ratio: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return each frequency's part of J of a ratio's logarithm, (n_freq,)."""
        decibel, degree = DB_PER_NEPER * log_ratio.real, DEGREES * log_ratio.imag
        return self.weight * (decibel**2 + PHASE_WEIGHT * degree**2)

    @property
    def logarithm(self) -> NDArray[np.complex128]:
        """The ratio's logarithm, its phase continuous and within half a turn in the middle."""
        phase = np.unwrap(np.angle(self.ratio))
        phase -= 2.0 * np.pi * np.round(np.median(phase) / (2.0 * np.pi))
        return np.asarray(np.log(np.abs(self.ratio)) + 1j * phase, dtype=np.complex128)


def shapes(fit: "Fit") -> tuple[Suspicion, ...]:
    """Return what the shape of a failing fit's errors says; nothing of an acceptable one."""
    if fit.acceptable:
        return ()
    found: list[Suspicion] = []
    for left in _left(fit):
        if fit.costs[left.name] <= _HIGH:
            continue
        for look in (_flipped, _delayed, _edge, _incoherent):
            one = look(fit, left)
            if one is not None:
                found.append(one)
                break
    return tuple(found)


def suspicions(fit: "Fit") -> tuple[Suspicion, ...]:
    """Return the likely causes that a failing fit's data show, the clearest first.

    Fits the structure again to the data as they would be with other units or signs, and with
    columns swapped: a few seconds at most. An acceptable fit has none.

    Args:
        fit: that of `identify`.
    """
    if fit.acceptable:
        return ()
    tried = _tried(fit)
    # a wrong unit, column or delay shows at an edge of the band, too
    return (*tried, *(one for one in shapes(fit) if not tried or one.kind == "coherence"))


def _left(fit: "Fit") -> Iterator[_Left]:
    """Yield what the model leaves of each response that was fitted."""
    data = fit.data
    model = fit.response(data.frequency)
    for name, (low, high) in fit.bands.items():
        output, _, input_ = name.partition("/")
        o, i = data.index(output, input_)
        inside = (data.frequency >= low * (1 - 1e-9)) & (data.frequency <= high * (1 + 1e-9))
        inside &= data.usable()[o, i]
        mo, mi = model.index(output, input_)
        predicted = model.response[mo, mi, inside]
        measured = data.response[o, i, inside]
        if not inside.any() or not np.all(np.abs(predicted) * np.abs(measured) > 0.0):
            continue
        coherence = data.coherence[o, i, inside]
        weight = 20.0 / coherence.size * (1.58 * (1.0 - np.exp(-coherence))) ** 2
        yield _Left(name, data.frequency[inside], measured / predicted, weight)


def _flipped(fit: "Fit", left: _Left) -> Suspicion | None:
    """Return a sign, where data and model are half a turn apart throughout."""
    off = np.abs(np.angle(left.ratio))
    if np.quantile(off, 0.1) < _FLIPPED:
        return None
    output = left.name.partition("/")[0]
    option = f"--channel {output}=COLUMN:UNIT:sign=-1"
    return Suspicion(
        "sign",
        f"{left.name}: data and model are {DEGREES * float(np.median(off)):.0f} deg apart over "
        f"the whole band: a sign is wrong; try {option}, or the input's",
        option,
    )


def _delayed(fit: "Fit", left: _Left) -> Suspicion | None:
    """Return a delay, where the phase that is left is a straight line over frequency."""
    gone = left.logarithm
    weight = left.weight / np.sum(left.weight)
    slope = float(np.sum(weight * left.omega * gone.imag) / np.sum(weight * left.omega**2))
    cost = left.cost(gone)
    phase = left.cost(_turned(gone.imag))
    rest = left.cost(_turned(gone.imag - slope * left.omega))
    explained = 1.0 - np.sum(rest) / np.sum(phase)
    if (
        abs(slope) * left.omega[-1] < _LEAST_PHASE
        or explained < _EXPLAINED
        or np.sum(phase) < 0.5 * np.sum(cost)
    ):
        return None
    name, option = _delay_option(fit, left.name, -slope)
    return Suspicion(
        "delay",
        f"{left.name}: the phase {'falls' if slope < 0 else 'rises'} beyond the model's in "
        f"proportion to frequency, {DEGREES * abs(slope) * left.omega[-1]:.0f} deg at "
        f"{left.omega[-1]:.3g} rad/s ({100 * explained:.0f} % of its cost in phase): a delay "
        f"{'longer' if slope < 0 else 'shorter'} by {abs(slope):.3g} s{name}"
        + (f"; try {option}" if option else ""),
        option,
    )


def _turned(phase: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the logarithm of ratios that differ in phase alone, (n_freq,)."""
    return np.asarray(1j * phase, dtype=np.complex128)


def _delay_option(fit: "Fit", response: str, longer: float) -> tuple[str, str]:
    """Return whose delay it is, for people, and the option that starts it there."""
    output, _, input_ = response.partition("/")
    structure = fit.structure
    named = (
        structure.delays.get(response),
        structure.input_delays.get(input_),
        structure.output_delays.get(output),
    )
    for expression in named:
        parameter = fit.parameters.get(expression or "")
        if parameter is None or expression is None:
            continue
        value = parameter.value + longer
        one = next(p for p in structure.parameters if p.name == expression)
        if one.fixed:
            return f" than {expression}, which is fixed", f"--fix {expression}={value:.3g}"
        low, high = one.limits
        if not low < value < high:
            return f" than {expression}, beyond its bounds of {low:.3g} to {high:.3g} s", ""
        return f" than {expression}", f"--start {expression}={value:.3g}"
    return "; the structure has none there: give it one", ""


def _edge(fit: "Fit", left: _Left) -> Suspicion | None:
    """Return a band, where the cost is concentrated at one of its ends."""
    cost = left.cost(left.logarithm)
    place = np.log(left.omega / left.omega[0]) / np.log(left.omega[-1] / left.omega[0])
    low, high = left.omega[0], left.omega[-1]
    for side, there in (("lower", place <= _EDGE), ("upper", place >= 1.0 - _EDGE)):
        share = float(np.sum(cost[there]) / np.sum(cost))
        rest = left.omega[~there]
        if share < _EXPLAINED or rest.size < 5:
            continue
        kept = (float(rest[0]), high) if side == "lower" else (low, float(rest[-1]))
        option = f"--band {kept[0]:.2g} {kept[1]:.2g}"
        return Suspicion(
            "band",
            f"{left.name}: {100 * share:.0f} % of its cost is at the band's {side} edge, "
            f"{'below' if side == 'lower' else 'above'} "
            f"{kept[0] if side == 'lower' else kept[1]:.3g} rad/s, where the structure doesn't "
            f"follow or the data are poor; try {option}",
            option,
        )
    return None


def _incoherent(fit: "Fit", left: _Left) -> Suspicion | None:
    """Return data to doubt, where the coherence is low throughout."""
    output, _, input_ = left.name.partition("/")
    o, i = fit.data.index(output, input_)
    inside = np.isin(fit.data.frequency, left.omega)
    mean = float(np.mean(fit.data.coherence[o, i, inside]))
    if mean >= _DOUBTFUL:
        return None
    return Suspicion(
        "coherence",
        f"{left.name}: coherence is {mean:.2f} on average: something else moves {output}, or the "
        "sweep is short or small; name what else acts with --conditioning, or leave the response "
        "out with --responses",
    )


def _tried(fit: "Fit") -> tuple[Suspicion, ...]:
    """Return the changes of the data with which the same structure fits far better."""
    if len(fit.structure.free) > _LARGEST:
        return ()
    plain = replace(fit.data, scatter=None, direct=None)
    base = _cost(fit, plain)
    better = []
    for trial in trials(fit, plain)[:_TRIALS]:
        cost = _cost(fit, trial.data, trial.structure)
        if cost < _BETTER * base:
            text = f"{trial.text}: J would be {cost:.3g}, not {base:.3g}"
            text += f"; try {trial.option}" if trial.option else ""
            better.append((cost, Suspicion(trial.kind, text, trial.option)))
    better.sort(key=lambda pair: pair[0])
    return tuple(one for cost, one in better[:_TOLD] if cost < _CLOSE * better[0][0] + 1.0)


def _cost(fit: "Fit", data: FrequencyResponse, structure: Structure | None = None) -> float:
    """Return the cost of the fit's structure, or another one, on other data.

    Infinite where it can't be fitted.
    """
    from helisim.ident.fitting.fit import identify

    options: Any = {
        "responses": fit.options.get("responses"),
        "frequencies_per_response": fit.options.get("frequencies_per_response", 20),
    }
    try:
        return identify(
            data,
            structure or fit.structure,
            band=fit.band,
            searches=_SEARCHES,
            weighting="coherence",
            **options,
        ).cost
    except HelisimError:
        return math.inf
