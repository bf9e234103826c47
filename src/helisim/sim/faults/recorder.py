"""What a flight computer does wrong: sensors that drop out or spike, lost samples, its clock.

These change what stands in a record; the helicopter flies as ever.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError, UnknownNameError
from helisim.records.channels import channel
from helisim.records.record import FlightRecord
from helisim.sim.faults.flight import check_time

_FEWEST = 2
"""Samples that a record needs."""


@dataclass(frozen=True, kw_only=True)
class SensorDropout:
    """Channels that freeze, or read zero, for a while.

    Attributes:
        channels: names, one or several.
        at: s.
        lasts: s.
        reads: "held" for the last number before, or "zero".
    """

    channels: str | Sequence[str]
    at: float
    lasts: float
    reads: Literal["held", "zero"] = "held"

    def __post_init__(self) -> None:
        _check_channels(self)
        check_time(self, "at", "lasts")
        if self.reads not in ("held", "zero"):
            raise UnknownNameError("reading of a dropout", self.reads, ("held", "zero"))

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        del rng
        values = record.values.copy()
        out = (record.time >= self.at) & (record.time < self.at + self.lasts)
        if out.any():
            last = max(int(np.argmax(out)) - 1, 0)
            for name in self.channels:
                k = _column(record, name)
                values[out, k] = values[last, k] if self.reads == "held" else 0.0
        return replace(record, values=values)


@dataclass(frozen=True, kw_only=True)
class SensorSpikes:
    """Single samples that are far off.

    Attributes:
        channels: names, one or several; each has spikes of its own.
        size: by which a spike is off, up or down, in the channel's unit.
        per_minute: how many there are on average.
    """

    channels: str | Sequence[str]
    size: float
    per_minute: float = 6.0

    def __post_init__(self) -> None:
        _check_channels(self)
        if not (math.isfinite(self.size) and self.size > 0.0):
            raise InputError(f"SensorSpikes: size must be positive, got {self.size}")
        if not 0.0 < self.per_minute < math.inf:
            raise InputError(f"SensorSpikes: per_minute must be positive, got {self.per_minute}")

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        values = record.values.copy()
        chance = self.per_minute / 60.0 * record.duration / (len(record) - 1)
        for name in self.channels:
            hit = rng.random(len(record)) < chance
            sign = rng.choice([-1.0, 1.0], size=len(record))
            values[:, _column(record, name)] += self.size * np.where(hit, sign, 0.0)
        return replace(record, values=values)


@dataclass(frozen=True, kw_only=True)
class SampleLoss:
    """A recorder that now and then writes nothing.

    Attributes:
        share: of all samples that is lost, on average.
        burst: samples that are lost in a row.
    """

    share: float
    burst: int = 1

    def __post_init__(self) -> None:
        if not 0.0 < self.share < 1.0:
            raise InputError(f"SampleLoss: share must be above 0 and below 1, got {self.share}")
        if self.burst != int(self.burst) or self.burst < 1:
            raise InputError(f"SampleLoss: burst must be 1 or more samples, got {self.burst}")

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        burst = int(self.burst)
        # bursts may overlap: a sample stays if none of the `burst` places before it starts one
        starts = rng.random(len(record)) < 1.0 - (1.0 - self.share) ** (1.0 / burst)
        return _without(record, np.convolve(starts, np.ones(burst))[: len(record)] > 0.0)


@dataclass(frozen=True, kw_only=True)
class RecordGap:
    """A recorder that writes nothing for a while.

    Attributes:
        at: s.
        lasts: s.
    """

    at: float
    lasts: float

    def __post_init__(self) -> None:
        check_time(self, "at", "lasts")

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        del rng
        return _without(record, (record.time >= self.at) & (record.time < self.at + self.lasts))


@dataclass(frozen=True, kw_only=True)
class ClockDrift:
    """A clock that goes wrong by a constant rate.

    Attributes:
        ppm: by how many parts in a million it is fast; negative is slow.
        channels: those that a second computer took by this clock and that were then put beside
            the others by their stamps, so that they slip against them. None: the recorder's
            own clock, so all stamps are wrong alike.
    """

    ppm: float
    channels: str | Sequence[str] | None = None

    def __post_init__(self) -> None:
        if self.channels is not None:
            _check_channels(self)
        if not (0.0 < abs(self.ppm) <= 1e5):
            raise InputError(
                f"ClockDrift: ppm must be other than 0 and at most 1e5 either way, got {self.ppm}"
            )

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        del rng
        fast, start = 1.0 + 1e-6 * self.ppm, record.time[0]
        if self.channels is None:
            return replace(record, time=start + fast * (record.time - start))
        true = np.minimum(start + (record.time - start) / fast, record.time[-1])
        values = record.values.copy()
        for name in self.channels:
            k = _column(record, name)
            values[:, k] = CubicSpline(record.time, record.values[:, k])(true)
        return replace(record, values=values)


RecorderFault = SensorDropout | SensorSpikes | SampleLoss | RecordGap | ClockDrift


def _check_channels(fault: SensorDropout | SensorSpikes | ClockDrift) -> None:
    names = fault.channels
    names = (names,) if isinstance(names, str) else tuple(names or ())
    if not names:
        raise InputError(f"{type(fault).__name__}: needs at least one channel")
    for name in names:
        channel(name)
    object.__setattr__(fault, "channels", names)


def _column(record: FlightRecord, name: str) -> int:
    record.unit(name)  # or says which names there are
    return record.names.index(name)


def _without(record: FlightRecord, lost: NDArray[np.bool_]) -> FlightRecord:
    if np.count_nonzero(~lost) < _FEWEST:
        raise InputError("the recorder loses every sample: lose less")
    return replace(record, time=record.time[~lost], values=record.values[~lost])
