"""The frequency response of a vehicle: named outputs over named inputs, with its quality."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.value import Value
from helisim.ident.responses.estimate import ErrorModel
from helisim.ident.responses.seen import FlightSpan

if TYPE_CHECKING:
    from os import PathLike

    import control

    from helisim.base.display import Axes, Figure

USABLE_COHERENCE = 0.6
"""Partial coherence from which a point of a response can be used (Tischler and Remple)."""

_IN_MEMORY = {"stored": False}
"""Marks fields that are estimated from the records again, not written to files."""


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
        spans: which part of which flight each record is, as far as it says so: a verification
            can't reuse a part of them, see `helisim.ident.responses.seen`.
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
    spans: tuple[FlightSpan, ...] = ()
    scatter: ErrorModel | None = field(default=None, compare=False, metadata=_IN_MEMORY)
    direct: "FrequencyResponse | None" = field(default=None, compare=False, metadata=_IN_MEMORY)

    def __post_init__(self) -> None:
        n_out, n_in = len(self.outputs), len(self.inputs)
        n_freq = np.size(self.frequency)
        pair = (n_out, n_in, n_freq)
        shapes = {
            "frequency": (n_freq,),
            "response": pair,
            "coherence": pair,
            "multiple_coherence": (n_out, n_freq),
            "cross_control_coherence": (n_in, n_in, n_freq),
            "random_error": pair,
        }
        for name, shape in shapes.items():
            kind = np.complex128 if name == "response" else np.float64
            array = np.array(getattr(self, name), dtype=kind)
            if array.shape != shape:
                raise InputError(f"{name} has shape {array.shape}, expected {shape}")
            if not np.all(np.isfinite(array)):
                raise InputError(f"{name} holds values that are not finite")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if n_freq == 0 or self.frequency[0] <= 0.0 or np.any(np.diff(self.frequency) <= 0.0):
            raise InputError("frequency must be positive and increasing, in rad/s")
        object.__setattr__(self, "spans", tuple(FlightSpan(*span) for span in self.spans))

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
        response = np.asarray(response)
        n_out, n_in, n_freq = len(outputs), len(inputs), np.size(frequency)
        return cls(
            frequency=np.asarray(frequency, dtype=np.float64),
            response=response,
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
        """Read what `to_dict` wrote; the `marks` of records in earlier files are left out.

        Raises:
            InputError: a field is missing, unknown or misshapen.
        """
        data = {name: item for name, item in data.items() if name != "marks"}
        unknown = sorted(set(data) - set(_stored()))
        if unknown:
            raise InputError(
                f"unknown field(s) of a frequency response: {', '.join(unknown)}; "
                "the file was written by another version"
            )
        try:
            return cls(**{name: _from_plain(item) for name, item in data.items()})
        except (TypeError, ValueError, KeyError) as error:
            raise InputError(f"can't read the frequency response: {error}") from None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, complex arrays as {"real", "imag"}; no error model."""
        return {name: _to_plain(getattr(self, name)) for name in _stored()}

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

        Returns:
            A matplotlib figure, which a notebook shows; nothing is kept of it.

        Raises:
            UnknownNameError: no such response.
            InputError: there are more or fewer axes than panels.
        """
        return shower().plot_response(self, pairs, axes)

    def save(self, path: "str | PathLike[str]") -> None:
        """Write the response as JSON, with its error model, or as CSV; `load_response` reads both.

        From the JSON a fit finds what it finds from the records, to the last bit.

        Raises:
            StorageError: the suffix is neither .json nor .csv, or the file can't be written.
        """
        from helisim.ident.responses.response_file import save_response

        save_response(self, path)

    def to_frd(self) -> "control.FRD":
        """Return the response as python-control's frequency response data."""
        import control  # slow to import: it brings matplotlib

        return control.FRD(
            self.response,
            self.frequency,
            inputs=list(self.inputs),
            outputs=list(self.outputs),
        )


def _stored() -> tuple[str, ...]:
    """Return the names of the fields that are written to files."""
    return tuple(one.name for one in fields(FrequencyResponse) if one.metadata.get("stored", True))


def _to_plain(item: Any) -> Any:
    match item:
        case np.ndarray() if np.iscomplexobj(item):
            return {"real": item.real.tolist(), "imag": item.imag.tolist()}
        case np.ndarray():
            return item.tolist()
        case tuple():
            return [_to_plain(one) for one in item]
    return item


def _from_plain(item: Any) -> Any:
    match item:
        case {"real": real, "imag": imag, **rest} if not rest:
            number = np.asarray(real, dtype=np.complex128)
            number.imag = np.asarray(imag, dtype=np.float64)
            return number
        case list() if not any(isinstance(one, list | dict) for one in item):
            return tuple(item)
    return item
