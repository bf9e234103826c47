"""Every mistake on the command line is one line that says what to do, with status 2, and no file.

`refusals.txt` beside this file has a command line and what is said of it, parts apart by dots.
"""

import io
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from closed_loops import flown, known_loop
from command import fails
from helisim import ident
from helisim.cli import _COMMANDS, command_names, main
from helisim.cli.options import coloured, progress, wrapped
from helisim.records.storage import write_record
from ident_data import found
from swept_logs import BAD, csv_writer

CASES = Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8").splitlines()
HEADS = {"stick.csv": "t [s],stick [1],w [m/s]", "unitless.csv": "t [s],col,w [m/s]"}
LAWS = "def yaw(seen):\n    return seen.PED\n\nnumber = 3\n"
FILES = {"laws_of_the_folder.py": LAWS, "file": "", "map.toml": "", "bad.toml": "[vari]"}
FILES["good.toml"] = '[campaign]\nmodels = ["heave"]\nflights = 2\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("refused")
    for name, text in FILES.items():
        (path / name).write_text(text)
    (path / "none").mkdir()
    write = csv_writer(path)
    for name in ("sweep.csv", "log.csv"):
        write(name=name)
    for name, change in BAD.items():
        write(change, name=f"{name}.csv")
    for name, header in HEADS.items():
        write(header=header, name=name)
    found(ident.structures.yaw_base, N_r=-2.0, N_ped=60.0, tau_r_base=0.05).save(path / "yaw.json")
    write_record(flown(known_loop(), seed=3, noise=0.02), path / "loop.parquet")
    return path


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_one_line(folder, monkeypatch, capsys, case):
    monkeypatch.chdir(folder)
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "HELISIM_ARDUPILOT"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delitem(sys.modules, "laws_of_the_folder", raising=False)
    before = sorted(folder.iterdir())
    command, _, said = case.rpartition("=> ")
    message = fails(capsys, *shlex.split(command))
    for text in said.split(" ... "):
        assert text in message
    made = {"__pycache__", "reproduction"}  # the latter by a run that fails in its first flight
    assert [one for one in sorted(folder.iterdir()) if one.name not in made] == [
        one for one in before if one.name not in made
    ]


def test_too_large_a_task_is_one_line(monkeypatch, capsys):
    def allocate(*_, **__):
        raise MemoryError("Unable to allocate 1 TiB")

    monkeypatch.setattr("helisim.vehicle.load", allocate)
    said = fails(capsys, "vehicle", "linearize")
    assert said == "helisim vehicle linearize: too much for this machine: Unable to allocate 1 TiB"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("command", ["", *_COMMANDS])
def test_help_fits_60_lines_of_80_columns(capsys, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main([*filter(None, command.split("_")), "--help"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 60
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize("words", [[], ["vehicle"], ["study"], ["ardupilot"]])
def test_a_command_without_its_rest_prints_its_help(capsys, words):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 0
    assert capsys.readouterr().out.startswith(" ".join(["usage: helisim", *words]))


def test_the_help_has_every_command_by_its_task(capsys):
    with pytest.raises(SystemExit):
        main([])
    lines = capsys.readouterr().out.splitlines()
    assert sorted(name for name in command_names() if any(f"  {name} " in x for x in lines)) == (
        command_names()
    )


@pytest.mark.parametrize("command", ["structures", "vehicle linearize", "study errata"])
def test_lists_fit_80_columns(capsys, command):
    assert main(command.split()) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert "\x1b" not in out


def test_long_lines_are_wrapped_and_short_ones_left_alone():
    table = "  a      b\n  1.0    2.0"
    assert wrapped(table) == table
    path = "/long" * 30
    assert wrapped(f"{path}: {'word ' * 20}", indent=2).splitlines()[0] == f"{path}:"
    assert all(line.startswith("  ") for line in wrapped("word " * 40, indent=2).splitlines()[1:])


def test_poor_and_differs_are_red_on_a_terminal_alone(monkeypatch):
    row = "N_r  1/s  -0.75  poor  differs"
    assert coloured(row) == row
    monkeypatch.setattr(sys, "stdout", Terminal())
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert coloured(row).count("\x1b[31m") == 2
    assert re.sub(r"\x1b\[\d+m", "", coloured(row)) == row
    monkeypatch.setenv("NO_COLOR", "1")
    assert coloured(row) == row


def test_progress_has_rate_and_remaining_time_on_a_terminal(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress(2, quiet=False) as advance:
        list(map(advance, ("lat", "lon")))
    shown = terminal.getvalue().split("\r")
    (bar,) = (text for text in shown if text.startswith("lon:") and " 1/2 " in text)
    assert re.search(r"\[\d\d:\d\d<\d\d:\d\d, .*(step/s|s/step)\]", bar)  # elapsed<remaining
    assert shown[-2].strip() == ""


@pytest.mark.parametrize(("stream", "quiet"), [(io.StringIO(), False), (Terminal(), True)])
def test_progress_is_silent_elsewhere(monkeypatch, stream, quiet):
    monkeypatch.setattr(sys, "stderr", stream)
    with progress(1, quiet=quiet) as advance:
        advance("lat")
    assert stream.getvalue() == ""


def test_quiet_says_nothing_of_what_is_written(tmp_path, capsys):
    out, recording = str(tmp_path / "a.csv"), str(tmp_path / "a.rrd")
    arguments = ["--axis", "lat", "--duration", "13", "--out", out, "--rerun", recording]
    assert main(["fly", *arguments, "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.out + captured.err == ""
    assert main(["fly", *arguments]) == 0
    assert capsys.readouterr().out.count("Written: ") == 2


def test_a_reader_that_stops_early_is_no_error():
    """As in `helisim structures | head -1`: no traceback, the status that shells give for it."""
    command = [sys.executable, "-m", "helisim", "structures"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        complaint = process.stderr.read()
    assert complaint == b""
    assert process.returncode == 141  # 128 + SIGPIPE
