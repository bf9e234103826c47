"""The frequency response of a vehicle: named outputs over named inputs, its quality, its files."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import check_suffix, read_json, write_json
from helisim.base.settings import Value, check, from_plain, placed, to_plain
from helisim.base.units import UserUnits, decibel, is_unit, unit
from helisim.ident.response_text import (
    Curve,
    Text,
    looks_like_response,
    paired,
    read_columns,
    write_columns,
)
from helisim.ident.scatter import ErrorModel, scatter_from_plain, scatter_to_plain
from helisim.records.record import made_by, signal_in

if TYPE_CHECKING:
    import control

    from helisim.base.display import Axes, Figure

USABLE_COHERENCE = 0.6
"""Partial coherence from which a point of a response can be used (Tischler and Remple)."""
FORMAT = "helisim frequency response, version 1"

_NO_MODEL = (
    "the file holds no error model: points are weighed by coherence, and errors stated from what "
    "the fit leaves over"
)

_SAME = 1e-6  # frequencies of two files closer than this fraction are one, written with few digits
_LEAST_COHERENCE = 1e-4
"""Below it the random error that coherence implies is no number worth stating."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Value, Displayed):
    """Frequency responses of named outputs to named inputs, with their quality. Read-only.

    Two are equal where all that is written to files is.

    Attributes:
        frequency: (n_freq,) rad/s, increasing.
        response: (n_out, n_in, n_freq) output over input, in output unit per input unit.
        coherence: (n_out, n_in, n_freq) partial coherence: 1 where the input, cleared of the
            other inputs, explains the output.
        multiple_coherence: (n_out, n_freq) share of the output that all inputs explain.
        cross_control_coherence: (n_in, n_in, n_freq) coherence between inputs, best at 0.
        random_error: (n_out, n_in, n_freq) standard deviation of the response's magnitude,
            as a fraction of it, and of its phase in rad; what bias is left is in it.
        inputs, outputs: names.
        input_units, output_units: units, SI.
        conditioning: further inputs whose effect was removed.
        reference: signals that the joint input-output method used; empty for the direct one.
        estimator: "local" or "windows"; empty where it isn't known.
        windows: window lengths, s; empty where no windows were used.
        flags: warnings of the records' quality and of the cross-control gate.
        sources: a digest of each record.
        spans: which part of which flight each record is, as far as it says so, each (digest of
            the flight, first time, last time): a verification can't reuse a part of them.
        scatter: how the random errors at all points belong together, as far as records are
            known; fits state their standard errors from it.
        direct: with a reference, the direct estimate for comparison.
    """

    frequency: NDArray[np.float64]
    response: NDArray[np.complex128]
    coherence: NDArray[np.float64]
    multiple_coherence: NDArray[np.float64]
    cross_control_coherence: NDArray[np.float64]
    random_error: NDArray[np.float64]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    conditioning: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    estimator: str = ""
    windows: tuple[float, ...] = ()
    flags: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    spans: tuple[tuple[str, float, float], ...] = ()
    scatter: ErrorModel | None = field(default=None, compare=False)
    direct: "FrequencyResponse | None" = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check(self, "the frequency response")
        n_out, n_in = len(self.outputs), len(self.inputs)
        n_freq = np.size(self.frequency)
        shapes = {
            "frequency": (n_freq,),
            **dict.fromkeys(("response", "coherence", "random_error"), (n_out, n_in, n_freq)),
            "multiple_coherence": (n_out, n_freq),
            "cross_control_coherence": (n_in, n_in, n_freq),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                found = getattr(self, name).shape
                raise InputError(f"{name} has shape {found}, expected {shape}")
        if n_freq == 0 or self.frequency[0] <= 0.0 or np.any(np.diff(self.frequency) <= 0.0):
            raise InputError("frequency must be positive and increasing, in rad/s")

    @classmethod
    def exact(
        cls,
        frequency: ArrayLike,
        response: ArrayLike,
        *,
        inputs: Sequence[str],
        outputs: Sequence[str],
        input_units: Sequence[str] | None = None,
        output_units: Sequence[str] | None = None,
    ) -> "FrequencyResponse":
        """Return a response known without error, for example a model's: coherence is 1.

        Args:
            frequency: (n_freq,) rad/s, increasing.
            response: (n_out, n_in, n_freq) output over input.
            inputs: names.
            outputs: names.
            input_units: SI; unknown by default.
            output_units: SI; unknown by default.
        """
        n_out, n_in, n_freq = len(outputs), len(inputs), np.size(frequency)
        return cls(
            frequency=np.asarray(frequency, dtype=np.float64),
            response=np.asarray(response),
            coherence=np.ones((n_out, n_in, n_freq)),
            multiple_coherence=np.ones((n_out, n_freq)),
            cross_control_coherence=np.repeat(np.eye(n_in)[:, :, None], n_freq, axis=2),
            random_error=np.zeros((n_out, n_in, n_freq)),
            inputs=tuple(inputs),
            outputs=tuple(outputs),
            input_units=tuple(input_units or ("",) * n_in),
            output_units=tuple(output_units or ("",) * n_out),
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "FrequencyResponse":
        """Return what `to_dict` wrote.

        Raises:
            InputError: a field is missing, unknown or misshapen.
        """
        unknown = sorted(set(data).difference(_STORED))
        if unknown:
            raise InputError(
                f"unknown field(s) of a frequency response: {', '.join(unknown)}; "
                "the file was written by another version of helisim"
            )
        return from_plain(cls, data, "the frequency response")

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, complex arrays as {"real", "imag"}; no error model."""
        return {name: to_plain(getattr(self, name)) for name in _STORED}

    def __repr__(self) -> str:
        return (
            f"FrequencyResponse({', '.join(self.outputs)} over {', '.join(self.inputs)}, "
            f"{self.frequency.size} frequencies from {self.frequency[0]:.3g} to "
            f"{self.frequency[-1]:.3g} rad/s)"
        )

    @property
    def pairs(self) -> tuple[str, ...]:
        """The responses by name, such as "p/lat", inputs changing fastest."""
        return tuple(f"{output}/{input_}" for output in self.outputs for input_ in self.inputs)

    @property
    def provenance(self) -> dict[str, Any]:
        """From what the response was estimated and how, as plain data."""
        return {
            "method": self.method,
            "estimator": self.estimator,
            "records": list(self.sources),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "conditioning": list(self.conditioning),
            "reference": list(self.reference),
            "windows_s": list(self.windows),
            "band_rad_s": [float(self.frequency[0]), float(self.frequency[-1])],
        }

    @property
    def method(self) -> str:
        """How it was estimated: "joint input-output" with references, or "direct"."""
        return "joint input-output" if self.reference else "direct"

    def index(self, output: str, input_: str) -> tuple[int, int]:
        """Return where a pair is in the arrays. Raises UnknownNameError."""
        if output not in self.outputs:
            raise UnknownNameError("output", output, self.outputs)
        if input_ not in self.inputs:
            raise UnknownNameError("input", input_, self.inputs)
        return self.outputs.index(output), self.inputs.index(input_)

    def usable(self, limit: float = USABLE_COHERENCE) -> NDArray[np.bool_]:
        """Return where the partial coherence reaches `limit`, (n_out, n_in, n_freq)."""
        return self.coherence >= limit

    def in_units(self, units: UserUnits) -> "FrequencyResponse":
        """Return the response in the given units, without its error model."""
        inputs, outputs = (
            [signal_in(units, name, one, is_input=driven) for name, one in zip(names, known)]
            for names, known, driven in (
                (self.inputs, self.input_units, True),
                (self.outputs, self.output_units, False),
            )
        )
        factor = np.outer([many for _, many in outputs], [1.0 / many for _, many in inputs])
        return replace(
            self,
            response=self.response * factor[:, :, None],
            input_units=tuple(label for label, _ in inputs),
            output_units=tuple(label for label, _ in outputs),
            scatter=None,
            direct=None,
        )

    def plot(
        self,
        pairs: "Sequence[str] | str | None" = None,
        *,
        axes: "Sequence[Axes] | None" = None,
    ) -> "Figure":
        """Draw magnitude with its error band, phase and coherence; hollow where not usable.

        Args:
            pairs: such as ("p/lat", "q/lon"); by default all.
            axes: to draw on, one a panel, pair by pair; by default those of a new figure.

        Raises:
            UnknownNameError: no such response.
            InputError: there are more or fewer axes than panels.
        """
        return shower().plot_response(self, pairs, axes)

    def save(self, path: "str | PathLike[str]") -> None:
        """Write the response as JSON, with its error model, or as CSV; `load_response` reads both.

        From the JSON a fit finds what it finds from the records, to the last bit. CSV is for
        other programs: it has neither the error model nor how the inputs hung together.

        Raises:
            StorageError: the suffix is neither .json nor .csv, or the file can't be written.
        """
        save_response(self, path)

    def to_frd(self) -> "control.FRD":
        """Return the response as python-control's frequency response data."""
        import control  # slow to import: it brings matplotlib

        return control.FRD(
            self.response, self.frequency, inputs=list(self.inputs), outputs=list(self.outputs)
        )


_STORED = tuple(one.name for one in fields(FrequencyResponse) if one.compare)
"""Fields that are written to files; the others are estimated from the records again."""


def save_response(
    frf: FrequencyResponse, path: str | PathLike[str], more: Mapping[str, Any] | None = None
) -> None:
    """Write a response as `FrequencyResponse.save` does; JSON holds `more` plain data beside it.

    Raises:
        StorageError: the suffix is neither .json nor .csv, or the file can't be written.
    """
    units = {"input_units": list(frf.input_units), "output_units": list(frf.output_units)}
    provenance = made_by("frequency response", **frf.provenance, **units)
    if check_suffix(Path(path), (".json", ".csv")) == ".json":
        data = {"format": FORMAT, "response": frf.to_dict(), "provenance": provenance}
        if frf.scatter is not None:
            data["scatter"] = scatter_to_plain(frf.scatter, frf.response)
        write_json({**data, **(more or {})}, path)
        return
    columns = {"frequency [rad/s]": frf.frequency}
    for name in frf.pairs:
        o, i = frf.index(*name.split("/", 1))
        columns |= {
            f"{name} magnitude [dB]": decibel(np.abs(frf.response[o, i])),
            f"{name} phase [deg]": np.degrees(np.unwrap(np.angle(frf.response[o, i]))),
            f"{name} coherence [1]": frf.coherence[o, i],
            f"{name} random error [1]": frf.random_error[o, i],
        }
    write_columns(columns, provenance, path)


def is_response(path: str | PathLike[str]) -> bool:
    """Return whether a file seems to hold a frequency response, and not a log."""
    return Path(path).suffix.lower() == ".json" or looks_like_response(path)


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
    text = read_columns(path, columns)
    curves = dict(text.curves)
    if "" in curves:
        if unnamed is None:
            raise InputError(
                f"{path}: the headings name no response; say which one it is, by unnamed='p/lat'; "
                "on the command line it is p/lat=FILE"
            )
        curves[unnamed] = curves.pop("")
    return _assembled(text.frequency, curves, text.provenance, _told(path, text, curves))


def _from_json(path: str | PathLike[str]) -> FrequencyResponse:
    data = read_json(path)
    with placed(path):
        if data.get("format") != FORMAT or not isinstance(data.get("response"), dict):
            raise InputError(
                f"isn't a frequency response: its format is {data.get('format')!r}, expected "
                f"{FORMAT!r}, as FrequencyResponse.save and helisim frf write it"
            )
        found = FrequencyResponse.from_dict(data["response"])
        if "scatter" in data:
            return replace(found, scatter=scatter_from_plain(data["scatter"], found.response))
    known = _NO_MODEL in found.flags or not np.any(found.random_error)
    return found if known else replace(found, flags=(*found.flags, _NO_MODEL))


def _joined(files: Mapping[str, tuple[str | PathLike[str], Text]]) -> FrequencyResponse:
    """Return the responses of several files, one each, at all frequencies that occur."""
    every = np.sort(np.concatenate([text.frequency for _, text in files.values()]))
    frequency = every[np.append(True, np.diff(every) > _SAME * every[1:])]
    curves, told = {}, []
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


def _placed(curve: Curve, frequency: NDArray[np.float64], grid: NDArray[np.float64]) -> Curve:
    """Return a curve at the frequencies of a grid that holds its own; elsewhere not coherent."""
    at = np.searchsorted(grid, frequency * (1.0 - _SAME))
    coherence, error = np.zeros(grid.size), np.ones(grid.size)
    coherence[at], error[at] = _quality(curve)
    real, imaginary = (
        np.interp(grid, frequency, part) for part in (curve.response.real, curve.response.imag)
    )
    response = real + 1j * imaginary
    response[at] = curve.response
    return Curve(response, coherence, error)


def _quality(curve: Curve) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return coherence, 1 if unknown, and random error, or one average's (Bendat and Piersol)."""
    ones = np.ones(curve.response.size)
    coherence = ones if curve.coherence is None else curve.coherence
    share = np.maximum(coherence, _LEAST_COHERENCE)
    implied = np.sqrt((1.0 - share) / (2.0 * share))
    return coherence, implied if curve.error is None else curve.error


def _assembled(
    frequency: NDArray[np.float64],
    curves: Mapping[str, Curve],
    provenance: Mapping[str, Any],
    told: Sequence[str],
) -> FrequencyResponse:
    """Return responses at the same frequencies as one; what isn't known is assumed as told."""
    outputs, inputs = paired(curves)
    stated = [_stated(provenance, name, str) for name in ("outputs", "inputs")]
    if set(stated[0]) == set(outputs) and set(stated[1]) == set(inputs):
        outputs, inputs = stated  # in the order in which helisim had them
    shape = (len(outputs), len(inputs), frequency.size)
    response, coherence = np.ones(shape, dtype=np.complex128), np.zeros(shape)
    error = np.ones(shape)
    for name, curve in curves.items():
        output, input_ = name.split("/")
        at = outputs.index(output), inputs.index(input_)
        response[at] = curve.response
        coherence[at], error[at] = _quality(curve)
    missing = [f"{o}/{i}" for o in outputs for i in inputs if f"{o}/{i}" not in curves]
    if missing:
        told = [*told, f"not in the file(s): {', '.join(missing)}"]
    inputs_si = _si(_stated(provenance, "input_units", str), len(inputs))
    outputs_si = _si(_stated(provenance, "output_units", str), len(outputs))
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
        input_units=tuple(label for label, _ in inputs_si),
        output_units=tuple(label for label, _ in outputs_si),
        conditioning=_stated(provenance, "conditioning", str),
        reference=_stated(provenance, "reference", str),
        sources=_stated(provenance, "records", str),
        windows=tuple(map(float, _stated(provenance, "windows_s", int | float))),
        estimator=str(provenance.get("estimator", "")),
        flags=tuple(dict.fromkeys(told)),
    )


def _stated(provenance: Mapping[str, Any], name: str, kind: Any) -> tuple[Any, ...]:
    """Return a list of a provenance; an empty one where it is none of that kind."""
    items = provenance.get(name)
    fine = isinstance(items, list) and all(isinstance(one, kind) for one in items)
    return tuple(items) if items and fine else ()


def _si(written: Sequence[str], count: int) -> list[tuple[str, float]]:
    """Return the SI unit of each unit that was written, and how many of it one is."""
    found = []
    for name in written if len(written) == count else ("",) * count:
        si = unit(name) if is_unit(name) else None
        known = si is not None and math.isfinite(si.factor)
        found.append((si.si, si.factor) if si is not None and known else (name, 1.0))
    return found


def _told(path: str | PathLike[str], text: Text, curves: Mapping[str, Curve]) -> list[str]:
    """Return what was found out of a file and what is assumed instead of what it lacks."""
    told = [] if text.provenance else [f"{path}: read as {text.units}"]
    for quantity, word, assumed in (
        ("coherence", "coherence", "it is taken as 1, so that all points count alike"),
        (
            "error",
            "random error",
            "what is drawn is the most that the coherence allows, that of one average; a fit "
            "doesn't use it",
        ),
    ):
        lacking = [name for name, one in curves.items() if getattr(one, quantity) is None]
        if lacking:
            told.append(f"{path}: has no {word} of {', '.join(lacking)}: {assumed}")
    return [*told, _NO_MODEL]
