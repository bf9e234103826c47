"""What the commands look like on a terminal, and what happens when nobody looks."""

import io
import re
import subprocess
import sys

import pytest

from helisim.cli import command_names, main
from helisim.cli.options import progress, wrapped


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("command", ["", *command_names()])
def test_help_fits_80_columns(capsys, monkeypatch, command):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main([*([command] if command else []), "--help"])
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


@pytest.mark.parametrize("command", ["structures", "linearize", "errata"])
def test_lists_fit_80_columns(capsys, command):
    assert main([command]) == 0
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert "\x1b" not in out


def test_long_lines_are_wrapped_and_short_ones_left_alone():
    """A table's spaces stay; a path that is longer than a line stays whole."""
    table = "  a      b\n  1.0    2.0"
    assert wrapped(table) == table
    path = "/long" * 30
    assert wrapped(f"{path}: {'word ' * 20}", indent=2).splitlines()[0] == f"{path}:"
    assert all(line.startswith("  ") for line in wrapped("word " * 40, indent=2).splitlines()[1:])


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


HEAVY = ("scipy", "matplotlib", "mujoco", "numba", "pyarrow", "rerun", "control", "pandas")


@pytest.mark.parametrize("words", [["--version"], ["fly", "--help"], ["identify", "--help"]])
def test_a_word_about_itself_imports_no_heavy_library(words):
    code = (
        "import sys\nfrom helisim.cli import main\n"
        f"try:\n    main({words!r})\nexcept SystemExit as end:\n    assert end.code == 0\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"
