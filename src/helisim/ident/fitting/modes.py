"""Poles and zeros of an identified model, with the errors that its parameters' errors give them.

Both are where a pencil P(s) is singular: s M - F for the poles, and for the zeros of y/u

    [ F - s M     G      ]
    [ H0 + s H1   D + s D1 ] .

With null vectors l P(s_i) = 0, P(s_i) r = 0, scaled to l dP/ds r = -1, a change dP of the matrices
moves the root by l dP r. That and the parameters' covariance are its covariance (the delta method),
as long as roots move little against what separates them: the next term of the series is a product
of two such changes over that distance. Where it isn't small, as of a real pair that is about to
become a complex one, errors are marked: they are not those of a root but of one that could merge.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed
from helisim.base.errors import UnknownNameError
from helisim.base.value import FrozenMap, Value
from helisim.ident.model.pencil import Pencil, pole_pencil, zero_pencil

if TYPE_CHECKING:
    from helisim.ident.fitting.result import Fit
    from helisim.ident.model.structure import Structure

_CURVED = 0.25
"""Second-order part of a root's change over its standard error, from which the error is marked."""

_ROUNDING = 1e-13
"""Part of the fastest root that is nothing in an error."""

_ORIGIN = 1e-9
"""Rad/s: a root nearer to zero than that is an integrator, or a zero at the origin."""


@dataclass(frozen=True)
class Mode:
    """One pole or zero, real or of a complex pair.

    Attributes:
        real: real part, 1/s.
        imag: imaginary part, rad/s, never negative: a pair is one mode.
        real_error: standard error of `real`; nan where the fit doesn't state its covariance.
        imag_error: standard error of `imag`.
        correlation: between the errors of `real` and `imag`.
        separate: False where another one is so near that the two could merge within the errors,
            so that the errors are no more than an order of magnitude.
    """

    real: float
    imag: float
    real_error: float = math.nan
    imag_error: float = math.nan
    correlation: float = 0.0
    separate: bool = True

    @property
    def value(self) -> complex:
        """The root, 1/s."""
        return complex(self.real, self.imag)

    @property
    def oscillates(self) -> bool:
        """Whether it is a complex pair."""
        return self.imag > 0.0

    @property
    def frequency(self) -> float:
        """Natural frequency, rad/s; of a real one its distance from zero."""
        return abs(self.value)

    @property
    def frequency_error(self) -> float:
        """Standard error of `frequency`, rad/s."""
        if self.frequency == 0.0:
            return math.hypot(self.real_error, self.imag_error)
        return self._error(self.real / self.frequency, self.imag / self.frequency)

    @property
    def damping(self) -> float:
        """Damping ratio: negative where it grows, and 1 or -1 of a real one; nan at zero."""
        return -self.real / self.frequency if self.frequency else math.nan

    @property
    def damping_error(self) -> float:
        """Standard error of `damping`; 0 of a real one."""
        if not self.oscillates:
            return 0.0
        cube = self.frequency**3
        return self._error(-(self.imag**2) / cube, self.real * self.imag / cube)

    @property
    def time(self) -> float:
        """Time constant, s: what decays or grows does so by e in it; infinite on the axis."""
        return 1.0 / abs(self.real) if self.real else math.inf

    @property
    def time_error(self) -> float:
        """Standard error of `time`, s."""
        return self.real_error / self.real**2 if self.real else math.inf

    @property
    def doubling(self) -> float | None:
        """Time to double, s, of what grows; None of what decays."""
        return math.log(2.0) / self.real if self.real > _ORIGIN else None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; what isn't finite becomes None."""
        numbers = {
            "real": self.real,
            "imag": self.imag,
            "real_error": self.real_error,
            "imag_error": self.imag_error,
            "frequency_rad_s": self.frequency,
            "frequency_error": self.frequency_error,
            "damping": self.damping,
            "damping_error": self.damping_error,
            "time_s": self.time,
            "time_error": self.time_error,
            "doubling_s": self.doubling,
        }
        plain = {
            name: x if x is not None and math.isfinite(x) else None for name, x in numbers.items()
        }
        return {**plain, "separate": self.separate}

    def _error(self, by_real: float, by_imag: float) -> float:
        """Return the standard error of what changes so by the real and the imaginary part."""
        one = by_real * self.real_error if by_real else 0.0
        other = by_imag * self.imag_error if by_imag else 0.0
        if math.isinf(one) or math.isinf(other):
            return math.inf
        return math.sqrt(max(one**2 + other**2 + 2.0 * self.correlation * one * other, 0.0))


