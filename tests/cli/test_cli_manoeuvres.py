"""Manoeuvres on the command line: kinds and settings, files, functions, several at once."""

import tomllib

import numpy as np
import pytest

from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sim import (
    Chirp,
    FlightPlan,
    History,
    Multisine,
    Pulse,
    Sequence,
    Step,
    Together,
    fly,
)
from helisim.sim.excitation import EXCITATIONS


@pytest.fixture
def planned(capsys, tmp_path, monkeypatch):
    """Return a function that gives the excitation that arguments mean."""
    monkeypatch.chdir(tmp_path)

    def excitation(*arguments):
        assert main(["fly", *arguments, "--print-plan"]) == 0
        return FlightPlan.from_dict(tomllib.loads(capsys.readouterr().out)).excitation

    return excitation


def test_settings_are_numbers_lists_and_texts(planned):
    """As the classes have them; a list's numbers are joined by colons."""
    wanted = Chirp(axis="ped", amplitude=0.02, band=(1.0, 30.0), spacing="linear", at="actuators")
    asked = "chirp,axis=ped,amplitude=0.02,band=1:30,spacing=linear,at=actuators"
    assert planned("--excitation", asked) == wanted
    general = ["--axis", "ped", "--amplitude", "0.02", "--at", "actuators"]
    assert planned("--excitation", "chirp,band=1:30,spacing=linear", *general) == wanted
    given = planned("--excitation", "multisine,axis=lat+ped,amplitude=0.05:0.01,period=10")
    assert (given.axis, given.amplitude, given.period) == ("lat+ped", (0.05, 0.01), 10.0)


def test_a_multisine_alone_is_on_all_axes(planned, jr700):
    """No --axis is needed; bands and amplitudes are the vehicle's own."""
    asked = planned("--excitation", "multisine,period=20", "--duration", "46")
    assert asked == Multisine(period=20.0, duration=46.0).on(jr700.parameters)


def test_several_are_together_or_in_sequence(planned):
    """--excitation given again; what the parts don't say are the general options."""
    parts = (Step(axis="lat", amplitude=0.02), Pulse(axis="r", at="sensors", amplitude=0.1))
    asked = [
        "--excitation", "step,axis=lat", "--excitation", "pulse,axis=r,at=sensors,amplitude=0.1",
        "--amplitude", "0.02",
    ]  # fmt: skip
    assert planned(*asked) == Together(parts=parts)
    assert planned(*asked, "--sequence") == Sequence(parts=parts)
    assert planned(*asked, "--sequence", "1.5") == Sequence(parts=parts, pause=1.5)


def test_a_sequence_is_in_the_order_of_the_command_line(planned, tmp_path):
    """Files and kinds among one another."""
    (tmp_path / "steps.csv").write_text("time,LAT\n0,0\n2,0.03\n")
    asked = ["--excitation", "pulse,axis=lon", "--history", "steps.csv"]
    made = planned(*asked, "--excitation", "pulse,axis=ped", "--sequence")
    assert [part.axis for part in made.parts] == ["lon", "lat", "ped"]


def test_a_plan_of_a_composite_can_be_flown(planned, tmp_path):
    """A plan file nests what the command line can't; --seed and --out are beside it."""
    text = """
    [excitation]
    kind = "Sequence"
    pause = 0.5
    [[excitation.parts]]
    kind = "Together"
    [[excitation.parts.parts]]
    kind = "Step"
    axis = "lat"
    duration = 3
    [[excitation.parts.parts]]
    kind = "Pulse"
    axis = "ped"
    duration = 3
    [[excitation.parts]]
    kind = "Doublet"
    axis = "lon"
    """
    (tmp_path / "plan.toml").write_text(text)
    assert planned("--plan", "plan.toml").duration == 11.5
    assert main(["fly", "--plan", "plan.toml", "--out", "flown.parquet", "--quiet"]) == 0
    assert read_record("flown.parquet").duration == pytest.approx(11.5, abs=0.01)


def test_a_file_and_a_function_are_flown(planned, jr700, tmp_path):
    """As in Python, to the bit; a recording tells what was flown too."""
    (tmp_path / "steps.csv").write_text("time,LAT,COL\n0,0,9\n2,0.03,9\n3,0,9\n6,0,9\n")
    wanted = History.read("steps.csv", axis="lat", method="hold")
    assert planned("--history", "steps.csv,axis=lat,method=hold") == wanted
    (tmp_path / "own_wave.py").write_text("def nod(t):\n    return 0.03 if 2 <= t < 3 else 0.0\n")
    out = ["--out", "flown.parquet", "--rerun", "flown.rrd", "--seed", "4", "--quiet"]
    asked = ["--excitation", "own_wave:nod", "--axis", "lat", "--duration", "6"]
    assert main(["fly", *asked, *out]) == 0
    flown = read_record("flown.parquet")
    expected = fly(jr700, Pulse(axis="lat", amplitude=0.03, width=1.0, duration=6.0), seed=4)[0]
    # --rerun adds the rotor's channels
    assert np.array_equal(flown.select(expected.names), expected.select(expected.names))
    assert flown.provenance["excitation"]["source"] == "nod"


def test_kinds_are_listed_with_settings_and_defaults(capsys):
    """Every kind, its first sentence, each setting with its default."""
    with pytest.raises(SystemExit) as ended:
        main(["fly", "--kinds"])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    for name, kind in EXCITATIONS.items():
        if kind.__module__.startswith("helisim."):
            assert f"{name.lower()}: " in printed
    assert "amplitude=the vehicle's own" in printed
    assert "spacing=logarithmic" in printed
    assert "phases=low_peak" in printed
    assert max(map(len, printed.splitlines())) <= 80
