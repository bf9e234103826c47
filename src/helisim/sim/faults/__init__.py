"""What can fail: servos and gyro in flight, the recorder's sensors, samples and clock."""

from collections.abc import Sequence

from helisim.base.errors import InputError
from helisim.sim.faults.flight import (
    FlightFault,
    GyroDropout,
    GyroRestart,
    ServoStuck,
    ServoWeak,
    check_parts,
    write_faults,
)
from helisim.sim.faults.notation import FAULTS, Fault, parse_fault
from helisim.sim.faults.recorder import (
    ClockDrift,
    RecorderFault,
    RecordGap,
    SampleLoss,
    SensorDropout,
    SensorSpikes,
)

__all__ = [
    "FAULTS",
    "ClockDrift",
    "Fault",
    "FlightFault",
    "GyroDropout",
    "GyroRestart",
    "RecordGap",
    "RecorderFault",
    "SampleLoss",
    "SensorDropout",
    "SensorSpikes",
    "ServoStuck",
    "ServoWeak",
    "check_faults",
    "parse_fault",
    "write_faults",
]


def check_faults(faults: Sequence[Fault], duration: float) -> None:
    """Check that all faults can come in one flight of that many seconds.

    Raises:
        InputError: one is no fault, or comes after the flight, or two are of the same part.
    """
    for fault in faults:
        if not isinstance(fault, Fault):
            raise InputError(f"faults must be such as ServoStuck or SampleLoss, got {fault!r}")
        at = getattr(fault, "at", 0.0)
        if at >= duration:
            raise InputError(
                f"{type(fault).__name__} at {at:g} s: the flight is over at {duration:g} s"
            )
    check_parts([fault for fault in faults if isinstance(fault, FlightFault)])
