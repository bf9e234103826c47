"""Where numbers come from, as plain data: checked, and compared."""

import json
from collections.abc import Mapping
from typing import Any

from helisim.errors import RecordError


def plain(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return provenance as JSON would give it back: tuples become lists.

    Raises:
        RecordError: it isn't plain JSON data.
    """
    try:
        return json.loads(json.dumps(dict(provenance), allow_nan=False))
    except (TypeError, ValueError) as error:
        raise RecordError(f"provenance must be plain JSON data: {error}") from None


def difference(found: Any, expected: Any, name: str = "") -> str:
    """Return the first difference between two pieces of plain data in words, "" if none."""
    if isinstance(found, Mapping) and isinstance(expected, Mapping):
        for key in (*expected, *(key for key in found if key not in expected)):
            inner = f"{name}.{key}" if name else str(key)
            change = difference(found.get(key), expected.get(key), inner)
            if change:
                return change
        return ""
    return "" if found == expected else f"{name} is {found!r} there and {expected!r} here"
