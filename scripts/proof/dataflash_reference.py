"""Every number that `helisim.DataFlash` reads of a log, beside ArduPilot's own reader, pymavlink.

Printed are how many messages both find, how many columns agree bit for bit, and those that differ
by the multiplier that the log states, which pymavlink leaves out. Needs gigabytes for a log of
100 MB: the reference makes an object of each message.

    python scripts/proof/dataflash_reference.py flight.bin
"""

import array
import math
import sys
from typing import Any

import numpy as np

import helisim as hs


def reference(path: str) -> dict[str, tuple[list[str], str | None, list[list[Any]]]]:
    """Return type of message -> fields, the one of the instance, and a row each message."""
    from pymavlink import DFReader

    reader = DFReader.DFReader_binary(path)
    rows: dict[str, list[list[Any]]] = {}
    while (message := reader.recv_msg()) is not None:
        values = [getattr(message, field) for field in message.fmt.columns]
        rows.setdefault(message.get_type(), []).append(values)
    known = {one.name: one for one in reader.formats.values()}
    return {
        name: (known[name].columns, known[name].instance_field, of) for name, of in rows.items()
    }


def ratio(ours: Any, theirs: list[Any]) -> float:
    """Return our numbers over theirs, 1 where they are the same, NaN where there is no such."""
    if isinstance(theirs[0], bytes | array.array | str):
        return 1.0 if [str(one) for one in ours] == [str(one) for one in theirs] else math.nan
    numbers = np.array(theirs, np.float64)
    if np.array_equal(ours, numbers, equal_nan=True):
        return 1.0
    moving = numbers != 0.0
    factor = float(np.median(ours[moving] / numbers[moving]))
    return factor if np.allclose(ours, factor * numbers, rtol=1e-12, equal_nan=True) else math.nan


def main(path: str) -> None:
    """Compare, and print what was found."""
    log, theirs = hs.DataFlash(path), reference(path)
    same, scaled, other = 0, [], []
    for name, (fields, instance, rows) in theirs.items():
        for one in log.instances(name):
            kept = (
                rows if instance is None else [r for r in rows if r[fields.index(instance)] == one]
            )
            table = log.table(name, one)
            for field, values in zip(fields, zip(*kept)):
                ours = 1e6 * table.time if field == "TimeUS" else table[field]
                found = ratio(np.rint(ours) if field == "TimeUS" else ours, list(values))
                same += found == 1.0
                label = f"{name}.{field}"
                if math.isnan(found):
                    other.append(label)
                elif found != 1.0:
                    scaled.append(f"{label} {found:.4g}")
    print(f"messages: {sum(map(log.count, log.types))}, of the reference")
    print(f"          {sum(len(rows) for _, _, rows in theirs.values())}")
    print(f"columns:  {same} the same, bit for bit")
    print(f"          {len(scaled)} by the log's multiplier: {', '.join(dict.fromkeys(scaled))}")
    print(f"          {len(other)} different: {', '.join(dict.fromkeys(other)) or 'none'}")


if __name__ == "__main__":
    main(sys.argv[1])
