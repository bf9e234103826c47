"""Frequency responses in files: helisim's own, and those that anyone wrote as columns of text."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import check_suffix, read_json, write_json
from helisim.base.unit_names import is_unit, unit
from helisim.ident.responses.response import FrequencyResponse
from helisim.ident.responses.response_text import (
    Curve,
    Text,
    looks_like_response,
    paired,
    read_columns,
    write_columns,
)
from helisim.ident.responses.scatter_file import scatter_from_plain, scatter_to_plain
from helisim.records.provenance import made_by

FORMAT = "helisim frequency response, version 1"

_NO_MODEL = (
    "the file holds no error model: points are weighed by coherence, and errors stated from what "
    "the fit leaves over"
)

_SAME = 1e-6
"""Frequencies of two files closer than this fraction are one, written with few digits."""

_LEAST_COHERENCE = 1e-4
"""Below it the random error that coherence implies is no number worth stating."""


def is_response(path: str | PathLike[str]) -> bool:
    """Return whether a file seems to hold a frequency response, and not a log."""
    return Path(path).suffix.lower() == ".json" or looks_like_response(path)


def response_to_dict(frf: FrequencyResponse) -> dict[str, Any]:
    """Return what a JSON file of a response holds, its error model included, as plain data."""
    data = {
        "format": FORMAT,
        "response": frf.to_dict(),
        "provenance": _provenance(frf),
    }
    if frf.scatter is not None:
        data["scatter"] = scatter_to_plain(frf.scatter, frf.response)
    return data


def save_response(
    frf: FrequencyResponse, path: str | PathLike[str], more: Mapping[str, Any] | None = None
) -> None:
    """Write a response that `load_response` reads, as JSON or CSV by the path's suffix.

    JSON keeps all, to the last bit: a fit finds the same numbers with the same errors. CSV is for
    other programs: it has neither the error model nor how the inputs hung together.

    Args:
        frf: the response.
        path: ending in .json or .csv.
        more: plain data that JSON is to hold beside it, such as how logs were read.

    Raises:
        StorageError: the suffix is another, or the file can't be written.
    """
    if check_suffix(Path(path), (".json", ".csv")) == ".csv":
        write_columns(frf, _provenance(frf), path)
    else:
        write_json({**response_to_dict(frf), **(more or {})}, path)


def load_response(
    path: str | PathLike[str] | Mapping[str, str | PathLike[str]],
    *,
    columns: str | None = None,
    unnamed: str | None = None,
) -> FrequencyResponse:
    """Read a frequency response, so that nothing must be estimated twice.

    From JSON or CSV of helisim, or from columns of text by anyone: frequency, magnitude and phase
    (or real and imaginary part), coherence and error where they are known. Headings say what they
    are, with units, such as "freq [Hz]", "p/lat magnitude (dB)", "Phase_deg". What isn't in the
    file is among the response's `flags`, with what is assumed instead.

    Args:
        path: of the file; or paths by response, such as {"p/lat": "p.txt", "q/lon": "q.txt"}, of
            files that hold one each. At frequencies that only others have, a response's
            coherence is zero.
        columns: what the columns of text hold, where their headings don't say it, such as
            "frequency:Hz,magnitude:dB,phase:deg,coherence,-"; "-" is not used.
        unnamed: the response whose columns' headings name none, such as "p/lat".

    Raises:
        StorageError: a file can't be read.
        InputError: it isn't a response, or lacks what can't be guessed; the message names it.
    """
    if isinstance(path, Mapping):
        if not path:
            raise InputError("no file was given; expected paths by response, such as p/lat")
        return _joined({name: (one, read_columns(one, columns)) for name, one in path.items()})
    if Path(path).suffix.lower() == ".json":
        return _from_json(path)
    return _from_text(path, read_columns(path, columns), unnamed)


def _provenance(frf: FrequencyResponse) -> dict[str, Any]:
    units = {"input_units": list(frf.input_units), "output_units": list(frf.output_units)}
    return made_by("frequency response", **frf.provenance, **units)


def _from_json(path: str | PathLike[str]) -> FrequencyResponse:
    data = read_json(path)
    try:
        if data.get("format") != FORMAT or not isinstance(data.get("response"), dict):
            raise InputError(
                f"isn't a frequency response: its format is {data.get('format')!r}, expected "
                f"{FORMAT!r}, as `helisim frf --json` writes it"
            )
        found = FrequencyResponse.from_dict(data["response"])
        if "scatter" in data:
            return replace(found, scatter=scatter_from_plain(data["scatter"], found.response))
        known = _NO_MODEL in found.flags or not np.any(found.random_error)
        return found if known else replace(found, flags=(*found.flags, _NO_MODEL))
    except InputError as error:
        error.args = (f"{path}: {error}",)
        raise


def _from_text(path: str | PathLike[str], text: Text, unnamed: str | None) -> FrequencyResponse:
    """Return the responses of one file."""
    curves = dict(text.curves)
    if "" in curves:
        if unnamed is None:
            raise InputError(
                f"{path}: the headings name no response; say which one it is, by unnamed='p/lat', "
                "or p/lat=FILE on the command line"
            )
        curves[unnamed] = curves.pop("")
    return _assembled(text.frequency, curves, text.provenance, _told(path, text, curves))


def _joined(files: Mapping[str, tuple[str | PathLike[str], Text]]) -> FrequencyResponse:
    """Return the responses of several files, one each."""
    curves, told = {}, []
    frequency = _grid([text.frequency for _, text in files.values()])
    for name, (path, text) in files.items():
        key = name if name in text.curves else next(iter(text.curves))
        if len(text.curves) > 1 and key != name:
            raise UnknownNameError(f"response in {path}", name, text.curves)
        curves[name] = _placed(text.curves[key], text.frequency, frequency)
        told += _told(path, text, {name: text.curves[key]})
        if missing := frequency.size - text.frequency.size:
            told.append(
                f"{path}: {name} is not measured at {missing} of the {frequency.size} frequencies "
                "of all files; its coherence is 0 there"
            )
    return _assembled(frequency, curves, {}, told)


def _assembled(
    frequency: NDArray[np.float64],
    curves: Mapping[str, Curve],
    provenance: Mapping[str, Any],
    told: Sequence[str],
) -> FrequencyResponse:
    """Return responses at the same frequencies as one; what isn't known is assumed as told."""
    outputs, inputs = _signals(curves, provenance)
    shape = (len(outputs), len(inputs), frequency.size)
    response, coherence = np.ones(shape, dtype=np.complex128), np.zeros(shape)
    error = np.ones(shape)
    for name, curve in curves.items():
        output, input_ = name.split("/")
        at = outputs.index(output), inputs.index(input_)
        response[at] = curve.response
        coherence[at] = 1.0 if curve.coherence is None else curve.coherence
        error[at] = _implied(coherence[at]) if curve.error is None else curve.error
    missing = [f"{o}/{i}" for o in outputs for i in inputs if f"{o}/{i}" not in curves]
    if missing:
        told = [*told, f"not in the file(s): {', '.join(missing)}"]
    inputs_si = _si(_texts(provenance, "input_units", ("",) * len(inputs)))
    outputs_si = _si(_texts(provenance, "output_units", ("",) * len(outputs)))
    factor = np.outer([many for _, many in outputs_si], [1.0 / many for _, many in inputs_si])
    return FrequencyResponse(
        frequency=frequency,
        response=response * factor[:, :, None],
        coherence=coherence,
        multiple_coherence=np.max(coherence, axis=1),  # what they explain together, at the least
        cross_control_coherence=np.repeat(np.eye(len(inputs))[:, :, None], frequency.size, axis=2),
        random_error=error,
        inputs=inputs,
        outputs=outputs,
        input_units=tuple(unit for unit, _ in inputs_si),
        output_units=tuple(unit for unit, _ in outputs_si),
        conditioning=_texts(provenance, "conditioning", ()),
        reference=_texts(provenance, "reference", ()),
        sources=_texts(provenance, "records", ()),
        windows=_lengths(provenance),
        estimator=str(provenance.get("estimator", "")),
        flags=tuple(dict.fromkeys(told)),
    )


