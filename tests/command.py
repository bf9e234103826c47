"""The command line, run within a test, Python in a process of its own, and what a test reads."""

import subprocess
import sys
from pathlib import Path
from shlex import quote

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


def said(finding):
    """Return a finding's remedy, such as "--repair gaps"."""
    words = [f"--{one.name.replace('_', '-')} {quote(one.value)}" for one in finding.remedy]
    return " ".join(words).strip()


def parm_file(path: Path) -> dict[str, float]:
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines if line and not line.startswith("#")]
    return {name: float(value) for name, value in rows}
