"""The reader of DataFlash logs against pymavlink, ArduPilot's own: the same numbers."""

import array
import subprocess
import sys
import time

import numpy as np
import pytest

from dataflash_logs import LETTERS, Log
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
    for number, some in enumerate((letters[:9], letters[9:], "aBa"), start=1):
        labels = ",".join(["TimeUS", *(f"F{k}{letter}" for k, letter in enumerate(some))])
        log.define(number, f"T{number}", "Q" + some, labels)
        for k in range(count):
            log.write(number, 1000 * k, *(x for one in some for x in _values(one, random)))
    log.define(4, "GYR", "QBff", "TimeUS,I,X,Y", units="s#kE", multipliers="F-00")
    log.define(5, "NVF", "QNf", "TimeUS,Name,V", units="s#v", multipliers="F-0")
    for k in range(count):
        log.write(4, 1000 * k + 1, k % 3, 0.125 * k, -k)
        log.write(5, 1000 * k + 2, (b"alpha", b"beta")[k % 2], k)
    return log


def _values(letter, random):
    form = LETTERS[letter]
    if letter == "a":
        return random.integers(-(2**15), 2**15, 32).tolist()
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


def same_as_reference(log, reference, unscaled=()):
    """Assert that all columns of all types and instances are the reference's."""
    assert set(log.types) == set(reference)
    for name, (columns, instance_field, rows) in reference.items():
        assert log.count(name) == len(rows)
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
                elif isinstance(values[0], array.array):
                    assert np.array_equal(table[column], np.array(values))
                elif (name, column) not in unscaled:
                    assert np.array_equal(table[column], np.array(values, np.float64))


def test_every_letter_of_the_format_is_read_as_the_reference_does(tmp_path):
    """Numbers of all sizes, scaled ones, words, arrays, several instances: bit for bit."""
    path = every_letter().save(tmp_path)
    # the reference takes M for signed; ArduPilot's description says uint8
    mode = [(f"T{k}", f"F{n}M") for k in (1, 2) for n in range(15)]
    multipliers = [("MULT", "Mult")]
    same_as_reference(DataFlash(path), rows_of(path), unscaled=(*mode, *multipliers))


def test_instances_are_numbers_or_words(tmp_path):
    """As pymavlink's `#`: the type's field that says of what a message is."""
    log = DataFlash(every_letter().save(tmp_path))
    assert log.instances("GYR") == (0, 1, 2)
    assert log.instances("NVF") == ("alpha", "beta")
    assert np.array_equal(log.table("NVF", "beta")["V"], np.arange(1, 40, 2))
    names = read_log(tmp_path / "a.bin", channels={"p": "GYR[1].X"}).report.unused
    assert {"GYR[2].X", "GYR.Y", "NVF[alpha].V"} <= set(names)


def test_text_is_refused(tmp_path):
    """A ground station's text of a log: the message says what to give."""
    path = tmp_path / "a.log"
    path.write_text("FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nGYR, 5, 1.0\n")
    for read in (DataFlash, read_log):
        with pytest.raises(StorageError, match=r"as text.*\.bin") as caught:
            read(path)
        assert str(path) in str(caught.value)


LARGE = """
import numpy as np, sys, time
from pathlib import Path
from helisim.logs.dataflash import DataFlash
def peak():  # this process's own; getrusage's begins with that of the one that started it
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(one.split()[1]) for one in lines if one.startswith("VmHWM"))
before = peak()
began = time.process_time()
log = DataFlash(sys.argv[1])
values = [log.table("RATE")[f"C{k}"].sum() for k in range(6)]
took = time.process_time() - began
print(peak() - before, took, *values)
"""


@pytest.mark.slow
def test_a_large_log_takes_a_small_part_of_the_references_time_and_memory(tmp_path):
    """30 MB: less than its size in memory, and a twentieth of the reference's time at most.

    A few megabytes of it are held at a time, where the reference makes an object of each message.
    """
    log = Log()
    labels = [f"C{k}" for k in range(13)]
    log.define(1, "RATE", "Q" + "f" * 13, ",".join(["TimeUS", *labels]))
    count = 480_000
    rows = np.zeros(count, [("head", "u1", 3), ("time", "<u8"), ("values", "<f4", 13)])
    rows["head"] = (0xA3, 0x95, 1)
    rows["time"] = 2500 * np.arange(count)
    rows["values"] = np.random.default_rng(0).normal(size=(count, 13))
    path = tmp_path / "large.bin"
    path.write_bytes(log.data + rows.tobytes())
    size = path.stat().st_size
    command = [sys.executable, "-c", LARGE, str(path)]
    found = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    kilobytes, took, *sums = map(float, found)
    assert sums == pytest.approx(rows["values"][:, :6].sum(axis=0, dtype=np.float64))
    assert 1024.0 * kilobytes < size
    part = tmp_path / "part.bin"
    part.write_bytes(log.data + rows[: count // 20].tobytes())
    began = time.process_time()
    assert len(rows_of(part)["RATE"][2]) == count // 20
    assert 20.0 * took < 20.0 * (time.process_time() - began)
