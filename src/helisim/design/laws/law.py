"""What every control law is: plain data that is read, written, tuned, linearised and flown."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.base.linear import Linear, LinearSystem
from helisim.base.settings import (
    FrozenMap,
    Inline,
    check,
    from_plain,
    placed,
    setting,
    to_plain,
    toml_text,
)
from helisim.records.record import IN1

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

VERSION = 1
"""Of the form of a law's file."""
LIMIT = 0.5
"""Of a command where nothing is said, unitised: the shipped gyro's."""
_HOMES = ("attitude_command", "rate_command", "state_space")
"""Kinds, and modules whose import registers them."""
_KINDS: "dict[str, type[Law]]" = {}
_WORDS = {"roll": "lat", "pitch": "lon", "yaw": "ped", "heave": "col", "collective": "col"}
_LARGEST = 1e9
"""Of any number of a law, SI; beyond it and below its inverse is a slip, and sums overflow."""
_SMALL = 2.0**-20
"""Of what is probed with: within every limit, and no rounding as a power of two."""
Kind = TypeVar("Kind", bound="type[Law]")
Polynomial = tuple[float, float, float]
"""Of s: c0 + c1 s + c2 s^2."""


def number(default: Any = MISSING) -> Any:
    """Return a field of a law that is a number of a usual size."""
    return setting(default, low=-_LARGEST, high=_LARGEST)


def positive(default: Any = MISSING) -> Any:
    """Return a field of a law that is a number above 0, no smaller than is usual."""
    return setting(default, low=1.0 / _LARGEST, high=_LARGEST)


def not_negative(default: Any = MISSING) -> Any:
    """Return a field of a law that is 0 or more."""
    return setting(default, low=0.0, high=_LARGEST)


class Law(ABC):
    """A control law of all four servos as data.

    A subclass is a frozen dataclass under `register`; it says what stands in its file, which of
    its numbers are tuned, what it is about a trim, and how it flies.

    Attributes:
        kind: by which its file names it.
    """

    kind: ClassVar[str]

    @classmethod
    @abstractmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return a law of what stands in its file, kind and version left out.

        Raises:
            InputError: a table or a number is missing, unknown or of the wrong kind.
        """

    @abstractmethod
    def content(self) -> dict[str, Any]:
        """Return what stands in its file, kind and version left out."""

    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """Return the numbers that are tuned, by name, such as "lat.k_rate"."""

    @abstractmethod
    def replace(self, changes: Mapping[str, float]) -> Self:
        """Return a copy with some of its `parameters` changed.

        Raises:
            UnknownNameError: it has no such parameter.
        """

    @abstractmethod
    def linear(self, period: float) -> Linear:
        """Return what it does about a trim, at ticks that are a period (s) apart."""

    @abstractmethod
    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle.

        Raises:
            InputError: the vehicle can't fly it.
        """

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data, as its file has it; see `law_of`."""
        return {"kind": self.kind, "version": VERSION, **self.content()}

    def to_toml(self) -> str:
        """Return the text of its file."""
        return toml_text(_inlined(self.to_dict()))

    def write(self, path: str | PathLike[str]) -> None:
        """Write its file (TOML). Raises StorageError."""
        with atomic_write(path) as temporary:
            temporary.write_text(self.to_toml(), encoding="utf-8")


def _inlined(data: Any, *, listed: bool = False) -> Any:
    """Return plain data whose tables in lists stand within a line."""
    if isinstance(data, Mapping):
        table = {key: _inlined(one, listed=listed) for key, one in data.items()}
        return Inline(table) if listed else table
    if isinstance(data, list | tuple):
        return [_inlined(one, listed=True) for one in data]
    return data


def register(kind: Kind) -> Kind:
    """Let files of a class's `kind` be read as laws of it: a decorator of a subclass of `Law`."""
    _KINDS[kind.kind] = kind
    return kind


def law_of(data: Mapping[str, Any]) -> Law:
    """Return the law that plain data say, as `Law.to_dict` writes them.

    Raises:
        UnknownNameError: there is no such kind of law.
        InputError: it is of another version, or what it says is no law of its kind.
    """
    content, kinds = dict(data), tuple(dict.fromkeys([*_HOMES, *_KINDS]))
    kind, version = content.pop("kind", None), content.pop("version", None)
    if kind is None:
        raise InputError(f'a law says its kind, such as kind = "{kinds[0]}"')
    if not isinstance(kind, str) or kind not in kinds:
        raise UnknownNameError("kind of law", kind, kinds)
    if version != VERSION or isinstance(version, bool):
        said = "no version" if version is None else f"version {version!r:.60}"
        raise InputError(f"a law of {said}: this helisim reads version = {VERSION}")
    if kind not in _KINDS:
        import_module(f"helisim.design.laws.{kind}")
    return _KINDS[kind].from_dict(content)


