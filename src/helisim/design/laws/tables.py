"""Laws whose file is a few numbers and a table for each axis: read, checked, tuned and written."""

from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields, replace
from typing import Any, ClassVar, Self

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.value import FrozenMap
from helisim.design.laws.filters import Filter, filter_of
from helisim.design.laws.law import Law, check_names, check_number


@dataclass(frozen=True, kw_only=True, repr=False)
class TabledLaw(Law):
    """A law with a table, a frozen dataclass of numbers and filters, for each axis.

    Attributes:
        tables: name of a table -> its class; fields of the law itself.
        positive: names of numbers, in any table, that are above 0.
        not_negative: names of numbers that aren't below 0.
        not_tuned: names of numbers that no tuning changes.
        flags: names of what is true or false.
        name: for messages and records; by itself the kind.
        provenance: how it was made, plain data.
    """

    tables: ClassVar[Mapping[str, type]] = {}
    positive: ClassVar[tuple[str, ...]] = ()
    not_negative: ClassVar[tuple[str, ...]] = ()
    not_tuned: ClassVar[tuple[str, ...]] = ()
    flags: ClassVar[tuple[str, ...]] = ()
    name: str = ""
    provenance: Mapping[str, Any] = FrozenMap({})

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.kind)
        if not isinstance(self.provenance, Mapping):
            raise InputError(f"provenance must be a table, got {self.provenance!r:.60}")
        object.__setattr__(self, "provenance", FrozenMap(self.provenance))
        for key, value in vars(self).items():
            if key == "provenance":
                continue
            kind = self.tables.get(key)
            if kind is None:
                self._check(key, key, value)
                continue
            if not isinstance(value, kind):
                raise InputError(f"{key} must be a {kind.__name__}, got {value!r:.60}")
            for name, one in vars(value).items():
                self._check(f"[{key}] {name}", name, one)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {len(self.parameters())} parameters)"

    def _check(self, where: str, name: str, value: Any) -> None:
        """Raise InputError if one of its values is none that it can have."""
        if name == "name":
            if not isinstance(value, str):
                raise InputError(f"{where} must be a text, got {value!r:.60}")
        elif name == "filters":
            if not (isinstance(value, tuple) and all(isinstance(one, Filter) for one in value)):
                raise InputError(f"{where} must be a tuple of filters, got {value!r:.60}")
        elif name in self.flags:
            if not isinstance(value, bool):
                raise InputError(f"{where} must be true or false, got {value!r:.60}")
        else:
            bounds = dict.fromkeys(self.not_negative, "0 or more")
            bounds |= dict.fromkeys(self.positive, "above 0")
            check_number(where, value, least=bounds.get(name, ""))

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return a law of what stands in its file, kind and version left out.

        Raises:
            InputError: a table or a number is missing, unknown or of the wrong kind.
        """
        check_names("the law", content, [one.name for one in fields(cls)])
        lacks = _lacks(cls, content)
        if lacks:
            what = [f"[{name}]" if name in cls.tables else name for name in lacks]
            raise InputError(f"a law of kind {cls.kind} lacks {', '.join(what)}")
        given = dict(content)
        for name, kind in cls.tables.items():
            if name in given:
                given[name] = _table_of(name, kind, given[name])
        return cls(**given)

    def content(self) -> dict[str, Any]:
        """Return what stands in its file, kind and version left out."""
        given = dict(vars(self))
        made = dict(given.pop("provenance"))
        plain = {name: value for name, value in given.items() if name not in self.tables}
        axes = {name: _written(given[name]) for name in self.tables}
        return {**plain, **axes, **({"provenance": made} if made else {})}

    def parameters(self) -> dict[str, float]:
        """Return the numbers that are tuned, by name, such as "lat.k_rate"."""
        tuned: dict[str, float] = {}
        for key, value in vars(self).items():
            if key not in self.tables:
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
        known = self.parameters()
        whole: dict[str, Any] = {}
        tables: dict[str, dict[str, float]] = {}
        for name, value in changes.items():
            if name not in known:
                raise UnknownNameError("parameter of the law", name, known)
            table, _, key = name.rpartition(".") if name.count(".") < 2 else name.partition(".")
            (tables.setdefault(table, {}) if table else whole)[key] = float(value)
        for name, own in tables.items():
            whole[name] = _changed(getattr(self, name), own)
        return replace(self, **whole)


def _lacks(kind: Any, given: Mapping[str, Any]) -> list[str]:
    """Return the names of fields that must be given and aren't."""
    return [
        one.name
        for one in fields(kind)
        if one.default is one.default_factory is MISSING and one.name not in given
    ]


def _table_of(name: str, kind: Any, content: Any) -> Any:
    """Return a table of plain data. Raises InputError."""
    if not isinstance(content, Mapping):
        raise InputError(f"{name} must be a table, [{name}], got {content!r:.60}")
    check_names(f"[{name}]", content, [one.name for one in fields(kind)])
    lacks = _lacks(kind, content)
    if lacks:
        raise InputError(f"[{name}] lacks {', '.join(lacks)}")
    given = dict(content)
    if "filters" in given:
        given["filters"] = _filters_of(name, given["filters"])
    return kind(**given)


def _filters_of(name: str, content: Any) -> tuple[Filter, ...]:
    if not isinstance(content, list | tuple):
        raise InputError(f"[{name}] filters must be a list, got {content!r:.60}")
    try:
        return tuple(filter_of(one) for one in content)
    except UnknownNameError as error:
        error.args = (f"[{name}] {error}",)
        raise
    except InputError as error:
        raise InputError(f"[{name}] {error}") from None


def _written(table: Any) -> dict[str, Any]:
    """Return a table as plain data."""
    content = asdict(table)
    if "filters" in content:
        content["filters"] = [one.to_dict() for one in table.filters]
        if not table.filters:
            del content["filters"]
    return content


def _changed(table: Any, changes: Mapping[str, float]) -> Any:
    """Return a table with numbers changed, by names such as "k_rate" and "filter_1.zero"."""
    own: dict[str, Any] = {}
    filters = list(getattr(table, "filters", ()))
    for name, value in changes.items():
        place, inner, key = name.partition(".")
        if inner:
            k = int(place.removeprefix("filter_")) - 1
            filters[k] = replace(filters[k], **{key: value})
        else:
            own[name] = value
    return replace(table, **own, **({"filters": tuple(filters)} if filters else {}))
