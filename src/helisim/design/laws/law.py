"""Control laws as plain data: read, written, tuned, linearised and flown."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, is_dataclass, replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError, check_known
from helisim.base.files import read_toml, write_text
from helisim.base.linear import Linear, LinearSystem
from helisim.base.settings import (
    Checked,
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

VERSION = 1  # version of a law's file
LIMIT = 0.5  # default limit of a command, unitised
_KINDS: "dict[str, type[Law]]" = {}
_LARGEST = 1e9  # largest number of a law, SI; its inverse is the least
Kind = TypeVar("Kind", bound="type[Law]")

number = partial(setting, low=-_LARGEST, high=_LARGEST)
positive = partial(setting, low=1.0 / _LARGEST, high=_LARGEST)
not_negative = partial(setting, low=0.0, high=_LARGEST)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Law(ABC):
    """A control law of all four servos as data; `kind` names it in files, `name` in messages.

    A subclass is a frozen dataclass under `register`; its file is numbers and a table, a frozen
    dataclass of numbers, for each axis. No tuning changes numbers in `not_tuned`.
    """

    kind: ClassVar[str]
    not_tuned: ClassVar[tuple[str, ...]] = ()
    name: str = ""
    provenance: Mapping[str, Any] = setting(FrozenMap({}), unsaid=True)

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
        """Return a law of its file's content, without kind and version. Raises InputError."""
        return from_plain(cls, content, cls.kind)

    @abstractmethod
    def linear(self, period: float) -> Linear:
        """Return the law about a trim, at ticks that are a period (s) apart."""

    @abstractmethod
    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle; InputError if the vehicle can't."""

    def _flown(self, law: Any, states: int, settings: NDArray[np.float64]) -> "Controller":
        from helisim.vehicle import Controller  # reading a file needs no simulator

        return Controller(law, states=states, settings=settings, name=self.name, written=self)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, as in its file; see `law_of`."""
        plain = to_plain(self)
        made = plain.pop("provenance", {})
        return {
            "kind": self.kind,
            "version": VERSION,
            **plain,
            **({"provenance": made} if made else {}),
        }

    def to_toml(self) -> str:
        """Return the text of its file."""
        return toml_text(_inlined(self.to_dict()))

    def write(self, path: str | PathLike[str]) -> None:
        """Write its file (TOML). Raises StorageError."""
        write_text(path, self.to_toml())

    def parameters(self) -> dict[str, float]:
        """Return the numbers that are tuned, by name, such as "lat.k_rate"."""
        return {name: float(table[key]) for name, table, key in self._tuned(to_plain(self))}

    def replace(self, changes: Mapping[str, float]) -> Self:
        """Return a copy with some `parameters` changed. Raises UnknownNameError, InputError."""
        content = to_plain(self)
        places = {name: (table, key) for name, table, key in self._tuned(content)}
        check_known("parameter of the law", changes, places)
        for name, value in changes.items():
            table, key = places[name]
            table[key] = float(value)
        return type(self).from_dict(content)

    def _tuned(
        self, table: dict[str, Any], before: str = ""
    ) -> Iterator[tuple[str, dict[str, Any], str]]:
        """Yield the name of each number that is tuned, and its table and key in plain data."""
        for key, value in table.items():
            if key == "filters":
                for k, one in enumerate(value, start=1):
                    yield from self._tuned(one, f"{before}filter_{k}.")
            elif isinstance(value, dict) and key != "provenance":
                yield from self._tuned(value, f"{before}{key}.")
            elif type(value) in (int, float) and key not in self.not_tuned:
                yield before + key, table, key


_HEAD = ("kind", "version")


def _inlined(data: Any, *, listed: bool = False) -> Any:
    if isinstance(data, Mapping):
        table = {key: _inlined(one, listed=listed) for key, one in data.items()}
        return Inline(table) if listed else table
    several = isinstance(data, list | tuple)
    return [_inlined(one, listed=True) for one in data] if several else data


def register(kind: Kind) -> Kind:
    """Let files of a class's `kind` be read as laws of it: a decorator of a subclass of `Law`."""
    _KINDS[kind.kind] = kind
    return kind


def law_of(data: Mapping[str, Any]) -> Law:
    """Return the law of plain data of `Law.to_dict`. Raises UnknownNameError, InputError."""
    kind, version = (data.get(name) for name in _HEAD)
    if not isinstance(kind, str) or kind not in _KINDS:
        raise UnknownNameError("kind of law", str(kind or ""), sorted(_KINDS))
    if version != VERSION or isinstance(version, bool):
        said = "no version" if version is None else f"version {version!r:.60}"
        raise InputError(f"a law of {said}: this helisim reads version = {VERSION}")
    return _KINDS[kind].from_dict({k: one for k, one in data.items() if k not in _HEAD})


def read_law(path: str | PathLike[str]) -> Law:
    """Read a control law from a TOML file. Raises StorageError, InputError."""
    with placed(path):
        return law_of(read_toml(path))


@dataclass(frozen=True)
class Lead(Checked):
    """(1 + s/zero) / (1 + s/pole), rad/s: a lead if the zero is below the pole; Tustin."""

    kinds: ClassVar[dict[str, type["Lead"]]] = {}
    """Name of a filter's kind in a file -> its class."""
    zero: float = positive(MISSING)
    pole: float = positive(MISSING)

    def coefficients(self, period: float) -> tuple[float, float, float]:
        """Return b0, b1, a1 of the filter sampled each period (s)."""
        above, below = (1.0 / one * (2.0 / period) for one in (self.zero, self.pole))
        a0 = 1.0 + below
        return (1.0 + above) / a0, (1.0 - above) / a0, (1.0 - below) / a0


Lead.kinds["lead"] = Lead


def probed(
    law: Callable[..., Any],
    settings: NDArray[np.float64],
    states: int,
    period: float,
    inputs: Sequence[str],
) -> LinearSystem:
    """Return the matrices of a law, linear within its limits, by evaluating it each `period`, s.

    `law` is of (seen, state, settings), (n_settings,), and gives col, lon, lat, ped, 0 at rest;
    `inputs` are names of `Seen`. States that nothing moves are left out.
    """
    from helisim.physics.gyro import Seen  # reading a file needs no simulator

    still = Seen(*np.zeros(len(Seen._fields)).tolist())

    def ticked(before: NDArray[np.float64], given: NDArray[np.float64]) -> NDArray[np.float64]:
        state, seen = before.copy(), still._replace(**dict(zip(inputs, given.tolist())))
        commands = law(seen, state, settings)  # which moves the state on
        return np.array([*state, *commands])

    whole = LinearSystem.of_steps(ticked, states, period, inputs, IN1)
    moved, kept, before = np.hstack([whole.a, whole.b]), list(range(states)), None
    while kept != before:
        before, others = kept, [*kept, *range(states, moved.shape[1])]
        kept = [k for k in kept if np.any(moved[k, [one for one in others if one != k]])]
    a, b, c = whole.a[np.ix_(kept, kept)], whole.b[kept], whole.c[:, kept]
    return replace(whole, a=a, b=b, c=c, states=())