def _si(written: Sequence[str]) -> list[tuple[str, float]]:
    """Return the SI unit of each unit that was written, and how many of it one is."""
    found = []
    for name in written:
        si = unit(name) if is_unit(name) else None
        known = si is not None and math.isfinite(si.factor)
        found.append((si.si, si.factor) if si is not None and known else (name, 1.0))
    return found


def _signals(
    curves: Mapping[str, Curve], provenance: Mapping[str, Any]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return outputs and inputs, in the order in which helisim had them where it wrote them."""
    outputs, inputs = paired(curves)
    known = [_texts(provenance, name, ()) for name in ("outputs", "inputs")]
    if set(known[0]) == set(outputs) and set(known[1]) == set(inputs):
        return known[0], known[1]
    return outputs, inputs


def _texts(provenance: Mapping[str, Any], name: str, default: tuple[str, ...]) -> tuple[str, ...]:
    """Return words of a provenance; the default where they are none, or not as many."""
    words = provenance.get(name)
    if not isinstance(words, list) or not all(isinstance(one, str) for one in words):
        return default
    return tuple(words) if not default or len(words) == len(default) else default


def _lengths(provenance: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the windows' lengths that a provenance states, s; none where it states none."""
    lengths = provenance.get("windows_s")
    if not isinstance(lengths, list) or not all(isinstance(one, int | float) for one in lengths):
        return ()
    return tuple(map(float, lengths))


def _told(path: str | PathLike[str], text: Text, curves: Mapping[str, Curve]) -> list[str]:
    """Return what was found out of a file and what is assumed instead of what it lacks."""
    told = [] if text.provenance else [f"{path}: read as {text.units}"]
    for quantity, assumed in (
        ("coherence", "it is taken as 1, so that all points count alike"),
        (
            "error",
            "what is drawn is the most that the coherence allows, that of one average; a fit "
            "doesn't use it",
        ),
    ):
        lacking = [name for name, one in curves.items() if getattr(one, quantity) is None]
        if lacking:
            word = "random error" if quantity == "error" else quantity
            told.append(f"{path}: has no {word} of {', '.join(lacking)}: {assumed}")
    return [*told, _NO_MODEL]


def _implied(coherence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the random error of one average by its coherence (Bendat and Piersol)."""
    share = np.maximum(coherence, _LEAST_COHERENCE)
    return np.sqrt((1.0 - share) / (2.0 * share))


def _grid(frequencies: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return all frequencies that occur, those apart by rounding once."""
    every = np.sort(np.concatenate(list(frequencies)))
    return every[np.append(True, np.diff(every) > _SAME * every[1:])]


def _placed(curve: Curve, frequency: NDArray[np.float64], grid: NDArray[np.float64]) -> Curve:
    """Return a curve at the frequencies of a grid that holds its own; elsewhere not coherent."""
    at = np.searchsorted(grid, frequency * (1.0 - _SAME))
    coherence, error = np.zeros(grid.size), np.ones(grid.size)
    coherence[at] = 1.0 if curve.coherence is None else curve.coherence
    error[at] = _implied(coherence[at]) if curve.error is None else curve.error
    real, imaginary = (
        np.interp(grid, frequency, part) for part in (curve.response.real, curve.response.imag)
    )
    response = real + 1j * imaginary
    response[at] = curve.response
    return Curve(response, coherence, error)
