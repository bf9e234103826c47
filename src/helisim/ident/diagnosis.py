"""The verdict on a fit, and what is doubtful in it: residual, unsupported parameters, causes."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.special import fdtri

from helisim.base.arrays import Real
from helisim.base.errors import InputError
from helisim.base.note import Note, Option
from helisim.base.settings import FrozenMap, Value, convert
from helisim.base.units import DB_PER_NEPER
from helisim.ident.cost import PHASE_WEIGHT, Cost, coherence_weight
from helisim.ident.fitted import finite
from helisim.ident.rational import FAST
from helisim.ident.search import Minimum
from helisim.ident.structure import DELAYS, Structure
from helisim.ident.structures import Rational, rational_form, transfer_function

Word = Literal["sound", "doubtful", "wrong"]

_CAUSES = frozenset({"degenerate", "columns", "sign", "unit", "flapping", "cost"})
_DOUBTS = frozenset(
    [
        "nonlinear",
        "records",
        "lost",
        "corruption",
        "frozen",
        "varying",
        "drift",
        "clock",
        "delay",
        "lag",
        "residual",
        "unstable",
        "search",
        "mode",
        "bound",
        "starts",
        "feedback",
        "support",
    ]
)


@dataclass(frozen=True)
class Verdict:
    """A fit's verdict, with the notes that made it so, the worst first.

    "wrong": a cause was found for which the numbers are not the vehicle's. "doubtful": they may be
    off by more than their errors say. "sound": no check found anything.
    """

    word: Word
    reasons: tuple[Note, ...] = ()

    @classmethod
    def of(cls, notes: Iterable[Note]) -> "Verdict":
        """Return the verdict that notes make."""
        told = tuple(notes)
        wrong, doubtful = (
            tuple(one for one in told if one.kind in kinds) for kinds in (_CAUSES, _DOUBTS)
        )
        return cls("wrong" if wrong else "doubtful" if doubtful else "sound", wrong + doubtful)

    def __str__(self) -> str:
        return self.text()

    def text(self, say: Callable[[Note], str] = str) -> str:
        """Return the verdict in one line; `say` words a note."""
        more = f" (and {len(self.reasons) - 1} more)" if len(self.reasons) > 1 else ""
        why = f": {say(self.reasons[0])}{more}" if self.reasons else ""
        return f"verdict: {self.word}{why}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "word": self.word,
            "reasons": [{"kind": one.kind, "text": one.text} for one in self.reasons],
        }


DEGREES = 180.0 / math.pi
RATIO_LIMIT = 2.0  # residuals of more times the noise's power are the structure's own
# Probability up to which noise alone explains what a higher order gains (a cancelling pair looks
# for the frequency where noise makes it most useful: 95 % would believe too much), and a rise of
# the average cost that is none, however little noise there is: 0.002 dB
_BELIEVED, _NOTHING = 0.999, 1e-4
_FAR = 5.0  # times the band's top: farther poles are not in the data
# Times the noise's power, and percent of a response, from which a residual is worth a word
_RATIO, _PERCENT = 10.0, 5.0
# _EXPLAINED: share of a response's cost at one edge of the band
# _EDGE: of a band's points, that are its edge
_EXPLAINED, _EDGE = 0.75, 0.34
_DELAY_ERRORS, _EARLY = 3.0, 0.01  # errors, and s (a sample of most logs), that a delay may lead
# _LARGEST_FLAPPING: rad at full travel, 29 degrees: rotors flap by a third of that
# _DOUBTFUL: mean coherence below which a response's data are doubted
_LARGEST_FLAPPING, _DOUBTFUL = 0.5, 0.75


@dataclass(frozen=True, eq=False)
class Residual(Value):
    """Rms residual of each response ("p/lat") without noise's part: `magnitude` dB, `phase` deg.

    `ratio` is the residuals' power over the noise's; None if noise is unknown and not taken out.
    """

    magnitude: Mapping[str, float]
    phase: Mapping[str, float]
    ratio: float | None

    def __post_init__(self) -> None:
        for name in ("magnitude", "phase"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    @property
    def percent(self) -> dict[str, float]:
        """Rms of each response's relative error, percent; magnitude and phase together."""
        return {
            name: 100.0 * math.hypot(self.magnitude[name] / DB_PER_NEPER, math.radians(phase))
            for name, phase in self.phase.items()
        }

    @property
    def summary(self) -> str:
        """Meaning of the ratio, in a line."""
        if self.ratio is None:
            return "how much of the residual is noise isn't known"
        said = f"what the model leaves is {self.ratio:.3g} times what noise would leave"
        if self.ratio > RATIO_LIMIT:
            said += "; the structure can't follow, and the standard errors hold what that makes"
        return said

    def words(self, name: str) -> str:
        """Return a response's residual as text, such as "0.12 dB, 0.8 deg beyond noise"."""
        which = "noise included" if self.ratio is None else "beyond noise"
        return f"{self.magnitude[name]:.2g} dB, {self.phase[name]:.2g} deg {which}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        percent = {name: finite(x) for name, x in self.percent.items()}
        return {
            "magnitude_db": {name: finite(x) for name, x in self.magnitude.items()},
            "phase_deg": {name: finite(x) for name, x in self.phase.items()},
            "percent": percent,
            "ratio": self.ratio,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Residual":
        """Read what `to_dict` wrote. Raises InputError."""
        keys = ("magnitude_db", "phase_deg")
        rows = [convert(Mapping[str, float | None], data.get(key), key) for key in keys]
        if {*rows[0]} != {*rows[1]}:
            raise InputError(f"residual has other responses in {keys[0]} than in {keys[1]}")
        sizes = ({k: math.inf if x is None else x for k, x in row.items()} for row in rows)
        magnitude, phase = sizes
        return cls(magnitude, phase, convert(float | None, data.get("ratio"), "ratio"))


def residual(cost: Cost, x: Real, noise: Real | None, ratio: float | None) -> Residual:
    """Return the residual of a fit at x, (n_free,); `noise`, (2 n_point,), as in `Accuracy`."""
    z, _ = cost.ratio(x)
    with np.errstate(all="ignore"):
        squares = np.array([np.log(np.abs(z)) ** 2, np.angle(z) ** 2])
    if noise is not None:
        squares = squares - noise.reshape(2, -1)
    rms = {
        name: np.sqrt(np.maximum(squares[:, cost.points.pair == k].mean(axis=1), 0.0))
        for k, name in enumerate(cost.points.pairs)
    }
    return Residual(
        magnitude={name: float(DB_PER_NEPER * one[0]) for name, one in rms.items()},
        phase={name: float(np.rad2deg(one[1])) for name, one in rms.items()},
        ratio=ratio,
    )


Degenerate = tuple[tuple[str, ...], frozenset[str], str]


def degenerate(
    cost: Cost,
    best: Minimum,
    bounds: Real,
    squares: Callable[[Cost, Minimum], float],
    fitted: Callable[[Cost], Minimum],
) -> Degenerate:
    """Return whether a fit has poles beyond the band, cancelled ones, or too high an order.

    What is told, the parameters' names, and the lower order, such as "tf:1/2", or "". `bounds` are
    Cramér-Rao's, (n_free,); `fitted` fits another structure to the same points.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        unknown = bounds >= np.abs(best.x)  # only then are lower orders tried
    if not np.any(unknown):
        return (), frozenset(), ""
    form = rational_form(cost.structure)
    if form is None or any(one.fixed for one in cost.structure.parameters):
        return _far_poles(cost, best.x, unknown)
    lower = _lower_order(cost, best, form, squares, fitted)
    if lower is None:
        return (), frozenset(), ""
    zeros, poles, average = lower
    advice = (
        f"degenerate: the data do not see all of its coefficients; fit tf:{zeros}/{poles} instead, "
        f"whose J of {average:.4g} is no worse but for noise"
    )
    return (advice,), frozenset(cost.structure.names), f"tf:{zeros}/{poles}"


def _lower_order(
    cost: Cost,
    best: Minimum,
    form: Rational,
    squares: Callable[[Cost, Minimum], float],
    fitted: Callable[[Cost], Minimum],
) -> tuple[int, int, float] | None:
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


def _far_poles(cost: Cost, x: Real, unknown: NDArray[np.bool_]) -> Degenerate:
    top, late = float(np.max(cost.points.frequency)), delay_names(cost.structure)
    lost = [name for name, one in zip(cost.names, unknown) if one and name not in late]
    numbers = cost.structure.matrices(cost.values(x))
    f, m = numbers["F"], numbers["M"]
    if not (lost and f.size and np.all(np.isfinite(f + m))):
        return (), frozenset(), ""
    worst = float(np.max(np.abs(eigvals(f, m))))
    if not worst > _FAR * top:
        return (), frozenset(), ""
    advice = (
        f"degenerate: a pole at {worst:.3g} rad/s is far above the band's {top:.3g} rad/s, and the "
        f"data do not see what puts it there; fix {' or '.join(lost)}, or leave that lag out"
    )
    return (advice,), frozenset([*lost, *(set(cost.names) & late)]), ""


def delay_names(structure: Structure) -> set[str]:
    """Return the parameters in a structure's delays."""
    return {
        name for one in structure.entries if one.matrix in DELAYS for name in one.expression.names
    }


def doubt(
    band: tuple[float, float], poles: Iterable[complex], left: Residual | None
) -> Note | None:
    """Return a doubt of a converged fit: an unstable pole high in the band (rad/s), or residual."""
    fast = max((abs(z) for z in poles if z.real > 0.0 and abs(z) > FAST * band[1]), default=0.0)
    worst = max(left.percent, key=lambda name: left.percent[name]) if left and left.phase else ""
    if fast:
        return Note(
            "unstable",
            f"an unstable pole at {fast:.3g} rad/s, where the band ends at {band[1]:.3g}: hardly "
            "the vehicle's, it makes up with the delay for a lag that the structure lacks; try a "
            "structure with more states",
        )
    if left and (left.ratio or 0.0) >= _RATIO and left.percent[worst] >= _PERCENT:
        return Note(
            "residual",
            f"{worst} is off by {left.percent[worst]:.2g} % rms where noise explains little of "
            "it: modes and derivatives can be off by more than their errors say; try a structure "
            "with more states",
        )
    return None


def implausible(
    structure: Structure,
    values: Mapping[str, tuple[float, float]],
    poles: Iterable[complex],
    band: tuple[float, float],
    line: float,
    full: Mapping[str, float],
    opposed: bool,
) -> Iterator[Note]:
    """Yield what no vehicle has: `values` are parameters with standard errors.

    `line` is the spacing of the longest record's lines, rad/s; 0 if it is unknown; no pole beyond
    the `band` is smeared by it. `full` has full travel of commands, where it is known; `opposed` is
    whether the response looks like a controller's inverse, and no reference says what moved it.
    """
    # where nothing tells full travel, it is half of the stick's, as helisim's own is
    travel = max(full.get(name, 0.5) for name in structure.inputs)
    for one in structure.free:
        value, error = values[one.name]
        least = error if opposed else -max(_DELAY_ERRORS * error, _EARLY)
        if one.name in delay_names(structure) and value < least:
            yield Note.of(
                "delay",
                f"{one.name} is {1e3 * value:.3g} +- {1e3 * error:.2g} ms: the answer "
                + (
                    "doesn't follow its cause, and opposes it, as what a controller answers; if "
                    "only the sign is another, as of an elevator, turn the input (sign=-1)"
                    if opposed
                    else "leads its cause; the columns' times differ, or the input is not what "
                    "drives it"
                ),
                remedy="channel" if opposed else "",
            )
        if one.unit == "rad" and travel * (abs(value) - error) > _LARGEST_FLAPPING:
            yield Note(
                "flapping",
                f"{one.name} is {value:.3g} rad per unit of stick, and blades flap by a fraction "
                "of that; look at the units of the rates and of the input",
            )
    narrow = [
        pole
        for pole in poles
        if 0.0 < -2.0 * pole.real < line and max(line, band[0] - line) < pole.imag < band[1] + line
    ]
    if narrow:
        yield Note(
            "mode",
            f"the mode at {abs(narrow[0]):.3g} rad/s is {-2.0 * narrow[0].real:.2g} rad/s wide, "
            f"narrower than a line of the longest record, {line:.2g} rad/s: its damping is "
            "smeared; fly longer",
        )


def shape(name: str, omega: Real, ratio: NDArray[np.complex128], coherence: Real) -> Note | None:
    """Return the likely cause of errors by their shape, (n_freq,) measured over model, or None."""
    phase = np.unwrap(np.angle(ratio))
    phase -= 2.0 * np.pi * np.round(np.median(phase) / (2.0 * np.pi))
    squares = (DB_PER_NEPER * np.log(np.abs(ratio))) ** 2 + PHASE_WEIGHT * (DEGREES * phase) ** 2
    cost = coherence_weight(coherence) * squares
    place = np.log(omega / omega[0]) / np.log(omega[-1] / omega[0])
    for side, there in (("lower", place <= _EDGE), ("upper", place >= 1.0 - _EDGE)):
        share, rest = float(np.sum(cost[there]) / np.sum(cost)), omega[~there]
        if share >= _EXPLAINED and rest.size >= 5:
            low, high = (rest[0], omega[-1]) if side == "lower" else (omega[0], rest[-1])
            text = (
                f"{name}: {100 * share:.0f} % of its cost is at the band's {side} edge, outside "
                f"{low:.3g} to {high:.3g} rad/s, where the structure doesn't follow or the data "
                "are poor"
            )
            return Note("band", text, (Option("band", f"{low:.2g} {high:.2g}"),))
    mean = float(np.mean(coherence))
    if mean >= _DOUBTFUL:
        return None
    return Note.of(
        "coherence",
        f"{name}: coherence is {mean:.2f} on average: something else moves "
        f"{name.partition('/')[0]}, or the sweep is short or small; name what else acts, or "
        "leave the response out",
        remedy="conditioning,responses",
    )
