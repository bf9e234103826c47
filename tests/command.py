"""The command line, run within a test, and Python in a process of its own."""

import subprocess
import sys

from helisim.cli import main


def python(code, *arguments, **options):
    """Run code in a fresh process, which must succeed; return what it printed."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def fails(capsys, *arguments):
    """Run a command that must fail on its input; return the one line that it prints."""
    try:
        status = main(list(map(str, arguments)))
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    assert status == 2, captured
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    assert "Traceback" not in captured.err
    return lines[0]
