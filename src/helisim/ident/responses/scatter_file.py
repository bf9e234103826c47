"""The error model of a frequency response in a file: all of its numbers, to the last bit.

Arrays are written as base64 of their bytes, little-endian, with type and shape: as text they would
take three times the room. A digest says to which response they belong.
"""

import base64
import binascii
import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.ident.responses.estimate import ErrorModel
from helisim.ident.responses.local_scatter import LineWeights, LocalScatter
from helisim.ident.responses.scatter import Scatter, WindowWeights

_KINDS: dict[str, Any] = {
    kind.__name__: kind for kind in (Scatter, WindowWeights, LocalScatter, LineWeights)
}

_TYPES = ("<f8", "<f4", "<c16", "<c8", "<i8", "<i4")


def scatter_to_plain(scatter: ErrorModel, response: NDArray[np.complex128]) -> dict[str, Any]:
    """Return an error model as plain data for JSON.

    Args:
        scatter: the error model.
        response: (n_out, n_in, n_freq) what it belongs to.
    """
    plain = _plain(scatter)
    return {"digest": _digest(plain, response), "model": plain}


def scatter_from_plain(data: Any, response: NDArray[np.complex128]) -> ErrorModel:
    """Return what `scatter_to_plain` wrote.

    Args:
        data: the plain data.
        response: (n_out, n_in, n_freq) what it belongs to.

    Raises:
        InputError: it is of another response, or was changed.
    """
    try:
        if data["digest"] != _digest(data["model"], response):
            raise InputError(
                "the error model ('scatter') isn't that of the response: one of them was changed "
                "after helisim wrote them; take 'scatter' out to use the response without"
            )
        return _value(data["model"])
    except (TypeError, KeyError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"the error model ('scatter') can't be read: {error}") from None


def _plain(item: Any) -> Any:
    if is_dataclass(item):
        held = {one.name: _plain(getattr(item, one.name)) for one in fields(item)}
        return {"kind": type(item).__name__, **held}
    if isinstance(item, np.ndarray):
        little = np.ascontiguousarray(item, dtype=item.dtype.newbyteorder("<"))
        text = base64.b64encode(little.tobytes()).decode("ascii")
        return {"type": little.dtype.str, "shape": list(item.shape), "base64": text}
    if isinstance(item, tuple):
        return [_plain(one) for one in item]
    return item


def _value(item: Any) -> Any:
    if isinstance(item, list):
        return tuple(map(_value, item))
    if not isinstance(item, Mapping):
        return item
    if "kind" in item:
        kind = _KINDS[item["kind"]]
        return kind(**{name: _value(one) for name, one in item.items() if name != "kind"})
    if item["type"] not in _TYPES:
        raise InputError(f"an array has the type {item['type']!r}, expected {', '.join(_TYPES)}")
    try:
        data = base64.b64decode(item["base64"])
    except binascii.Error as error:
        raise InputError(f"an array isn't base64: {error}") from None
    array = np.frombuffer(data, dtype=np.dtype(item["type"])).reshape(item["shape"])
    array.flags.writeable = False
    return array


def _digest(plain: Any, response: NDArray[np.complex128]) -> str:
    """Return a digest of an error model as plain data, and of its response."""
    digest = hashlib.blake2b(np.ascontiguousarray(response).tobytes(), digest_size=12)
    for part in _parts(plain):
        digest.update(part.encode())
    return digest.hexdigest()


def _parts(plain: Any) -> Any:
    """Yield texts that say what plain data hold, in one way only."""
    if isinstance(plain, Mapping):
        for name in sorted(plain):
            yield f"{name}:"
            yield from _parts(plain[name])
    elif isinstance(plain, list):
        yield f"[{len(plain)}"
        for one in plain:
            yield from _parts(one)
    else:
        yield f"{plain!r};"
