"""The recorded logs that come with helisim."""

import numpy as np
import pytest

import helisim as hs
from helisim import cli
from helisim.base.errors import UnknownNameError
from helisim.logs.examples import FOLDER
from script import loaded

maker = loaded("examples/make_examples")


@pytest.fixture(scope="module")
def logs():
    return {name: hs.open_example(name) for name in hs.examples()}


def test_each_is_a_short_record_with_its_origin(logs):
    assert len(logs) == 7
    for name, record in logs.items():
        assert 8.0 <= record.duration <= 45.0
        np.testing.assert_allclose(record.sample_time, 1.0 / maker.RATE)
        if name != "logger":
            kind, axis = name.split("_")
            flown = record.provenance["excitation"]
            assert (flown["kind"].lower(), flown["axis"]) == (kind, axis)
            assert record.provenance["vehicle"] == "jr700"
    with pytest.raises(UnknownNameError, match=r"unknown example 'sweep'; available: sweep_col"):
        hs.open_example("sweep")


@pytest.mark.parametrize(
    ("structure", "sweeps", "unseen", "options"),
    [
        (
            "rollpitch_speeds",
            ("sweep_lat", "sweep_lon"),
            ("doublet_lat", 0.0, 8.0),
            {"conditioning": ("col", "ped"), "band": (3.0, 42.0)},
        ),
        (
            "yaw_base",
            ("sweep_ped",),
            # without sideslip the yaw model holds from 0.8 rad/s up, for seconds
            ("doublet_ped", 1.5, 4.0),
            {"conditioning": ("v", "col"), "reference": ("PED", "LAT", "COL"), "band": (0.8, 25.0)},
        ),
        ("heave", ("sweep_col",), None, {"reference": ("COL",), "band": (0.8, 12.0)}),
    ],
)
def test_models_are_identified_from_them(structure, sweeps, unseen, options, logs, jr700):
    model = getattr(hs.structures, structure)
    frf = hs.frequency_response(
        [logs[name] for name in sweeps], inputs=model.inputs, outputs=model.outputs, **options
    )
    fit = hs.identify(frf, model)
    assert fit.converged
    assert fit.excellent
    found = 0
    for name, one in fit.parameters.items():
        if name in jr700.derivatives:
            truth = jr700.derivatives[name]
            # one flight an axis, so with more scatter than the bound of the smallest coupling, a
            # sixth of B_lat: 1.3 of it
            allowed = 1.5 if name == "B_lon" else 1.0
            limit = 2.0 * one.standard_error if one.fixed else allowed * one.cramer_rao  # assumed
            assert abs(one.value - truth) <= limit, (name, one.value, truth)
            found += 1
    assert found >= 2
    if unseen is not None:
        doublet, start, stop = unseen
        assert hs.verify(fit, logs[doublet].slice(start, stop)).acceptable


def test_the_foreign_log_is_the_same_helicopter_and_the_script_makes_them(logs, jr700, tmp_path):
    assert logs["logger"].names == ("LAT", "LON", "lat", "lon", "p", "q")
    responses = [
        hs.frequency_response(logs[name], inputs="lat", outputs="p", band=(4.0, 20.0))
        for name in ("logger", "sweep_lat")
    ]
    apart = np.abs(responses[0].response / responses[1].response - 1.0)
    error = np.hypot(*(one.random_error for one in responses))
    assert np.max(apart / error) < 5.0  # of some forty points, none beyond five deviations
    assert np.median(apart) < 0.02
    again = maker.flown(jr700, hs.Doublet(axis="lat"), maker.SEED)
    shipped = logs["doublet_lat"]
    assert again.names == shipped.names
    for name in again.names:
        # IN1 is computed from three servos, each rounded to its step: three half steps apart
        step = maker.RESOLUTION.get(name, 1.5 * maker.RESOLUTION["servo_front"])
        assert np.max(np.abs(again[name] - shipped[name])) <= 1.001 * step, name
    written = [tmp_path / f"{k}.csv" for k in range(2)]
    for path in written:
        maker.write_logger(again, path)
    assert written[0].read_bytes() == written[1].read_bytes()
    assert (FOLDER / "logger.toml").read_text(encoding="utf-8") == maker.MAP


def test_they_are_copied_for_other_commands(tmp_path, capsys):
    folder = tmp_path / "new" / "logs"
    assert cli.main(["examples", "--to", str(folder)]) == 0
    assert "Written: 8 files in" in capsys.readouterr().out
    assert {path.name for path in folder.iterdir()} == {path.name for path in FOLDER.iterdir()}
    assert cli.main(["examples", "--to", str(folder), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    mine = folder / "logger.csv"
    mine.write_text("mine")
    (folder / "sweep_lat.parquet").unlink()
    assert cli.main(["examples", "--to", str(folder)]) == 2
    assert "logger.csv: exists and is another file" in capsys.readouterr().err
    assert mine.read_text() == "mine"
    assert not (folder / "sweep_lat.parquet").exists()
