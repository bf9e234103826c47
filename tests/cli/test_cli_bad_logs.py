"""The command line on logs with something wrong: one line that says what and where."""

import numpy as np
import plants
import pytest

from command import fails
from helisim.cli import main
from helisim.ident import structures
from swept_logs import csv_writer, flown, write_foreign

ROLLPITCH = plants.ROLLPITCH_IN1
RESAMPLE = ["--resample", "50"]


@pytest.fixture
def sweep_csv(tmp_path):
    return csv_writer(tmp_path)


def empty(column, rows_of=lambda k: True):
    """Return a change that empties a column where `rows_of` holds."""

    def change(rows):
        for k, row in enumerate(rows):
            row[column] = "" if rows_of(k) else row[column]
        return rows

    return change


def constant(rows):
    return [[time, "0.25", w] for time, _, w in rows]


@pytest.mark.parametrize(
    ("change", "header", "says"),
    [
        (None, "t [s],stick [1],w [m/s]", ["bad.csv", "'col'", "'stick [1]'", "--channel"]),
        (None, "t [s],col,w [m/s]", ["bad.csv", "'col'", "unit"]),
        (empty(2), None, ["bad.csv, column 'w [m/s]', lines 2 to 3001", "no number"]),
        (empty(0, lambda k: k == 7), None, ["bad.csv, line 9, column 't [s]'", "no time"]),
        (
            empty(2, lambda k: k % 10 == 4),
            None,
            ["bad.csv, line 6, column 'w [m/s]'", "300 of 3000", "'missing'"],
        ),
        (constant, None, ["bad.csv, column 'col [1]', lines 2 to 3001", "constant"]),
        (
            lambda rows: rows[:1000] + rows[:2000],
            None,
            ["bad.csv, line 1002, column 't [s]'", "goes back", "'resets'"],
        ),
        (
            lambda rows: [*rows[:50], rows[49], *rows[50:]],
            None,
            ["bad.csv, line 52, column 't [s]'", "same time", "'duplicates'"],
        ),
        (
            lambda rows: [row for k, row in enumerate(rows) if k % 500 not in range(400, 450)],
            None,
            ["bad.csv, line 402, column 't [s]'", "gap", "10 %", "'gaps'"],
        ),
    ],
)
def test_a_bad_log_is_one_line_with_its_place(sweep_csv, capsys, change, header, says):
    path = sweep_csv(change or (lambda rows: rows), header or "t [s],col [1],w [m/s]")
    out = path.with_suffix(".json")
    message = fails(capsys, "identify", path, "--structure", "heave", "--json", out, *RESAMPLE)
    for text in says:
        assert text in message
    assert not out.exists()


def test_uneven_samples_are_refused_until_resampled(sweep_csv, capsys):
    random = np.random.default_rng(0)
    path = sweep_csv(lambda rows: [row for row in rows if random.random() > 0.1])
    message = fails(capsys, "identify", path, "--structure", "heave")
    assert "bad.csv, line " in message
    assert "column 't [s]'" in message
    assert "--resample" in message
    arguments = ["identify", str(path), "--structure", "heave", "--resample", "50"]
    assert main([*arguments, "--max-gap", "0.1"]) == 0


def test_inputs_that_move_as_one_are_refused(tmp_path, capsys):
    time, inputs, outputs = flown(structures.rollpitch, ROLLPITCH, "lat", 5, duration=40.0)
    path = tmp_path / "both.csv"
    headings = ["t [s]", "lat [1]", "mixed [1]", "p [rad/s]", "q [rad/s]"]
    columns = [inputs[:, 0], 0.5 * inputs[:, 0], *outputs.T]
    write_foreign(path, headings, time, columns, delimiter=",")
    options = ["--channel", "lon=mixed", "--band", "2", "30"]
    message = fails(capsys, "identify", path, "--structure", "rollpitch", *options)
    for text in ("both.csv", "'lat [1]'", "'mixed [1]'", "lines 2 to 4001"):
        assert text in message


def test_several_faults_of_several_logs_are_printed_together(sweep_csv, capsys):
    """A line each, with file, row and option; nothing is written."""
    holes = sweep_csv(empty(2, lambda k: k % 10 == 4), name="holes.csv")
    dead = sweep_csv(lambda rows: [*rows[:50], rows[49], *rows[50:]], name="repeats.csv")
    out = holes.with_suffix(".json")
    arguments = ["identify", str(holes), str(dead), "--structure", "heave", "--json", str(out)]
    assert main(arguments) == 2
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert lines[0] == "helisim identify: 2 things are wrong with the logs:"
    assert "holes.csv, line 6, column 'w [m/s]': no number" in lines[1]
    assert "repeats.csv, line 52" in lines[2]
    assert "'duplicates'" in lines[2]
    assert len(lines) == 3
    assert not out.exists()
    assert captured.out == ""
