"""DataFlash logs, written byte by byte by the description of ArduPilot's AP_Logger."""

import struct

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
        """Write a type's FMT message, and FMTU if it has units."""
        form = "".join(LETTERS.get(letter, "") for letter in letters)
        length = struct.calcsize("<" + form) + 3 if length is None else length
        self.write(128, number, length, name.encode(), letters.encode(), labels.encode())
        self._forms[number] = form
        if units and self._with_units:
            self.write(253, 0, number, units.encode(), multipliers.encode())

    def write(self, number, *values):
        """Write a message."""
        self.messages.append(
            struct.pack("<BBB", 0xA3, 0x95, number)
            + struct.pack("<" + self._forms[number], *values)
        )

    @property
    def data(self):
        """The log's bytes."""
        return b"".join(self.messages)

    def save(self, folder, name="a.bin"):
        """Write the log to a file, and return its path."""
        path = folder / name
        path.write_bytes(self.data)
        return path
