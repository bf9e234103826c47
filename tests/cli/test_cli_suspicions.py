"""`helisim identify` on a fit that fails prints what the logs and the data show."""

import numpy as np
import pytest

from helisim.cli import main

STRUCTURE = """\
name = "roll"
states = ["p", "phi"]
inputs = ["lat"]
outputs = ["p", "phi"]
F = [["L_p", 0], [1, 0]]
G = [["L_lat"], [0]]
[parameters]
L_p = { unit = "1/s", start = -3 }
L_lat = { unit = "1/s^2", start = 50 }
"""


def write(path, factor):
    """Write a roll of p' = -6 p + 90 lat as CSV, the rate times a factor."""
    t = np.arange(6000) / 100.0
    lat = 0.1 * np.sin(np.cumsum(np.geomspace(1.0, 20.0, t.size)) / 100.0)
    p, phi = np.zeros(t.size), np.zeros(t.size)
    for k in range(1, t.size):
        p[k] = p[k - 1] * np.exp(-0.06) + (1.0 - np.exp(-0.06)) * 15.0 * lat[k - 1]
        phi[k] = phi[k - 1] + 0.005 * (p[k] + p[k - 1])
    table = np.column_stack([t, lat, factor * p, phi])
    header = "t [s],lat [1],p [rad/s],phi [rad]"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    return path


@pytest.mark.slow
def test_a_fit_that_fails_is_explained(tmp_path, capsys):
    """A rate in deg/s declared rad/s: by the data, and by the log's own attitude."""
    structure = tmp_path / "roll.toml"
    structure.write_text(STRUCTURE)
    log = write(tmp_path / "roll.csv", 180.0 / np.pi)
    options = ["--structure", str(structure), "--band", "2", "15", "--quiet"]
    assert main(["identify", str(log), *options]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    assert "likely causes, by what the data show:" in printed
    assert "with p's column in deg/s, not rad/s: J would be" in printed
    option = ["--channel", "p=p [rad/s]:deg/s"]
    assert "(--channel 'p=p [rad/s]:deg/s')" in printed
    assert main(["identify", str(log), *options, *option]) == 0
    assert "likely causes" not in capsys.readouterr().out
