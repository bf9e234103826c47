import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LINT = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"


def test_data_flows_one_way():
    """The import contracts of pyproject.toml hold: layers, and an identification that is blind."""
    check = subprocess.run(
        [sys.executable, "-c", LINT], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert check.returncode == 0, check.stdout + check.stderr
    assert "2 kept, 0 broken" in check.stdout


def test_importing_does_nothing():
    """`import helisim` starts no thread, prints nothing, and installs no MuJoCo callback."""
    code = (
        "import threading, helisim, mujoco\n"
        "getters = [n for n in dir(mujoco) if n.startswith('get_mjcb_')]\n"
        "assert getters\n"
        "assert not [n for n in getters if getattr(mujoco, n)() is not None]\n"
        "assert threading.active_count() == 1\n"
    )
    check = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert check.returncode == 0, check.stderr
    assert check.stdout == ""
