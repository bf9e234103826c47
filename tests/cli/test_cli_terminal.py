"""What the commands look like on a terminal, and what happens when nobody looks."""

import io
import re
import subprocess
import sys

import pytest

from helisim.cli import command_names, main
from helisim.cli.options import Progress, wrapped


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("command", ["", *command_names()])
def test_help_fits_80_columns(capsys, monkeypatch, command):
    """Descriptions are wrapped, examples are short enough."""
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main([*([command] if command else []), "--help"])
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


@pytest.mark.parametrize("command", ["structures", "linearize", "errata"])
def test_lists_fit_80_columns(capsys, command):
    """What a command prints for people is no wider than a terminal, and without colours."""
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
    """The bar says what is done, how fast, and how long it will take; at the end it is gone."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with Progress(2, quiet=False) as advance:
        advance("lat")
        advance("lon")
    shown = terminal.getvalue().split("\r")
    (bar,) = (text for text in shown if text.startswith("lon:") and " 1/2 " in text)
    assert re.search(r"\[\d\d:\d\d<\d\d:\d\d, .*(step/s|s/step)\]", bar)  # elapsed<remaining
    assert shown[-2].strip() == ""


@pytest.mark.parametrize(("stream", "quiet"), [(io.StringIO(), False), (Terminal(), True)])
def test_progress_is_silent_elsewhere(monkeypatch, stream, quiet):
    """Not on a terminal, or asked to be quiet, nothing is printed."""
    monkeypatch.setattr(sys, "stderr", stream)
    with Progress(1, quiet=quiet) as advance:
        advance("lat")
    assert stream.getvalue() == ""


def test_quiet_says_nothing_of_what_is_written(tmp_path, capsys):
    """With --quiet a command that only writes prints nothing."""
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


def test_a_log_file_is_told_how_far_a_long_command_is(monkeypatch):
    """After three seconds a line, then one every ten; quicker commands say nothing."""
    stream, clock = io.StringIO(), [0.0]
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("helisim.cli.options.time.monotonic", lambda: clock[0])
    with Progress(20, quiet=False) as advance:
        for _ in range(20):
            clock[0] += 1.0
            advance("lat")
    assert stream.getvalue().splitlines() == ["lat: step 3 of 20, 3 s", "lat: step 13 of 20, 13 s"]


def test_steps_that_nobody_can_count_are_counted(monkeypatch):
    """A search says how many trials it has made, and not of how many."""
    stream, clock = io.StringIO(), [0.0]
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("helisim.cli.options.time.monotonic", lambda: clock[0])
    with Progress(None, quiet=False, unit="trial") as advance:
        clock[0] = 4.0
        advance("yaw")
    assert stream.getvalue() == "yaw: trial 1, 4 s\n"


HEAVY = ("scipy", "matplotlib", "mujoco", "numba", "pyarrow", "rerun", "control", "pandas")


@pytest.mark.parametrize("words", [["--version"], *([name, "--help"] for name in command_names())])
def test_a_word_about_itself_imports_no_heavy_library(words):
    """`helisim --version` and each command's --help need only the parser."""
    code = (
        "import sys\nfrom helisim.cli import main\n"
        f"try:\n    main({words!r})\nexcept SystemExit as end:\n    assert end.code == 0\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


def test_a_command_imports_no_other():
    """Only the module of the command that was asked for is loaded."""
    code = (
        "import sys\nfrom helisim.cli import main\n"
        "try:\n    main(['errata', '--help'])\nexcept SystemExit:\n    pass\n"
        "print(*sorted(n for n in sys.modules if n.startswith('helisim.cli.')), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names = ("options", "study")
    assert done.stderr.split() == [f"helisim.cli.{name}" for name in names]


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_every_command(capsys, shell):
    """The script that a shell reads names all commands."""
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in command_names())
