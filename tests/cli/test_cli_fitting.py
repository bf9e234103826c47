"""The command line on how a model is fitted: what the library takes is possible there too."""

import inspect
import json
import re
from pathlib import Path

import numpy as np
import pytest

import helisim
from helisim.cli import main, parser
from helisim.ident import frequency_response, identify, load_fit, reduce, structures, verify
from swept_logs import csv_writer, write_clean

ROLLPITCH = {
    "tau_f": 0.06, "L_b": 700.0, "M_a": 400.0, "A_b": -0.2, "B_a": 0.3, "A_lat": 0.02,
    "A_lon": 0.2, "B_lat": 0.2, "B_lon": -0.02, "tau_lat": 0.02, "tau_lon": 0.02,
}  # fmt: skip

OPTIONS = {
    frequency_response: {
        "records": "logs",
        "inputs": "--inputs",
        "outputs": "--outputs",
        "band": "--band",
        "conditioning": "--conditioning",
        "reference": "--reference",
        "estimator": "--estimator",
        "windows": "--windows",
        "overlap": "--overlap",
        "use_ended": "--use-ended",
    },
    identify: {
        "frf": "logs",
        "structure": "--structure",
        "band": "--band",
        "responses": "--responses",
        "frequencies_per_response": "--points",
        "searches": "--searches",
        "seed": "--seed",
        "weighting": "--weighting",
        "on_progress": "--quiet",
    },
    reduce: {"keep": "--keep", "delays": "--drop-delays", "rise": "--rise"},
    verify: {
        "fit": "model",
        "records": "logs",
        "segment": "--segment",
        "ahead": "--ahead",
        "use_ended": "--use-ended",
    },
}
OPTIONS[reduce] |= OPTIONS[identify]


@pytest.fixture(scope="module")
def sweep_csv(tmp_path_factory):
    """Return a function that names a collective sweep, written once."""
    path = csv_writer(tmp_path_factory.mktemp("sweep"))()
    return lambda: path


@pytest.fixture(scope="module")
def sweeps(tmp_path_factory):
    """Lateral and longitudinal sweeps of the roll-pitch model, as files."""
    folder = tmp_path_factory.mktemp("sweeps")
    paths = []
    for seed, axis in enumerate(("lat", "lon")):
        paths.append(folder / f"{axis}.parquet")
        write_clean(paths[-1], structures.rollpitch, ROLLPITCH, axis, seed, 0.002)
    return [str(path) for path in paths]


@pytest.mark.parametrize("function", OPTIONS)
def test_every_argument_of_the_library_is_an_option(function):
    """A new argument of what a command calls needs an option, or users can't reach it."""
    command = "verify" if function is verify else "identify"
    actions = parser([command])._actions[-1].choices[command]._actions
    known = {name for action in actions for name in (*action.option_strings, action.dest)}
    assert set(inspect.signature(function).parameters) == set(OPTIONS[function])
    assert set(OPTIONS[function].values()) <= known


def test_what_messages_advise_exists():
    """Every option that the identification or the reading of logs names is one of a command."""
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
    main(["identify", str(sweep_csv()), *options])
    printed = " ".join(capsys.readouterr().out.split())
    assert "say where to start (--searches, --start)" in printed
    assert "doubt the structure (--bounds)" in printed


def fitted(tmp_path, logs, *options, structure="rollpitch"):
    """Identify and return the fit that was written, whatever the exit status."""
    model = tmp_path / "model.json"
    where = ["--structure", structure, "--json", str(model), "--quiet"]
    assert main(["identify", *map(str, logs), *where, *options]) in (0, 1)
    return load_fit(model)


def test_responses_have_bands_of_their_own(tmp_path, sweeps):
    """--band takes one for all, and others by response, in one word or several."""
    own = ["--band", "p/lat=3:25,q/lon=2:20"]
    fit = fitted(tmp_path, sweeps, "--band", "1", "30", *own, "--searches", "1")
    for name, wanted in {"p/lat": (3, 25), "q/lon": (2, 20), "p/lon": (1, 30)}.items():
        assert fit.bands[name] == pytest.approx(wanted, rel=0.05), name
    assert fit.data.frequency[[0, -1]] == pytest.approx([1.0, 30.0])
    alone = fitted(tmp_path, sweeps, *own, "--responses", "p/lat,q/lon", "--searches", "1")
    assert alone.bands["p/lat"] == pytest.approx((3, 25), rel=0.05)


