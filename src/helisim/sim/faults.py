"""What can fail: a servo in flight, and the recorder's samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import Checked, setting
from helisim.physics.layout import NEVER, PARAM
from helisim.records.record import SERVOS, FlightRecord


@dataclass(frozen=True, kw_only=True)
class ServoStuck(Checked):
    """A servo that runs to a position at a time, s, and sticks there; its commands go on.

    The position is unitised; None is where the servo is at that time.
    """

    servo: str = setting(choices=SERVOS)
    at: float = setting(unit="s", low=0.0)
    position: float | None = setting(None, low=-1.0, high=1.0)


@dataclass(frozen=True, kw_only=True)
class SampleLoss(Checked):
    """A recorder that now and then writes nothing.

    It loses a share of all samples, between 0 and 1, in bursts of so many in a row.
    """

    share: float = setting(above=0.0, below=1.0)
    burst: int = setting(1, low=1)

    at: ClassVar[float] = 0.0

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        # bursts may overlap: a sample stays if none of the `burst` places before it starts one
        starts = rng.random(len(record)) < 1.0 - (1.0 - self.share) ** (1.0 / self.burst)
        return _without(record, np.convolve(starts, np.ones(self.burst))[: len(record)] > 0.0)


@dataclass(frozen=True, kw_only=True)
class RecordGap(Checked):
    """A recorder that writes nothing from a time on, s, for as long as it `lasts`, s."""

    at: float = setting(unit="s", low=0.0)
    lasts: float = setting(unit="s", above=0.0)

    def apply(self, record: FlightRecord, _: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        return _without(record, (record.time >= self.at) & (record.time < self.at + self.lasts))


def _without(record: FlightRecord, lost: NDArray[np.bool_]) -> FlightRecord:
    if np.count_nonzero(~lost) < 2:
        raise InputError("the recorder loses every sample: lose less")
    return replace(record, time=record.time[~lost], values=record.values[~lost])


Fault = ServoStuck | SampleLoss | RecordGap
FAULTS = {kind.__name__: kind for kind in (ServoStuck, SampleLoss, RecordGap)}


def check_faults(faults: Sequence[Fault], duration: float) -> None:
    """Raise InputError unless all faults can come in one flight of that many seconds."""
    for fault in faults:
        if fault.at >= duration:
            raise InputError(
                f"{type(fault).__name__} at {fault.at:g} s: the flight is over at {duration:g} s"
            )
    servos = [fault.servo for fault in faults if isinstance(fault, ServoStuck)]
    for servo in servos:
        if servos.count(servo) > 1:
            raise InputError(f"{servo}: a flight has one fault of a servo, got several")


def write_faults(par: NDArray[np.float64], faults: Sequence[Fault]) -> None:
    """Put the servos' faults into a vehicle's parameters (n_param,) for the force laws."""
    stuck = [fault for fault in faults if isinstance(fault, ServoStuck)]
    par[PARAM.faults] = float(bool(stuck))
    par[PARAM.faults + 1 : PARAM.tail_fault_high + 1] = NEVER
    for one in stuck:
        first, at = PARAM.front_fault_at + 4 * SERVOS.index(one.servo), one.position
        limits = (0.0, -NEVER, NEVER) if at is None else (NEVER, at, at)
        par[first : first + 4] = one.at, *limits
