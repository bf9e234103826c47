"""The command line on how a model is fitted: what the library takes is possible there too."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import helisim
from helisim.cli import main, parser
from helisim.ident import load_fit
from swept_logs import csv_writer


@pytest.fixture(scope="module")
def sweep_csv(tmp_path_factory):
    """Return a function that names a collective sweep, written once."""
    path = csv_writer(tmp_path_factory.mktemp("sweep"))()
    return lambda: path


def test_what_messages_advise_exists():
    words = set()
    for package in ("ident", "records"):
        for path in (Path(helisim.__file__).parent / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            words |= set(re.findall(r"--[a-z][a-z-]+", text))
            for remedy in re.findall(r'remedy="([^"]+)"', text):
                names = (part.partition("=")[0] for part in remedy.split(","))
                words |= {f"--{name.replace('_', '-')}" for name in names}
    known = set()
    for command in ("identify", "frf", "verify"):
        actions = parser([command])._actions[-1].choices[command]._actions
        known |= {name for action in actions for name in action.option_strings}
    assert words <= known


def test_a_poor_fit_names_the_options_that_help(tmp_path, sweep_csv, capsys):
    """One search from far away, and a bound that holds: the output says what to try."""
    options = ["--structure", "heave", "--searches", "1", "--bounds", "Z_w=-0.5:-0.4"]
    options += ["--start", "Z_w=-0.45"]
    main(["identify", str(sweep_csv()), *options])
    printed = " ".join(capsys.readouterr().out.split())
    assert "say where to start (--searches, --start)" in printed
    assert "doubt the structure (--bounds)" in printed


def fitted(tmp_path, logs, *options, structure):
    """Identify and return the fit that was written, whatever the exit status."""
    model = tmp_path / "model.json"
    where = ["--structure", structure, "--json", str(model), "--quiet"]
    assert main(["identify", *map(str, logs), *where, *options]) in (0, 1)
    return load_fit(model)


def test_the_estimator_is_the_users(tmp_path, sweep_csv):
    """--estimator windows are CIFER's."""
    out = tmp_path / "frf.json"
    signals = ["--inputs", "col", "--outputs", "w", "--band", "2", "20", "--quiet"]
    words = ["--estimator", "windows", "--json", str(out)]
    assert main(["frf", str(sweep_csv()), *signals, *words]) == 0
    assert json.loads(out.read_text())["response"]["estimator"] == "windows"


def test_bounds_hold_a_parameter(tmp_path, sweep_csv):
    """--bounds holds the fit, and opens a side that is left out; --start is within them."""
    path = sweep_csv()
    bounds = ["--bounds", "Z_w=-0.5:-0.4", "--start", "Z_w=-0.45"]
    held = fitted(tmp_path, [path], *bounds, structure="heave")
    assert held["Z_w"].value == pytest.approx(-0.5)
    assert held.at_bound == ("Z_w",)
    free = fitted(tmp_path, [path], "--bounds", "Z_w=:-0.4", structure="heave")
    assert free["Z_w"].value < -0.6
    assert free["Z_w"].definition.limits == (-np.inf, -0.4)


def test_what_is_known_from_a_bench_carries_its_error(tmp_path, sweep_csv):
    """--fix NAME=VALUE+-ERROR widens the others' errors; without an error it is exact."""
    path = sweep_csv()
    exact = fitted(tmp_path, [path], "--fix", "Z_w=-0.8", structure="heave")
    fit = fitted(tmp_path, [path], "--fix", "Z_w=-0.8+-0.5", structure="heave")
    assert fit["Z_w"].definition.error == 0.5
    assert fit["Z_col"].value == pytest.approx(exact["Z_col"].value)
    assert fit["Z_col"].standard_error > 1.2 * exact["Z_col"].standard_error