def test_the_search_and_its_points_are_the_users(tmp_path, sweep_csv):
    """--searches, --points, --weighting and --seed reach the library as they are."""
    options = ["--searches", "3", "--points", "35", "--weighting", "coherence", "--seed", "4"]
    fit = fitted(tmp_path, [sweep_csv()], *options, structure="heave")
    asked = dict(fit.options)
    assert (asked["searches"], asked["frequencies_per_response"]) == (3, 35)
    assert (asked["weighting"], asked["seed"]) == ("coherence", 4)


def test_windows_and_their_overlap_are_the_users(tmp_path, sweep_csv):
    """--windows and --overlap are those of `frequency_response`."""
    path, out = sweep_csv(), tmp_path / "frf.json"
    signals = ["--inputs", "col", "--outputs", "w", "--band=2:20", "--quiet", "--json", str(out)]
    coherence = []
    for overlap in ("0.5", "0.75"):
        assert main(["frf", str(path), *signals, "--windows", "6,4", "--overlap", overlap]) == 0
        response = json.loads(out.read_text())["response"]
        assert response["windows"] == [6.0, 4.0]
        coherence.append(np.array(response["coherence"]))
    assert np.any(coherence[0] != coherence[1])


def test_the_estimator_is_the_users(tmp_path, sweep_csv):
    """--estimator local has no windows; what it finds in a file is what it finds in the log."""
    path, out = sweep_csv(), tmp_path / "frf.json"
    signals = ["--inputs", "col", "--outputs", "w", "--band=2:20", "--quiet", "--json", str(out)]
    assert main(["frf", str(path), *signals, "--estimator", "local"]) == 0
    assert json.loads(out.read_text())["response"]["estimator"] == "local"
    from_file = fitted(tmp_path, [out], structure="heave")
    local = ["--band", "2", "20", "--estimator", "local"]
    from_log = fitted(tmp_path, [path], *local, structure="heave")
    assert from_file.values == from_log.values
    assert from_file["Z_w"].standard_error == from_log["Z_w"].standard_error


def test_bounds_hold_a_parameter(tmp_path, sweep_csv):
    """--bounds moves a start inside, holds the fit, and opens a side that is left out."""
    path = sweep_csv()
    held = fitted(tmp_path, [path], "--bounds", "Z_w=-0.5:-0.4", structure="heave")
    assert held["Z_w"].value == pytest.approx(-0.5)
    assert held.at_bound == ("Z_w",)
    free = fitted(tmp_path, [path], "--bounds", "Z_w=:-0.4", structure="heave")
    assert free["Z_w"].value < -0.6
    assert free["Z_w"].definition.limits == (-np.inf, -0.4)


def test_what_is_known_from_a_bench_carries_its_error(tmp_path, sweep_csv):
    """--fix NAME=VALUE+-ERROR widens the others' errors; without an error it is exact."""
    path = sweep_csv()
    exact = fitted(tmp_path, [path], "--fix", "Z_w=-0.8", structure="heave")
    for sign in ("+-", "±"):
        fit = fitted(tmp_path, [path], "--fix", f"Z_w=-0.8{sign}0.5", structure="heave")
        assert fit["Z_w"].definition.error == 0.5
        assert fit["Z_col"].value == pytest.approx(exact["Z_col"].value)
        assert fit["Z_col"].standard_error > 1.2 * exact["Z_col"].standard_error


def test_known_blocks_are_in_series(tmp_path, sweep_csv):
    """--known puts a bench's lag before an input: the fit's own delay gets as much shorter."""
    path = sweep_csv()
    plain = fitted(tmp_path, [path], structure="heave")
    fit = fitted(tmp_path, [path], "--known", "col=delay:tau=0.02+-0.001", structure="heave")
    assert fit["tau_col"].value == pytest.approx(plain["tau_col"].value - 0.02, abs=1e-6)
    assert fit["tau_col"].standard_error > plain["tau_col"].standard_error


def test_a_reduction_keeps_what_it_is_told_to(tmp_path, sweep_csv):
    """--keep, --rise and --drop-delays are those of `reduce`; with a rise all goes."""
    path, model = sweep_csv(), tmp_path / "model.json"
    options = ["--structure", "heave", "--reduce", "--rise", "1e9", "--json", str(model)]
    options += ["--points", "100", "--band", "10", "30"]  # where the damping is hardly seen
    kept = []
    for more in ([], ["--keep", "Z_w"]):
        main(["identify", str(path), *options, *more])
        kept.append("Z_w" not in json.loads(model.read_text())["reduction"]["dropped"])
    assert kept == [False, True]