@dataclass(frozen=True, eq=False)
class Modes(Value, Displayed):
    """Poles of a fitted model and zeros of each of its responses, slowest first.

    Attributes:
        poles: of the model.
        zeros: of each fitted response by name, such as "p/lat"; without those that cancel poles.
        gains: of each fitted response, what s^(poles - zeros) leaves of it at high frequency.
    """

    poles: tuple[Mode, ...]
    zeros: Mapping[str, tuple[Mode, ...]]
    gains: Mapping[str, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "zeros", FrozenMap(self.zeros))
        object.__setattr__(self, "gains", FrozenMap(self.gains))

    def __getitem__(self, response: str) -> tuple[Mode, ...]:
        """Return the zeros of a response. Raises UnknownNameError."""
        if response not in self.zeros:
            raise UnknownNameError("response", response, self.zeros)
        return self.zeros[response]

    def __repr__(self) -> str:
        return f"Modes({len(self.poles)} poles; zeros of {', '.join(self.zeros)})"

    def __str__(self) -> str:
        return "\n".join(text_lines(self))

    @cached_property
    def stable(self) -> bool:
        """Whether every pole decays."""
        return all(one.real < 0.0 for one in self.poles)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "poles": [one.to_dict() for one in self.poles],
            "zeros": {name: [one.to_dict() for one in some] for name, some in self.zeros.items()},
            "gains": dict(self.gains),
        }


def modes_of(fit: "Fit") -> Modes:
    """Return poles and zeros of a fit, with the errors of its free and of its known parameters.

    Raises:
        IdentificationError: M is singular.
    """
    names = [one.name for one in fit.structure.free]
    known = [one for one in fit.structure.parameters if one.error > 0.0]
    covariance = fit.covariance
    if covariance is not None and fit.carried is not None and known:
        errors = np.array([one.error for one in known])
        across = fit.carried * errors
        covariance = np.block([[covariance, across], [across.T, np.diag(errors**2)]])
        names += [one.name for one in known]
    return modes(fit.structure, fit.values, tuple(fit.costs), names=names, covariance=covariance)


def modes(
    structure: "Structure",
    values: Mapping[str, float],
    responses: Sequence[str],
    *,
    names: Sequence[str] = (),
    covariance: NDArray[np.float64] | None = None,
) -> Modes:
    """Return poles and zeros of a structure with numbers.

    Args:
        structure: the model's.
        values: every parameter by name.
        responses: whose zeros are wanted, such as "p/lat".
        names: of the parameters that are uncertain.
        covariance: (n_name, n_name) of their errors, infinite on the diagonal where unknown; None
            states no errors.

    Raises:
        IdentificationError: M is singular.
    """
    spread = None if covariance is None else (tuple(names), covariance)
    poles = pole_pencil(structure, values)
    zeros, gains = {}, {}
    for name in responses:
        pencil, gains[name] = zero_pencil(structure, values, name, poles)
        zeros[name] = _found(pencil, spread)
    return Modes(_found(poles, spread), zeros, gains)


def _found(
    pencil: Pencil, spread: tuple[tuple[str, ...], NDArray[np.float64]] | None
) -> tuple[Mode, ...]:
    """Return the pencil's roots with their errors."""
    found = []
    # (n_name, n_root, n_root) by which a change of each parameter joins two roots
    joins = None if spread is None else pencil.changes(spread[0])
    for k, root in enumerate(pencil.roots):
        if root.imag < 0.0:
            continue
        mode = Mode(float(root.real) + 0.0, float(root.imag))
        if joins is not None and spread is not None:
            mode = _with_errors(
                mode, k, pencil, joins, spread[1], [pencil.values[n] for n in spread[0]]
            )
        found.append(mode)
    return tuple(sorted(found, key=lambda one: (one.frequency, one.real)))


