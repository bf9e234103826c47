"""Logs of PX4 and ArduPilot, written byte by byte by the descriptions of their formats.

ULog: PX4 user guide, "ULog file format". DataFlash: ArduPilot, `AP_Logger`'s FMT message.
"""

import struct

import numpy as np

from dataflash_logs import Log


def ulog(topics):
    """Return a ULog.

    Args:
        topics: name -> (stamps in us, {field: columns (n_time,) or (n_time, n)}).
    """

    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    data = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    tables = {}
    for name, (stamps, fields) in topics.items():
        parts = ["uint64_t timestamp"]
        for field, values in fields.items():
            size = f"[{values.shape[1]}]" if np.ndim(values) == 2 else ""
            parts.append(f"float{size} {field}")
        data.append(message("F", f"{name}:{';'.join(parts)};".encode()))
        columns = np.column_stack([np.asarray(values) for values in fields.values()])
        tables[name] = np.asarray(stamps, dtype=np.int64), columns.astype(np.float32)
    for number, name in enumerate(tables):
        data.append(message("A", struct.pack("<BH", 0, number) + name.encode()))
    rows = []
    for number, (stamps, columns) in enumerate(tables.values()):
        layout = f"<HQ{columns.shape[1]}f"
        rows += [
            (stamp, message("D", struct.pack(layout, number, stamp, *row)))
            for stamp, row in zip(stamps.tolist(), columns.tolist())
        ]
    return b"".join(data + [row for _, row in sorted(rows, key=lambda one: one[0])])


def dataflash(messages):
    """Return a DataFlash log that states no units.

    Args:
        messages: name -> (stamps in us, {field: (n_time,)}); fields called C... are uint16.
    """
    log, rows = Log(with_units=False), []
    for kind, (name, (stamps, fields)) in enumerate(messages.items(), start=1):
        whole = [field.startswith("C") for field in fields]
        letters = "".join("H" if one else "f" for one in whole)
        log.define(kind, name, f"Q{letters}", ",".join(("TimeUS", *fields)))
        for stamp, *row in zip(np.asarray(stamps, dtype=np.int64).tolist(), *fields.values()):
            numbers = [round(float(x)) if one else float(x) for x, one in zip(row, whole)]
            rows.append((stamp, kind, numbers))
    for stamp, kind, numbers in sorted(rows, key=lambda one: one[0]):
        log.write(kind, stamp, *numbers)
    return log.data
