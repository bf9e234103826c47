"""Whatever stands behind an option, a command ends with a status and at most one line of error."""

import contextlib
import io
import os
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helisim.cli import main
from helisim.records.record import FlightRecord, channel
from helisim.records.storage import write_record
from tabled import rows

ANY = st.one_of(
    st.text(max_size=8),
    st.floats().map(repr),
    st.integers(-3, 10**12).map(str),
    st.sampled_from(
        ["", "p", "lat", "p,q", "lat=p:deg/s", "=", ":", "a=b=c", "p/lat", "p/p", "t:s", "time"]
    ),
    st.sampled_from(["nan", "inf", "-inf", "1e-300", "1e300", "0", "-1", "٣", "ü" * 300, "../x"]),
    st.sampled_from(["tf:1/1", "tf:9/1", "tf:1/99", "heave", "yaw_base", "duplicates,resets"]),
)
READING = ("--channel", "--time", "--resample", "--repair", "--max-gap")
READING += ("--min-duration", "--from", "--to", "--map", "--reference", "--conditioning")
OPTIONS = dict(rows(globals(), "OPTIONS"))
LOGS = ("frf", "identify", "margins")
SOUND = dict(rows(globals(), "SOUND"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("Messung ü")
    random = np.random.default_rng(1)
    stick = random.normal(size=1500)
    rate = np.convolve(stick, np.exp(-np.arange(60) / 10.0))[:1500]
    columns = np.column_stack([stick, rate])
    record = FlightRecord(0.02 * np.arange(1500), columns, (channel("lat"), channel("p")))
    write_record(record, path / "r.parquet")
    return path


def outcome(arguments):
    stderr = io.StringIO()
    with contextlib.redirect_stderr(stderr), contextlib.redirect_stdout(io.StringIO()):
        try:
            status = main(arguments)
        except SystemExit as exit_:  # argparse's own, with its one line and status 2
            status = exit_.code
    said = [line for line in stderr.getvalue().split("\n") if line]
    return status, [line for line in said if "compiling the force laws" not in line]


@pytest.mark.parametrize("command", OPTIONS)
@given(data=st.data())
@settings(max_examples=20)
def test_any_text_behind_any_option_is_an_answer_or_one_line(folder, command, data):
    """Status 0, 1 or, as a storm may end a flight, 3; or 2 and one line: no other exception."""
    given_ = []
    for option in data.draw(st.lists(st.sampled_from(OPTIONS[command]), min_size=1, max_size=2)):
        given_ += [text for text in (option, data.draw(ANY)) if text or option]
    place = [str(folder / "r.parquet")] if command in LOGS else []
    sound = [*SOUND[command], *([str(folder / "out.csv")] if command == "fly" else [])]
    before = sorted(folder.iterdir())
    status, lines = outcome([*command.split(), *place, *sound, *given_])
    assert status in ((0, 1, 2, 3) if command == "fly" else (0, 1, 2)), given_
    if status == 2:
        # of logs every fault is told at once, a line each below the first
        assert len(lines) == 1 or "things are wrong with the logs" in lines[0], lines
        assert lines[0].startswith("helisim"), lines
        assert sorted(folder.iterdir()) == before
    (folder / "out.csv").unlink(missing_ok=True)


_written: list[str] = []
_watching = False
_WRITE = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def _note(event, arguments):
    if not _watching:
        return
    if event == "open":
        path, mode, flags = arguments
        if not isinstance(path, int) and ((flags or 0) & _WRITE or set(mode or "") & set("wax+")):
            _written.append(os.fsdecode(path))
    elif event in ("os.mkdir", "os.rename", "os.link", "os.symlink", "os.remove", "os.rmdir"):
        _written.extend(os.fsdecode(one) for one in arguments[:2] if isinstance(one, str | Path))


@pytest.mark.slow
def test_nothing_is_written_outside_the_folder_that_is_named(tmp_path, monkeypatch):
    """Python's own audit tells every file that a flight and what follows it open to write."""
    global _watching
    out, home = tmp_path / "out", tmp_path / "home"
    for path in (out, home):
        path.mkdir()
    matplotlib.get_configdir(), matplotlib.get_cachedir()  # made where they are first asked for
    monkeypatch.chdir(home)
    monkeypatch.setenv("TMPDIR", str(home))
    monkeypatch.setenv("HOME", str(home))
    record, model = str(out / "lat.parquet"), str(out / "m.json")
    flight = ["fly", "--axis", "lat", "--duration", "20", "--quiet", "--out", record]
    commands = [
        [*flight, "--rerun", str(out / "lat.rrd")],
        [*flight[:-1], str(out / "lat.csv")],
        ["frf", record, "--inputs", "lat", "--outputs", "p", "--json", str(out / "f.json")],
        ["identify", record, "--structure", "tf:0/1", "--inputs", "lat", "--outputs", "p"],
        ["vehicle", "linearize", "--json"],
        ["structures", "heave"],
    ]
    commands[3] += ["--json", model]
    sys.addaudithook(_note)
    for arguments in commands:
        _watching = True
        try:
            status, lines = outcome(arguments)
        finally:
            _watching = False
        assert status in (0, 1), lines
    assert len(list(out.iterdir())) == 5
    assert len(_written) >= 7
    cached = ("__pycache__", ".numba", "numba_cache", os.devnull)
    for path in _written:
        inside = os.path.realpath(path).startswith(os.path.realpath(out))
        assert inside or any(part in path for part in cached), path
    assert list(home.iterdir()) == []


# The command line on logs of others: a mistake is one line, other units give the same model.