def _with_errors(
    mode: Mode,
    k: int,
    pencil: Pencil,
    joins: NDArray[np.complex128],
    covariance: NDArray[np.float64],
    values: Sequence[float],
) -> Mode:
    slope = joins[:, k, k]
    unknown = ~np.isfinite(np.diagonal(covariance))
    known = np.where(unknown[:, None] | unknown[None, :], 0.0, covariance)
    parts = np.array([slope.real, slope.imag])
    inside = parts @ known @ parts.T
    # A parameter that the data do not see leaves a root unknown, unless it does not move it.
    reach = np.abs(slope) * np.abs(values) > 1e-9 * max(mode.frequency, 1e-9)
    lost = bool(np.any(unknown & reach)) or not np.all(np.isfinite(slope))
    if lost:
        return Mode(mode.real, mode.imag, math.inf, math.inf if mode.imag else 0.0, 0.0, False)
    real, imag = np.sqrt(np.maximum(np.diagonal(inside), 0.0)).tolist()
    if math.hypot(real, imag) < _ROUNDING * np.max(np.abs(pencil.roots)):
        return Mode(mode.real, mode.imag, 0.0, 0.0)
    if not mode.imag:
        imag = 0.0
    correlation = float(inside[0, 1]) / (real * imag) if real * imag > 0.0 else 0.0
    size = math.hypot(real, imag)
    separate = True
    for j, other in enumerate(pencil.roots):
        if j == k:
            continue
        there, back = (_power(joins[:, a, b], known) for a, b in ((k, j), (j, k)))
        bend = math.sqrt(there * back)
        if bend > 0.0 and bend > _CURVED * size * abs(pencil.roots[k] - other):
            separate = False
    return Mode(mode.real, mode.imag, real, imag, float(np.clip(correlation, -1.0, 1.0)), separate)


def _power(slope: NDArray[np.complex128], covariance: NDArray[np.float64]) -> float:
    """Return the mean square of a change with these slopes."""
    return max(float(np.real(slope @ covariance @ slope.conj())), 0.0)


def text_lines(found: Modes) -> list[str]:
    """Return modes as lines of text, headings first."""
    rows = [("pole", one) for one in found.poles]
    rows += [(f"zero {name}", one) for name, some in found.zeros.items() for one in some]
    width = max((len(name) for name, _ in rows), default=4)
    roots = max((len(_root(one)) for _, one in rows), default=0)
    roots = max(roots, len("root, 1/s"))
    head = f"{'mode':<{width}}  {'root, 1/s':>{roots}}  {'rad/s':>8} {'error':>7}  "
    return [
        f"{head}{'damping':>7} {'error':>7}  {'time, s':>8} {'error':>7}",
        *(
            f"{name:<{width}}  {_root(one):>{roots}}  {_line(name, one)}".rstrip()
            for name, one in rows
        ),
    ]


def _root(one: Mode) -> str:
    return f"{one.real:.4g}" + (f" +- {one.imag:.4g}j" if one.oscillates else "")


def _line(name: str, one: Mode) -> str:
    damping = f"{'-':>7} {'-':>7}"
    if one.oscillates:
        damping = f"{one.damping:7.3f} {_text(one.damping_error, 7, 2)}"
    return (
        f"{_text(one.frequency, 8)} {_text(one.frequency_error, 7, 2)}  "
        f"{damping}  "
        f"{_text(one.time, 8)} {_text(one.time_error, 7, 2)}  {'; '.join(mode_notes(name, one))}"
    )


def mode_notes(name: str, one: Mode) -> list[str]:
    """Return what a reader should know of a mode beside its numbers.

    Args:
        name: "pole", or "zero" with its response.
        one: the mode.
    """
    found = []
    if one.doubling is not None:
        pole = name.startswith("pole")
        found.append(f"doubles in {one.doubling:.3g} s" if pole else "non-minimum phase")
    if not one.separate:
        found.append("could merge with another: errors are rough")
    return found


def _text(x: float, width: int, digits: int = 4) -> str:
    return f"{x:{width}.{digits}g}" if math.isfinite(x) else f"{'-':>{width}}"
