"""Logs of PX4 and ArduPilot, written byte by byte by the descriptions of their formats; tables.

ULog: PX4 user guide, "ULog file format". DataFlash: ArduPilot, `AP_Logger`.
"""

import struct

import numpy as np

LETTERS = {
    "a": "32h", "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d",
    "g": "e", "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i",
    "M": "B", "q": "q", "Q": "Q",
}  # fmt: skip
UNITS = {"s": "s", "d": "deg", "k": "deg/s", "#": "instance", "Y": "us", "v": "V", "-": ""}
MULTIPLIERS = {"-": 0.0, "0": 1.0, "B": 1e-2, "C": 1e-3, "F": 1e-6, "!": 3.6}


class Log:
    """A log that grows by messages."""

    def __init__(self, *, with_units=True):
        self.messages = []
        self._forms = {128: "BB4s16s64s"}
        self._with_units = with_units
        self.define(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
        if with_units:
            self.define(251, "UNIT", "QbZ", "TimeUS,Id,Label")
            self.define(252, "MULT", "Qbd", "TimeUS,Id,Mult")
            self.define(253, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
            for letter, unit in UNITS.items():
                self.write(251, 0, ord(letter), unit.encode())
            for letter, factor in MULTIPLIERS.items():
                single = struct.unpack("<f", struct.pack("<f", factor))[0]
                self.write(252, 0, ord(letter), single)

    def define(self, number, name, letters, labels, *, units="", multipliers="", length=None):
        form = "".join(LETTERS.get(letter, "") for letter in letters)
        length = struct.calcsize("<" + form) + 3 if length is None else length
        self.write(128, number, length, name.encode(), letters.encode(), labels.encode())
        self._forms[number] = form
        if units and self._with_units:
            self.write(253, 0, number, units.encode(), multipliers.encode())

    def write(self, number, *values):
        self.messages.append(
            struct.pack("<BBB", 0xA3, 0x95, number)
            + struct.pack("<" + self._forms[number], *values)
        )

    @property
    def data(self):
        return b"".join(self.messages)

    def save(self, folder, name="a.bin"):
        path = folder / name
        path.write_bytes(self.data)
        return path


def flipped(data, share, seed):
    """Return bytes of which a share is random."""
    random, data = np.random.default_rng(seed), np.frombuffer(data, np.uint8).copy()
    hit = random.random(data.size) < share
    data[hit] = random.integers(0, 256, np.count_nonzero(hit), np.uint8)
    return data.tobytes()


def ulog(topics, dropouts=()):
    """Return a ULog of topics: name -> (stamps in us, {field: (n_time,) or (n_time, n)}).

    "gyro[1]" is the second instance of gyro; `dropouts` are in ms.
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
        data.append(message("F", f"{name.partition('[')[0]}:{';'.join(parts)};".encode()))
        columns = np.column_stack([np.asarray(values) for values in fields.values()])
        tables[name] = np.asarray(stamps, dtype=np.int64), columns.astype(np.float32)
    for number, name in enumerate(tables):
        bare, _, instance = name.rstrip("]").partition("[")
        data.append(message("A", struct.pack("<BH", int(instance or 0), number) + bare.encode()))
    data += [message("O", struct.pack("<H", lasts)) for lasts in dropouts]
    rows = []
    for number, (stamps, columns) in enumerate(tables.values()):
        layout = f"<HQ{columns.shape[1]}f"
        rows += [
            (stamp, message("D", struct.pack(layout, number, stamp, *row)))
            for stamp, row in zip(stamps.tolist(), columns.tolist())
        ]
    return b"".join(data + [row for _, row in sorted(rows, key=lambda one: one[0])])


def dataflash(messages):
    """Return a DataFlash log without units of messages: name -> (stamps in us, {field: (n_time,)}).

    Fields called C... are uint16.
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


def table(path, *columns, header="t [s],p"):
    rows = [",".join(repr(float(cell)) for cell in row) for row in zip(*columns)]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path
