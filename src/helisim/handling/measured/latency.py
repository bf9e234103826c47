"""By how much each channel of a record is late, as far as the record says so."""

from collections.abc import Mapping, Sequence

from helisim.records.record import FlightRecord


def latencies(records: Sequence[FlightRecord]) -> dict[str, float]:
    """Return channel -> s of what simulations say of their recorder; others say nothing.

    What is added at an actuator is as late as the command that it is added to.
    """
    found: dict[str, float] = {}
    for record in records:
        recorder = record.provenance.get("recorder")
        late = recorder.get("latency") if isinstance(recorder, Mapping) else None
        for name, delay in late.items() if isinstance(late, Mapping) else ():
            if isinstance(delay, int | float):
                found[str(name)] = float(delay)
    for name in [name for name in found if name in ("col", "lon", "lat", "ped")]:
        found |= {f"{name}_disturbance": found[name], f"{name}_sum": found[name]}
    return found
