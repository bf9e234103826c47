"""Chooses what is fitted, by the axes that were swept: structures, signals, references, bands."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from helisim.base.errors import InputError
from helisim.look.systemid.sweeps import FlownSweep

Band = tuple[float, float]

_HELI = (
    ("rollpitch", ("lat", "lon"), ("p", "q"), "roll and pitch were swept"),
    ("tf:0/2", ("lat",), ("p",), "roll alone was swept, so pitch isn't told apart"),
    ("tf:0/2", ("lon",), ("q",), "pitch alone was swept, so roll isn't told apart"),
    ("yaw_base", ("ped",), ("r",), "yaw was swept"),
    ("heave_imu", ("col",), ("az",), "thrust was swept"),
)
_OTHERS = (
    ("tf:0/2", ("lat",), ("p",), "roll was swept"),
    ("tf:0/2", ("lon",), ("q",), "pitch was swept"),
    ("tf:1/2", ("ped",), ("r",), "yaw was swept; the rotors' inertia answers at once, a zero"),
    ("tf:1/2", ("col",), ("az",), "thrust was swept"),
)
"""Structure, inputs, outputs, why; of those with an input in common the first that there is."""
_ROOM = 1.1
"""By which a band may be beyond another sweep's, whose effect is still taken out."""


@dataclass(frozen=True)
class InferredFit:
    """A fit that a log's sweeps allow.

    Attributes:
        structure: such as "rollpitch" or "tf:0/2".
        inputs: of the vehicle.
        outputs: of the vehicle.
        conditioning: further inputs that were swept: their effect is taken out.
        reference: what was injected, for the joint input-output method; none if it isn't possible.
        band: rad/s.
        why: this structure.
    """

    structure: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditioning: tuple[str, ...]
    reference: tuple[str, ...]
    band: Band
    why: str

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "structure": self.structure,
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "conditioning": list(self.conditioning),
            "reference": list(self.reference),
            "band_rad_s": list(self.band),
            "why": self.why,
        }

    def __str__(self) -> str:
        also = f", {', '.join(self.conditioning)} taken out" if self.conditioning else ""
        low, high = self.band
        return (
            f"{self.structure}: {', '.join(self.outputs)} over {', '.join(self.inputs)}{also}, "
            f"{low:.3g} to {high:.3g} rad/s: {self.why}"
        )


class Swept(NamedTuple):
    """What the sweeps of all logs are good for.

    Attributes:
        sweeps: that can identify the vehicle.
        channels: that there are.
        resolved: what records of them resolve, rad/s.
    """

    sweeps: tuple[FlownSweep, ...]
    channels: frozenset[str]
    resolved: Band

    @property
    def bands(self) -> Mapping[str, Band]:
        """Control -> the band in which it was swept, rad/s, where it has a channel."""
        found: dict[str, Band] = {}
        for one in self.sweeps:
            control = one.sid_axis.control
            low, high = found.get(control, (math.inf, 0.0))
            if control in self.channels:
                found[control] = min(low, one.low), max(high, one.high)
        return found

    def references(self, controls: Sequence[str]) -> tuple[str, ...]:
        """Return the channels of what was injected for controls."""
        mine = [one.sid_axis for one in self.sweeps if one.sid_axis.control in controls]
        return tuple(dict.fromkeys(axis.name for axis in sorted(mine, key=lambda x: x.number)))


def chosen_fits(swept: Swept, *, helicopter: bool) -> tuple[InferredFit, ...]:
    """Return the fits that sweeps allow, none with an input in common."""
    fits: list[InferredFit] = []
    for structure, inputs, outputs, why in _HELI if helicopter else _OTHERS:
        used = {name for fit in fits for name in fit.inputs}
        there = swept.channels.issuperset(outputs) and set(inputs) <= set(swept.bands)
        if there and not used & set(inputs):
            fits.append(fit_of(swept, structure, inputs, outputs, why))
    return tuple(fits)


def fit_of(
    swept: Swept, structure: str, inputs: Sequence[str], outputs: Sequence[str], why: str
) -> InferredFit:
    """Return a fit with its band, what is taken out, and the references.

    Raises:
        InputError: an input wasn't swept, or the sweeps have no frequency in common.
    """
    bands = swept.bands
    for name in inputs:
        if name not in bands:
            have = ", ".join(bands) or "none"
            raise InputError(
                f"the input {name!r} of {structure} wasn't swept in these logs; swept: {have}"
            )
    low = max(swept.resolved[0], *(bands[name][0] for name in inputs))
    high = min(swept.resolved[1], *(bands[name][1] for name in inputs))
    if not low < high:
        raise InputError(
            f"the sweeps of {', '.join(inputs)} have no frequency in common that the log resolves: "
            f"from {low:.3g} to {high:.3g} rad/s; sweep longer, or log faster"
        )
    others = tuple(
        name
        for name, (lowest, highest) in bands.items()
        if name not in inputs and lowest <= _ROOM * low and high <= _ROOM * highest
    )
    reference = swept.references((*inputs, *others))
    return InferredFit(
        structure, tuple(inputs), tuple(outputs), others, reference, (low, high), why
    )
