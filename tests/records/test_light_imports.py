"""What reads no file, resamples nothing and draws nothing loads nothing heavy."""

import subprocess
import sys

import pytest

HEAVY = ("scipy", "pyarrow", "matplotlib", "control", "numba", "mujoco", "pyulog", "pymavlink")


@pytest.mark.parametrize(
    "module", ["helisim.records.record", "helisim.records.storage", "helisim.logs"]
)
def test_records_load_no_heavy_library(module):
    """Each would cost every command its start: scipy.signal alone takes half a second."""
    code = f"import sys, {module}; print(*(name for name in {HEAVY} if name in sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == []


def test_a_flight_is_flown_without_pyplot():
    """python-control brings it, at half a second."""
    code = (
        "import sys; import helisim as hs\n"
        "hs.fly(hs.load('jr700'), hs.Doublet(axis='lat', duration=8.0))\n"
        "print('control' in sys.modules, 'matplotlib' in sys.modules)\n"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["False", "False"]
