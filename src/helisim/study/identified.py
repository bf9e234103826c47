"""An identified model: the fit behind a table of results, and what it is judged by.

Kept beside `results.json` as `fits.json`, so that a report can be made again from files alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from helisim import ident
from helisim.base.errors import InputError
from helisim.base.files import read_json, write_json
from helisim.base.value import Value
from helisim.ident.verification import Approach, Trace
from helisim.records.provenance import made_by

FORMAT = "helisim fits, version 1"


@dataclass(frozen=True, eq=False)
class IdentifiedModel(Value):
    """One identified model with what it can be judged by.

    Attributes:
        name: of the model; the table of results of the same name holds its numbers.
        fit: the model, and the frequency response that it was fitted to.
        exact: the response of the vehicle that flew, without error; None for a real one.
        note: why this band and these channels.
        verification: how well it predicts flights that no fit has seen; None if none was flown.
        verified_on: names of those flights, in the order of the verification's traces.
    """

    name: str
    fit: ident.Fit
    exact: ident.FrequencyResponse | None = None
    note: str = ""
    verification: ident.Verification | None = None
    verified_on: tuple[str, ...] = ()

    def __repr__(self) -> str:
        checked = "" if self.verification is None else f", {self.verification!r}"
        return f"IdentifiedModel({self.name!r}, {self.fit!r}{checked})"

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        checked = self.verification
        return {
            "name": self.name,
            "note": self.note,
            "fit": self.fit.to_dict(),
            "exact": None if self.exact is None else self.exact.to_dict(),
            "verification": None if checked is None else _verification_to_dict(checked),
            "verified_on": list(self.verified_on),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "IdentifiedModel":
        """Return the model that `to_dict` gave. Raises InputError, KeyError, TypeError."""
        checked = data["verification"]
        fit = ident.Fit.from_dict(data["fit"])
        return cls(
            name=str(data["name"]),
            fit=fit,
            exact=None
            if data["exact"] is None
            else ident.FrequencyResponse.from_dict(data["exact"]),
            note=str(data["note"]),
            verification=None if checked is None else _verification_from_dict(checked, fit),
            verified_on=tuple(data["verified_on"]),
        )


def write_models(path: str | Path, items: Sequence[IdentifiedModel]) -> Path:
    """Write models as JSON and return the path.

    Raises StorageError.
    """
    path = Path(path)
    data = {
        "format": FORMAT,
        "provenance": made_by("fits"),
        "models": [item.to_dict() for item in items],
    }
    write_json(data, path)
    return path


def read_models(path: str | Path) -> tuple[IdentifiedModel, ...]:
    """Read what `write_models` wrote.

    Raises:
        StorageError: the file can't be read.
        InputError: it holds something else.
    """
    data = read_json(path)
    if data.get("format") != FORMAT:
        raise InputError(f"{path}: its format is {data.get('format')!r}, expected {FORMAT!r}")
    try:
        return tuple(IdentifiedModel.from_dict(item) for item in data["models"])
    except (KeyError, TypeError, InputError) as error:
        raise InputError(f"{path}: can't read a model: {error}") from None


def _verification_to_dict(verification: ident.Verification) -> dict[str, Any]:
    traces = [
        {one.name: np.asarray(getattr(trace, one.name)).tolist() for one in fields(Trace)}
        for trace in verification.traces
    ]
    approach = verification.approach
    return {
        "outputs": list(verification.outputs),
        "units": list(verification.units),
        "traces": traces,
        "j_rms": verification.j_rms,
        "tic": verification.tic,
        "j_rms_by_output": dict(verification.j_rms_by_output),
        "tic_by_output": dict(verification.tic_by_output),
        "approach": None if approach is None else approach.to_dict(),
        "quiet": list(verification.quiet),
    }


def _verification_from_dict(data: Mapping[str, Any], fit: ident.Fit) -> ident.Verification:
    told = data.get("approach")
    return ident.Verification(
        inputs=fit.structure.inputs,
        outputs=tuple(data["outputs"]),
        units=tuple(data["units"]),
        traces=tuple(Trace(**trace) for trace in data["traces"]),
        j_rms=float(data["j_rms"]),
        tic=float(data["tic"]),
        j_rms_by_output=dict(data["j_rms_by_output"]),
        tic_by_output=dict(data["tic_by_output"]),
        approach=Approach.from_dict(told) if told else None,
        quiet=tuple(data.get("quiet", ())),
    )
