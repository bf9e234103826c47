"""`helisim parm`: the derivation printed, the file written, bad input in one line."""

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
