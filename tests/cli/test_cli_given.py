"""The command line on frequency responses in place of logs, so that nothing is estimated twice."""

import numpy as np
import pytest

from command import fails
from helisim.cli import main
from helisim.ident import load_fit, load_response, structures
from swept_logs import HEAVE, csv_writer, flown, write_foreign

OMEGA = np.geomspace(1.0, 20.0, 30)
EXACT = HEAVE["Z_col"] / (1j * OMEGA - HEAVE["Z_w"]) * np.exp(-1j * HEAVE["tau_col"] * OMEGA)


@pytest.fixture
def sweep_csv(tmp_path):
    return csv_writer(tmp_path)


def model_of(tmp_path, *arguments):
    """Identify the heave model; return the fit that was written."""
    model = tmp_path / "model.json"
    assert main(["identify", *map(str, arguments), "--json", str(model), "--quiet"]) == 0
    return load_fit(model)


def columns(path, heading=""):
    """Write the heave model's response, Hz, dB and degrees."""
    table = np.column_stack(
        [OMEGA / (2 * np.pi), 20 * np.log10(abs(EXACT)), np.degrees(np.angle(EXACT))]
    )
    path.write_text(heading + "\n".join(" ".join(map(repr, row)) for row in table.tolist()))
    return path


def test_a_response_of_frf_gives_the_model_of_the_log(tmp_path, sweep_csv):
    """From the JSON that `frf` wrote, values and errors are those from the log itself."""
    path, out = sweep_csv(), tmp_path / "frf.json"
    band = ["--band", "1.5", "20"]
    signals = ["--inputs", "col", "--outputs", "w", "--quiet"]
    assert main(["frf", str(path), *signals, *band, "--json", str(out)]) == 0
    direct = model_of(tmp_path, path, "--structure", "heave", *band)
    given = model_of(tmp_path, out, "--structure", "heave")
    assert given.values == direct.values
    assert given["Z_w"].standard_error == direct["Z_w"].standard_error
    part = model_of(tmp_path, out, "--structure", "heave", "--band", "3", "10")
    assert part.bands["w/col"] == pytest.approx((3, 10), rel=0.05)


@pytest.mark.parametrize("named", [True, False])
def test_anyones_columns_are_a_response(tmp_path, capsys, named):
    """A file without names holds the structure's one response, or the one that is named."""
    path = columns(tmp_path / "w.txt", "% freq_Hz mag_dB phase_deg\n")
    given = f"w/col={path}" if named else path
    fit = model_of(tmp_path, given, "--structure", "heave")
    assert fit.values == pytest.approx(HEAVE, rel=1e-6)
    printed = " ".join(capsys.readouterr().out.split())
    assert "30 frequencies" in printed
    assert "has no coherence" in printed


def test_results_are_in_the_users_units(tmp_path, sweep_csv, capsys):
    """--units changes what is printed and tabulated, and JSON stays SI; a CSV comes back as SI."""
    path, out, table = sweep_csv(), tmp_path / "frf.csv", tmp_path / "heave.tex"
    options = ["--units", "ft,percent", "--quiet"]
    fit = model_of(tmp_path, path, "--structure", "heave", *options, "--latex", table)
    printed = capsys.readouterr().out
    (line,) = (line for line in printed.splitlines() if line.startswith("Z_col"))
    assert line.split()[1:3] == ["ft/(s^2", "%)"]
    shown = fit["Z_col"].value / 0.3048 / 100.0
    assert float(line.split()[3]) == pytest.approx(shown, rel=1e-5)
    assert f"{shown:.3f}" in table.read_text()
    signals = ["--inputs", "col", "--outputs", "w", "--band", "1.5", "20", "--csv", str(out)]
    gains = []
    for units in ([], ["--units", "ft,percent"]):
        assert main(["frf", str(path), *signals, "--quiet", *units]) == 0
        assert load_response(out).output_units == ("m/s",)
        gains.append(load_response(out).response[0, 0])
    assert gains[1] == pytest.approx(gains[0], rel=1e-12)
    model = tmp_path / "model.json"
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 9, duration=20.0, noise=0.01)
    other = tmp_path / "other.csv"
    write_foreign(other, ["t [s]", "col [1]", "w [m/s]"], time, [*inputs.T, *outputs.T])
    rms = []
    for units in ([], ["--units", "ft"]):
        capsys.readouterr()
        main(["verify", str(model), str(other), *units])
        (line,) = (one for one in capsys.readouterr().out.splitlines() if one.startswith("w "))
        rms.append(float(line.split()[2]))
        assert line.split()[1] == ("ft/s" if units else "m/s")
    assert rms[1] == pytest.approx(rms[0] / 0.3048, rel=1e-3)
    assert "furlong" in fails(capsys, "verify", model, other, "--units", "furlong")


def test_columns_are_named_on_the_command_line(tmp_path):
    """--columns says what a file without headings holds."""
    path = columns(tmp_path / "w.dat")
    options = ["--structure", "heave", "--columns", "frequency:Hz,magnitude:dB,phase:deg"]
    assert model_of(tmp_path, path, *options).values == pytest.approx(HEAVE, rel=1e-6)


@pytest.mark.parametrize("command", ["look", "frf", "verify"])
def test_json_is_no_log(tmp_path, sweep_csv, capsys, command):
    """What reads logs says where a response in JSON belongs."""
    response, model = tmp_path / "frf.json", tmp_path / "model.json"
    signals = ["--inputs", "col", "--outputs", "w"]
    main(["frf", str(sweep_csv()), *signals, "--json", str(response)])
    model_of(tmp_path, sweep_csv(), "--structure", "heave")
    capsys.readouterr()
    more = {"look": [], "frf": signals, "verify": []}[command]
    files = [model, response] if command == "verify" else [response]
    assert "helisim identify takes" in fails(capsys, command, *files, *more)


def test_the_help_says_what_a_file_may_be(capsys):
    """A newcomer finds that responses are taken too."""
    with pytest.raises(SystemExit):
        main(["identify", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert "p/lat=FILE" in shown
    assert structures.heave.name
