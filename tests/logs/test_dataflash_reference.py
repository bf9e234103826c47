"""The reader of DataFlash logs against pymavlink, ArduPilot's own: the same numbers."""

import numpy as np
import pytest

from autopilot_logs import LETTERS, Log
from helisim.base.errors import StorageError
from helisim.logs import read_log
from helisim.logs.dataflash import DataFlash

DFReader = pytest.importorskip(
    "pymavlink.DFReader", reason="pymavlink isn't installed: pip install helisim[sitl]"
)


def every_letter(count=40):
    """Return a log with each letter of the format, random numbers and words in each."""
    random = np.random.default_rng(7)
    log = Log()
    letters = "".join(letter for letter in LETTERS if letter not in "aQ")
    for number, some in enumerate((letters[:9], letters[9:]), start=1):
        labels = ",".join(["TimeUS", *(f"F{k}{letter}" for k, letter in enumerate(some))])
        log.define(number, f"T{number}", "Q" + some, labels)
        for k in range(count):
            log.write(number, 1000 * k, *(x for one in some for x in _values(one, random)))
    log.define(4, "GYR", "QBff", "TimeUS,I,X,Y", units="s#kE", multipliers="F-00")
    for k in range(count):
        log.write(4, 1000 * k + 1, k % 3, 0.125 * k, -k)
    return log


def _values(letter, random):
    form = LETTERS[letter]
    if form.endswith("s"):
        size = int(random.integers(0, int(form[:-1]) + 1))
        return [bytes(random.integers(97, 123, size, np.uint8))]
    if form in "fde":
        return [float(np.float16(random.normal() * 100.0))]
    info = np.iinfo(np.dtype(form))
    return [int(random.integers(info.min, info.max, dtype=info.dtype, endpoint=True))]


def rows_of(path):
    """Return what pymavlink reads: type -> (columns, instance's column, rows)."""
    reader = DFReader.DFReader_binary(str(path))
    found = {}
    while (message := reader.recv_msg()) is not None:
        columns = message.fmt.columns
        found.setdefault(message.get_type(), []).append([getattr(message, c) for c in columns])
    formats = {one.name: one for one in reader.formats.values()}
    reader.close()
    return {
        name: (formats[name].columns, formats[name].instance_field, rows)
        for name, rows in found.items()
    }


def same_as_reference(log, reference):
    """Assert that all columns of all types and instances are the reference's."""
    assert set(log.types) == set(reference)
    for name, (columns, instance_field, rows) in reference.items():
        for instance in log.instances(name):
            where = columns.index(instance_field) if instance_field else None
            kept = [row for row in rows if where is None or row[where] == instance]
            table = log.table(name, instance)
            assert len(table) == len(kept) > 0
            for column, values in zip(columns, zip(*kept)):
                if column == "TimeUS":
                    assert table.time == pytest.approx(1e-6 * np.array(values), abs=1e-10)
                elif isinstance(values[0], str):
                    assert list(table[column]) == list(values)
                elif (name, column) != ("MULT", "Mult"):
                    # the reference takes M for signed; ArduPilot's description says uint8
                    values = np.array(values) % 256 if column.endswith("M") else values
                    assert np.array_equal(table[column], np.array(values, np.float64))


def test_every_letter_of_the_format_is_read_as_the_reference_does(tmp_path):
    """Numbers of all sizes, scaled ones, words, arrays, several instances: bit for bit."""
    path = every_letter().save(tmp_path)
    same_as_reference(DataFlash(path), rows_of(path))


def test_text_is_refused(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nGYR, 5, 1.0\n")
    for read in (DataFlash, read_log):
        with pytest.raises(StorageError, match=r"as text.*\.bin") as caught:
            read(path)
        assert str(path) in str(caught.value)
