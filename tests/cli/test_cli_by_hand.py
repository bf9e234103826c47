"""`helisim view` by hand: what excludes each other, what is not there, each in one line."""

import pytest

from helisim.cli import main


@pytest.fixture
def refused(capsys, monkeypatch, tmp_path):
    """Return a function that gives the line with which arguments are refused."""
    monkeypatch.chdir(tmp_path)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)

    def said(*arguments):
        assert main(["view", *arguments]) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.count("\n") == 1
        assert list(tmp_path.iterdir()) == []
        return printed.err

    return said


@pytest.mark.parametrize("device", ["--keyboard", "--joystick", "--joystick=radio"])
def test_without_a_display_it_says_what_to_do(refused, device):
    said = refused(device, "--out", "hand.parquet")
    assert "neither DISPLAY nor WAYLAND_DISPLAY" in said
    assert "helisim fly" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--keyboard", "--joystick"], "--keyboard and --joystick exclude each other"),
        (["--mode", "1"], "--mode is for a flight by hand: add --keyboard or --joystick"),
        (["--wind", "3"], "--wind is for a flight by hand"),
        (["--keyboard", "--mode", "5"], "unknown transmitter mode 5; available: 1, 2, 3, 4"),
        (
            ["--keyboard", "--assist", "much"],
            "unknown assist 'much'; available: hover, level, none",
        ),
        (["--keyboard", "--rate", "2"], "rate must be a number above 0 and at most 1, got 2.0"),
        (["--keyboard", "--map", "radio.toml"], "--map is of a joystick: add --joystick"),
        (["--joystick", "--map", "a.toml", "--order", "TAER"], "--map and --order exclude"),
        (["--joystick", "--map", "none.toml"], "none.toml: no such file"),
        (["--joystick", "--order", "AETT"], "each of A, E, T and R once"),
        (["--keyboard", "--axis", "lat"], "a hand flies no manoeuvre"),
        (["--keyboard", "--turbulence", "rough"], "unknown turbulence 'rough'"),
        (["--keyboard", "--out", "hand.txt"], "hand.txt: unknown suffix"),
    ],
)
def test_what_can_not_be_is_refused(refused, arguments, said):
    assert said in refused(*arguments)
