"""An autopilot's parameter file, as tests read it."""

from pathlib import Path


def parm_file(path: Path) -> dict[str, float]:
    """Return values by name."""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines if line and not line.startswith("#")]
    return {name: float(value) for name, value in rows}
