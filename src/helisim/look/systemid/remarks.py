"""What a log's reader should know of it, and what to set before the next flight."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from helisim.logs.resample import PASSBAND
from helisim.look.systemid.fits import InferredFit

if TYPE_CHECKING:
    from helisim.look.systemid.plan import InferredLog

_DROPPED = 0.01
"""Share of messages that may be missing without a word."""
_CONTROLS = {"lat": "roll", "lon": "pitch"}


def remarks(
    logs: "Sequence[InferredLog]", fits: Sequence[InferredFit], rate: float
) -> tuple[str, ...]:
    """Return what to know of logs that are to be fitted in records of a rate, Hz."""
    said = [one for log in logs for one in _of_log(log, rate)]
    said += _of_fits(logs, fits)
    return tuple(dict.fromkeys(said))


def _of_log(log: "InferredLog", rate: float) -> Iterator[str]:
    if log.dropped > _DROPPED:
        yield (
            f"{log.path}: the logger dropped {100.0 * log.dropped:.0f} % of the messages while "
            "sweeps were flown; the rest is interpolated, which costs accuracy where the sweep is "
            "fast: log fewer messages (LOG_BITMASK), or with a larger buffer (LOG_FILE_BUFSIZE)"
        )
    fastest = max(one.high for one in log.used) if log.used else 0.0
    if fastest > PASSBAND * math.pi * rate:
        yield (
            f"{log.path}: sweeps go up to {fastest:.3g} rad/s, and its messages, {rate:.4g} Hz, "
            f"show {PASSBAND * math.pi * rate:.3g} rad/s; set LOG_BITMASK's bits 0 and 1 to log "
            "every loop"
        )
    cutoff = log.parameters.get("INS_GYRO_FILTER", 0.0)
    filtered = [one for one in log.channels if one.column.column.startswith(("RATE.", "IMU."))]
    behind = [one.name for one in filtered if one.name in ("p", "q", "r")]
    if behind and cutoff > 0.0:
        yield (
            f"{', '.join(behind)} are behind the gyro's filter, INS_GYRO_FILTER {cutoff:g} Hz of "
            f"second order, which delays by {1e3 * math.sqrt(2.0) / (2.0 * math.pi * cutoff):.2g} "
            f"ms; take it out by --known {','.join(behind)}=low_pass:corner="
            f"{2.0 * math.pi * cutoff:.4g},order=2"
        )
    arm = [log.parameters.get(f"INS_POS1_{axis}", 0.0) for axis in "XYZ"]
    if any(arm) and any(one.name == "az" for one in log.channels):
        yield (
            f"the accelerometer sits at {arm[0]:g}, {arm[1]:g}, {arm[2]:g} m (INS_POS1): its "
            "acceleration isn't moved to the centre of gravity"
        )


def _of_fits(logs: "Sequence[InferredLog]", fits: Sequence[InferredFit]) -> Iterator[str]:
    if not all(log.helicopter for log in logs):
        yield (
            "not a helicopter with one main rotor (FRAME_CLASS isn't 6): transfer functions are "
            "fitted in place of a helicopter's structures"
        )
        return
    alone = {name for fit in fits if fit.structure == "tf:0/2" for name in fit.inputs}
    for name in sorted(alone & set(_CONTROLS)):
        other = _CONTROLS["lon" if name == "lat" else "lat"]
        yield (
            f"{other} wasn't swept, so its controller's answer to {_CONTROLS[name]} is part of "
            f"what is identified; sweep {other} too (SID_AXIS {'11' if other == 'pitch' else '10'})"
        )