def read_law(path: str | PathLike[str]) -> Law:
    """Read a control law from a TOML file.

    Args:
        path: of the file.

    Raises:
        StorageError: the file can't be read, or is not TOML.
        InputError: it holds no law; the message begins with the path.
    """
    content = read_toml(path)
    with placed(path):
        return law_of(content)


def named(kind: type[Law], content: Mapping[str, Any]) -> None:
    """Raise UnknownNameError for the first name in a law's file that it doesn't have."""
    known = [one.name for one in fields(kind)]  # pyright: ignore[reportArgumentType]
    for name in content:
        if name not in known:
            axis = _WORDS.get(str(name).casefold())
            advice = f"an axis is called by its servo command: {axis}" if axis in known else ""
            raise UnknownNameError("name in the law", name, known, advice=advice)


@dataclass(frozen=True, kw_only=True, repr=False)
class TabledLaw(Law):
    """A law whose file is numbers and a table, a frozen dataclass of numbers, for each axis.

    Attributes:
        not_tuned: names of numbers, in any table, that no tuning changes.
        name: for messages and records; by itself the kind.
        provenance: how it was made, plain data.
    """

    not_tuned: ClassVar[tuple[str, ...]] = ()
    name: str = ""
    provenance: Mapping[str, Any] = FrozenMap({})

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.kind)
        check(self, self.kind)
        for key, value in vars(self).items():
            if is_dataclass(value):
                check(value, f"[{key}]")

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {len(self.parameters())} parameters)"

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return a law of what stands in its file, kind and version left out.

        Raises:
            InputError: a table or a number is missing, unknown or of the wrong kind.
        """
        named(cls, content)
        return from_plain(cls, content, cls.kind)

    def content(self) -> dict[str, Any]:
        """Return what stands in its file, kind and version left out."""
        made = dict(self.provenance)
        plain = {name: one for name, one in to_plain(self).items() if name != "provenance"}
        whole = {name: one for name, one in plain.items() if not isinstance(one, Mapping)}
        tables = {name: one for name, one in plain.items() if isinstance(one, Mapping)}
        return {**whole, **tables, **({"provenance": made} if made else {})}

    def parameters(self) -> dict[str, float]:
        """Return the numbers that are tuned, by name, such as "lat.k_rate"."""
        tuned: dict[str, float] = {}
        for key, value in vars(self).items():
            if not is_dataclass(value):
                tuned |= self._tuned("", {key: value})
                continue
            tuned |= self._tuned(f"{key}.", vars(value))
            for k, one in enumerate(getattr(value, "filters", ()), start=1):
                tuned |= self._tuned(f"{key}.filter_{k}.", vars(one))
        return tuned

    def _tuned(self, before: str, values: Mapping[str, Any]) -> dict[str, float]:
        return {
            f"{before}{name}": float(value)
            for name, value in values.items()
            if isinstance(value, int | float)
            and not isinstance(value, bool)
            and name not in self.not_tuned
        }

    def replace(self, changes: Mapping[str, float]) -> Self:
        """Return a copy with some of its `parameters` changed.

        Raises:
            UnknownNameError: it has no such parameter.
            InputError: a number is out of its range.
        """
        known, content = self.parameters(), self.content()
        for name, value in changes.items():
            if name not in known:
                raise UnknownNameError("parameter of the law", name, known)
            *path, key = name.split(".")
            table = content
            for part in path:
                in_filters = part.startswith("filter_") and part not in table
                table = table["filters"][int(part[7:]) - 1] if in_filters else table[part]
            table[key] = float(value)
        return type(self).from_dict(content)


@dataclass(frozen=True)
class Filter:
    """A filter of unit gain at low frequency, but for a notch that has none but there.

    It is sampled by Tustin's rule.

    Attributes:
        kinds: name of a kind in a file -> its class.
    """

    kinds: ClassVar[dict[str, type["Filter"]]] = {}

    def __post_init__(self) -> None:
        check(self)

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        raise NotImplementedError

    @property
    def kept(self) -> float:
        """Frequency that sampling keeps in its place, rad/s; 0 for the lowest."""
        return 0.0

    def coefficients(self, period: float) -> tuple[float, float, float, float, float]:
        """Return b0, b1, b2, a1, a2 of the filter sampled each period (s)."""
        half = 0.5 * self.kept * period
        if half >= 0.5 * math.pi:
            name = type(self).__name__.lower()
            raise InputError(
                f"a {name} at {self.kept:g} rad/s is beyond what ticks of {period:g} s show"
            )
        rate = self.kept / math.tan(half) if self.kept else 2.0 / period
        first = self.ratio[0][2] == self.ratio[1][2] == 0.0
        (b0, b1, b2), (a0, a1, a2) = (_tustin(one, rate, first) for one in self.ratio)
        return b0 / a0, b1 / a0, b2 / a0, a1 / a0, a2 / a0


def _tustin(polynomial: Polynomial, rate: float, first: bool) -> Polynomial:
    """Return a polynomial of s = rate (1 - 1/z) / (1 + 1/z) in powers of 1/z.

    Times (1 + 1/z), of second order times its square, which ratios don't see.
    """
    c0, c1, c2 = polynomial[0], polynomial[1] * rate, polynomial[2] * rate**2
    if first:
        return c0 + c1, c0 - c1, 0.0
    return c0 + c1 + c2, 2.0 * (c0 - c2), c0 - c1 + c2


@dataclass(frozen=True)
class Lead(Filter):
    """(1 + s/zero) / (1 + s/pole): a lead with the zero below the pole, else a lag.

    Attributes:
        zero: rad/s.
        pole: rad/s.
    """

    zero: float = positive()
    pole: float = positive()

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        return (1.0, 1.0 / self.zero, 0.0), (1.0, 1.0 / self.pole, 0.0)


@dataclass(frozen=True)
class Lowpass(Filter):
    """w^2 / (s^2 + 2 damping w s + w^2).

    Attributes:
        frequency: w, rad/s.
        damping: ratio.
    """

    frequency: float = positive()
    damping: float = positive(math.sqrt(0.5))

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        w = self.frequency
        return (1.0, 0.0, 0.0), (1.0, 2.0 * self.damping / w, 1.0 / w**2)


@dataclass(frozen=True)
class Notch(Filter):
    """(s^2 + 2 depth damping w s + w^2) / (s^2 + 2 damping w s + w^2).

    Attributes:
        frequency: w, rad/s, where it lets through no more than `depth`.
        damping: ratio, half of its width.
        depth: gain that is left there.
    """

    frequency: float = positive()
    damping: float = positive(0.5)
    depth: float = positive(0.1)

    @property
    def ratio(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in s."""
        w, wide = self.frequency, 2.0 * self.damping / self.frequency
        return (1.0, self.depth * wide, 1.0 / w**2), (1.0, wide, 1.0 / w**2)

    @property
    def kept(self) -> float:
        """Its own frequency."""
        return self.frequency


