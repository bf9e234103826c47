"""Plain data as the text of a TOML file: numbers, texts, lists, and tables in tables."""

from collections.abc import Mapping
from typing import Any

from helisim.base.files import toml_key, toml_value


def toml_of(data: Mapping[str, Any]) -> str:
    """Return data as TOML, plain values of a table before its tables.

    Args:
        data: by name, numbers, truth values, texts, lists of such or of tables, and tables.
    """
    return "\n".join(_lines(data, ())).lstrip("\n") + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    plain = {key: item for key, item in table.items() if not isinstance(item, Mapping)}
    inner = {key: item for key, item in table.items() if isinstance(item, Mapping)}
    lines = ["", f"[{'.'.join(map(toml_key, path))}]"] if path and (plain or not inner) else []
    lines += [f"{toml_key(key)} = {_value(item)}" for key, item in plain.items()]
    for key, item in inner.items():
        lines += _lines(item, (*path, key))
    return lines


def _value(item: Any) -> str:
    if isinstance(item, Mapping):
        return f"{{ {', '.join(f'{toml_key(key)} = {_value(one)}' for key, one in item.items())} }}"
    if isinstance(item, list | tuple) and any(
        isinstance(one, Mapping | list | tuple) for one in item
    ):
        return "[\n" + "".join(f"    {_value(one)},\n" for one in item) + "]"
    return toml_value(item)
