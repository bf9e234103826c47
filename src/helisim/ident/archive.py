"""Fits and frequency responses as plain data and JSON files, without loss."""

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from helisim.errors import InputError
from helisim.ident.response import FrequencyResponse


def response_to_dict(frf: FrequencyResponse) -> dict[str, Any]:
    """Return a frequency response as plain data; complex arrays as {"real", "imag"}."""
    return {
        one.name: _plain(getattr(frf, one.name))
        for one in fields(frf)
        if one.metadata.get("archived", True)
    }


def response_from_dict(data: Mapping[str, Any]) -> FrequencyResponse:
    """Read what `response_to_dict` wrote.

    Raises:
        InputError: a field is missing, unknown or misshapen.
    """
    unknown = sorted(set(data) - set(_archived()))
    if unknown:
        raise InputError(
            f"unknown field(s) of a frequency response: {', '.join(unknown)}; "
            "the file was written by another version"
        )
    try:
        return FrequencyResponse(**{name: _restored(item) for name, item in data.items()})
    except (TypeError, ValueError, KeyError) as error:
        raise InputError(f"can't read the frequency response: {error}") from None


def number_out(number: float) -> float | None:
    """Return a number for JSON: None where it isn't finite."""
    return float(number) if math.isfinite(number) else None


def number_in(number: float | None) -> float:
    """Return what `number_out` took: infinity where it wasn't finite."""
    return math.inf if number is None else float(number)


def _archived() -> list[str]:
    """Return the fields of a frequency response that are written to files."""
    return [one.name for one in fields(FrequencyResponse) if one.metadata.get("archived", True)]


def _plain(item: Any) -> Any:
    match item:
        case np.ndarray() if np.iscomplexobj(item):
            return {"real": item.real.tolist(), "imag": item.imag.tolist()}
        case np.ndarray():
            return item.tolist()
        case tuple() | list():
            return [_plain(one) for one in item]
        case Mapping():
            return {name: _plain(one) for name, one in item.items()}
    return item


def _restored(item: Any) -> Any:
    match item:
        case {"real": real, "imag": imag, **rest} if not rest:
            return np.asarray(real, dtype=np.float64) + 1j * np.asarray(imag, dtype=np.float64)
        case list() if not any(isinstance(one, list | dict) for one in item):
            return tuple(item)
    return item
