"""Frequency response of a vehicle: named outputs over named inputs, with quality and files."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from helisim.base.arrays import Complex, Real
from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, check_known
from helisim.base.files import atomic_write, check_suffix, write_json
from helisim.base.note import Note
from helisim.base.settings import Value, check, from_plain, to_plain
from helisim.base.units import decibel
from helisim.ident.conditions import Conditions
from helisim.ident.scatter import ErrorModel
from helisim.records.record import ATTITUDES, RATES, made_by

if TYPE_CHECKING:
    from helisim.base.display import Figure


USABLE_COHERENCE = 0.6  # Partial coherence from which a point is usable (Tischler and Remple)
FORMAT = "helisim frequency response, version 1"


def opposes(omega: Real, response: Complex) -> bool:
    """Return whether a rate over its control, (n_freq,), is rather a controller's inverse.

    That is -e^(s tau) / (P + I/s + D s), a vehicle g e^(-s tau) / (s + a), of no negative P, I, D,
    g and tau: that one counts whose inverse is closer to the response's, each error over its size.
    Delays to 0.3 s are tried, a rotor's, servo's and link's in one, by 10 ms: between two, 30 rad/s
    is 9 degrees off at most. The first form has four unknowns, so two points tell nothing.
    """
    s = 1j * omega

    def left(*parts: Any) -> float:
        rows = np.stack(parts, axis=1) * response[:, None]
        return nnls(np.vstack([rows.real, rows.imag]), np.repeat([1.0, 0.0], omega.size))[1]

    early = np.exp(np.outer(np.linspace(0.0, 0.3, 31), s))
    return omega.size > 3 and min(left(-late, -late / s, -late * s) for late in 1.0 / early) < min(
        left(one, -one, s * one) for one in early
    )


@dataclass(frozen=True, eq=False)
class FrequencyResponse(Value, Displayed):
    """Frequency responses of named outputs to named inputs, with their quality; read-only.

    Attributes:
        frequency: (n_freq,) rad/s, increasing.
        response: (n_out, n_in, n_freq) output unit per input unit, SI.
        coherence: (n_out, n_in, n_freq) partial coherence.
        multiple_coherence: (n_out, n_freq) coherence with all inputs.
        cross_control_coherence: (n_in, n_in, n_freq) coherence between inputs, best at 0.
        random_error: (n_out, n_in, n_freq) standard deviation of the relative magnitude and of
            the phase in rad, including remaining bias.
        conditioning: further inputs whose effect was removed.
        reference: of the joint input-output method; empty for the direct one.
        windows: window lengths, s; empty without windows.
        spans: (digest of the flight, first time, last time) of each record that is known.
        conditions: full travel of the commands, and the hover of the flights.
        scatter: error model with correlations, for standard errors of fits.
        direct: with a reference, the direct estimate for comparison.
    """

    frequency: Real
    response: NDArray[np.complex128]
    coherence: Real
    multiple_coherence: Real
    cross_control_coherence: Real
    random_error: Real
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    conditioning: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    estimator: str = ""
    windows: tuple[float, ...] = ()
    flags: tuple[str, ...] = ()
    evidence: tuple[Note, ...] = ()
    sources: tuple[str, ...] = ()
    spans: tuple[tuple[str, float, float], ...] = ()
    conditions: Conditions = field(default_factory=Conditions)
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
            if (found := getattr(self, name).shape) != shape:
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
        """Return a response known without error, (n_out, n_in, n_freq), at (n_freq,) rad/s."""
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
        """Return what `to_dict` wrote. Raises InputError for fields missing or misshapen."""
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
        """Names of the responses, such as "p/lat", inputs changing fastest."""
        return tuple(f"{output}/{input_}" for output in self.outputs for input_ in self.inputs)

    @property
    def provenance(self) -> dict[str, Any]:
        """Origin of the response as plain data."""
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
        """Method, "joint input-output" or "direct"."""
        return "joint input-output" if self.reference else "direct"

    @property
    def line(self) -> float:
        """Spacing of the longest record's lines, rad/s; 0 if it is unknown or nothing smears."""
        longest = max((stop - start for _, start, stop in self.spans), default=0.0)
        return 2.0 * math.pi / longest if longest and self.estimator != "likelihood" else 0.0

    def index(self, output: str, input_: str) -> tuple[int, int]:
        """Return a pair's indices in the arrays. Raises UnknownNameError."""
        check_known("output", [output], self.outputs)
        check_known("input", [input_], self.inputs)
        return self.outputs.index(output), self.inputs.index(input_)

    def usable(self, limit: float = USABLE_COHERENCE) -> NDArray[np.bool_]:
        """Return where the partial coherence reaches `limit`, (n_out, n_in, n_freq)."""
        return self.coherence >= limit

    @property
    def opposed(self) -> bool:
        """Whether a rate or attitude over its control is rather a controller's inverse."""
        return any(
            opposes(self.frequency[ok], self.response[at][ok] * (1j * self.frequency[ok]) ** order)
            for names, order in ((RATES, 0), (ATTITUDES, 1))
            for control, name in zip(("lat", "lon", "ped"), names)
            if control in self.inputs and name in self.outputs
            for at in [self.index(name, control)]
            for ok in [self.usable()[at]]
        )

    def part(self, count: int) -> "FrequencyResponse":
        """Return the response to the first inputs, with the others as conditioning inputs."""
        return replace(
            self,
            response=self.response[:, :count],
            coherence=self.coherence[:, :count],
            random_error=self.random_error[:, :count],
            cross_control_coherence=self.cross_control_coherence[:count, :count],
            inputs=self.inputs[:count],
            input_units=self.input_units[:count],
            conditioning=self.inputs[count:],
        )

    def plot(self, pairs: "Sequence[str] | str | None" = None) -> "Figure":
        """Draw magnitude, phase and coherence of `pairs`, such as ("p/lat",); default all."""
        return shower().plot_response(self, pairs)

    def save(self, path: "str | PathLike[str]") -> None:
        """Write the response as JSON or CSV, without its error model. Raises StorageError."""
        data = response_data(self)
        if check_suffix(Path(path), (".json", ".csv")) == ".json":
            return write_json(data, path)
        columns = {"frequency [rad/s]": self.frequency}
        for name in self.pairs:
            o, i = self.index(*name.split("/", 1))
            columns |= {
                f"{name} magnitude [dB]": decibel(np.abs(self.response[o, i])),
                f"{name} phase [deg]": np.degrees(np.unwrap(np.angle(self.response[o, i]))),
                f"{name} coherence [1]": self.coherence[o, i],
                f"{name} random error [1]": self.random_error[o, i],
            }
        with (
            atomic_write(path) as temporary,
            temporary.open("w", encoding="utf-8", newline="") as file,
        ):
            file.write(f"# provenance: {json.dumps(data['provenance'], sort_keys=True)}\n")
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(np.column_stack(list(columns.values())).tolist())


_STORED = tuple(one.name for one in fields(FrequencyResponse) if one.compare)  # fields in files


def response_data(frf: FrequencyResponse) -> dict[str, Any]:
    """Return a response with its format and provenance as plain data."""
    units = {"input_units": list(frf.input_units), "output_units": list(frf.output_units)}
    provenance = made_by("frequency response", **frf.provenance, **units)
    return {"format": FORMAT, "response": frf.to_dict(), "provenance": provenance}
