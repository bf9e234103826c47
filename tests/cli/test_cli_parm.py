"""`helisim parm`: the derivation printed, the file written, bad input in one line."""

from command import fails
from helisim.cli import main
from helisim.sitl.parameters import read_parameters


def test_it_prints_the_derivation_and_writes_the_file(tmp_path, capsys):
    """What is printed is the file; each gain says what it follows from."""
    path = tmp_path / "jr700.parm"
    assert main(["parm", "jr700", "--out", str(path), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert shown == path.read_text()
    assert "the command that holds 1 rad/s of p" in shown
    assert read_parameters(path)["FRAME_CLASS"] == 6.0


def test_what_is_wrong_is_said_in_a_line(tmp_path, capsys):
    """No such vehicle, no sweeps in the folder, another kind of file: exit status 2."""
    assert "nothere" in fails(capsys, "parm", "nothere")
    assert "no flight records" in fails(capsys, "parm", "jr700", "--from", tmp_path)
    assert ".parm" in fails(capsys, "parm", "jr700", "--out", tmp_path / "jr700.txt")
    assert not list(tmp_path.iterdir())