Filter.kinds |= {"lead": Lead, "lowpass": Lowpass, "notch": Notch}


def probed(
    law: Callable[..., Any],
    settings: NDArray[np.float64],
    states: int,
    period: float,
    inputs: Sequence[str],
) -> LinearSystem:
    """Return the matrices of a law that is linear within its limits, by asking the law itself.

    States that nothing moves are left out.

    Args:
        law: of (seen, state, settings), whose four commands are col, lon, lat and ped, 0 where
            all that it sees and its state are.
        settings: (n_settings,).
        states: how many it has.
        period: s, of its ticks.
        inputs: of what it sees.
    """
    from helisim.physics.gyro import Seen  # reading a file needs no simulator

    columns = []
    for k in range(states + len(inputs)):
        state, seen = np.zeros(states), Seen(*np.zeros(len(Seen._fields)).tolist())
        if k < states:
            state[k] = _SMALL
        else:
            seen = seen._replace(**{inputs[k - states]: _SMALL})
        commands = law(seen, state, settings)
        columns.append(np.array([*state, *commands]) / _SMALL)
    whole = np.column_stack(columns)
    seen_at, given_at = range(states, whole.shape[1]), range(states, whole.shape[0])
    kept, before = list(range(states)), None
    while kept != before:
        before, others = kept, [*kept, *seen_at]
        kept = [k for k in kept if np.any(whole[k, [one for one in others if one != k]])]
    return LinearSystem(
        whole[np.ix_(kept, kept)],
        whole[np.ix_(kept, seen_at)],
        whole[np.ix_(given_at, kept)],
        whole[np.ix_(given_at, seen_at)],
        period,
        tuple(inputs),
        IN1,
    )
