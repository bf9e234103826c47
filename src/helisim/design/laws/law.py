"""What every control law is: plain data that is read, written, tuned, linearised and flown."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from importlib import import_module
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml
from helisim.base.linear import Linear
from helisim.design.laws.written import toml_of

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

VERSION = 1
"""Of the form of a law's file."""
_HOMES = {
    "attitude_command": "helisim.design.laws.attitude_command",
    "rate_command": "helisim.design.laws.rate_command",
    "state_space": "helisim.design.laws.state_space",
}
"""Kind -> module whose import registers it."""
_KINDS: "dict[str, type[Law]]" = {}
Kind = TypeVar("Kind", bound="type[Law]")


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
        return toml_of(self.to_dict())

    def write(self, path: str | PathLike[str]) -> None:
        """Write its file (TOML). Raises StorageError."""
        with atomic_write(path) as temporary:
            temporary.write_text(self.to_toml(), encoding="utf-8")


def register(kind: Kind) -> Kind:
    """Let files of a class's `kind` be read as laws of it: a decorator of a subclass of `Law`."""
    _KINDS[kind.kind] = kind
    return kind


def kinds() -> tuple[str, ...]:
    """Return the kinds of laws that can be read."""
    return tuple(dict.fromkeys([*_HOMES, *_KINDS]))


def law_of(data: Mapping[str, Any]) -> Law:
    """Return the law that plain data say, as `Law.to_dict` writes them.

    Raises:
        UnknownNameError: there is no such kind of law.
        InputError: it is of another version, or what it says is no law of its kind.
    """
    content = dict(data)
    kind, version = content.pop("kind", None), content.pop("version", None)
    if kind is None:
        raise InputError(f'a law says its kind, such as kind = "{kinds()[0]}"')
    if not isinstance(kind, str) or kind not in kinds():
        raise UnknownNameError("kind of law", kind, kinds())
    if version != VERSION or isinstance(version, bool):
        said = "no version" if version is None else f"version {version!r}"
        raise InputError(f"a law of {said}: this helisim reads version = {VERSION}")
    if kind not in _KINDS:
        import_module(_HOMES[kind])
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
    try:
        return law_of(content)
    except UnknownNameError as error:
        error.args = (f"{path}: {error}",)
        raise
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


_LARGEST = 1e9
"""Of any number of a law, SI; beyond it and below its inverse is a slip, and sums overflow."""


def check_number(where: str, value: object, *, least: str = "") -> None:
    """Raise InputError unless something is a number that a law can have.

    Args:
        where: it stands, for the message.
        value: what is given.
        least: "above 0", or "0 or more", if it must be.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} must be a number, got {value!r:.60}")
    if not -_LARGEST <= value <= _LARGEST:
        raise InputError(f"{where} must be a number within {_LARGEST:g}, got {value!r:.60}")
    if (least == "above 0" and value < 1.0 / _LARGEST) or (least and value < 0.0):
        raise InputError(f"{where} must be {least}, got {value!r}")


_WORDS = {"roll": "lat", "pitch": "lon", "yaw": "ped", "heave": "col", "collective": "col"}


def check_names(where: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise UnknownNameError for the first of the names given in a table that isn't known."""
    known = tuple(known)
    for name in given:
        if name not in known:
            axis = _WORDS.get(str(name).casefold())
            advice = f"an axis is called by its servo command: {axis}" if axis in known else ""
            raise UnknownNameError(f"name in {where}", name, known, advice=advice)
