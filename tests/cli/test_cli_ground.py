"""`--ground`: flat, a slope, a deck that moves, in the words of the command line."""

import tomllib

import pytest

from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sim import Deck, FlightPlan, Ground, Swing

FLY = ["fly", "--excitation", "doublet", "--axis", "ped"]
SEA = Deck(
    length=8.0, heave=Swing(amplitude=0.3, period=6.0), roll=Swing(amplitude=0.05, period=8.0)
)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("flat", Ground()),
        ("flat,parked", Ground(parked=True)),
        ("slope=0.1,uphill=1.5,friction=0.4", Ground(slope=0.1, uphill=1.5, friction=0.4)),
        ("deck", Ground(deck=Deck())),
        ("deck,length=8,heave=0.3/6,roll=0.05/8,effect=0.5", Ground(deck=SEA, effect=0.5)),
        ("width=3", Ground(deck=Deck(width=3.0))),
        ("off", None),
    ],
)
def test_the_plan_has_the_ground_that_is_asked_for(capsys, tmp_path, text, meant):
    """Alone, and in place of a plan file's."""
    assert main([*FLY, "--ground", text, "--print-plan"]) == 0
    printed = capsys.readouterr().out
    assert FlightPlan.from_dict(tomllib.loads(printed)).ground == meant
    path = tmp_path / "plan.toml"
    path.write_text(printed)
    assert main(["fly", "--plan", str(path), "--print-plan"]) == 0
    assert capsys.readouterr().out == printed
    assert main(["fly", "--plan", str(path), "--ground", "slope=0.3", "--print-plan"]) == 0
    assert FlightPlan.from_dict(tomllib.loads(capsys.readouterr().out)).ground == Ground(slope=0.3)


def test_a_flight_is_recorded_over_its_ground(tmp_path, capsys):
    """It takes off from a deck; the record says from which."""
    out = tmp_path / "deck.parquet"
    assert main([*FLY, "--ground", "deck,heave=0.3/6,parked", "--rotor", "--out", str(out)]) == 0
    record = read_record(out)
    assert FlightPlan.of_record(record).ground.deck.heave == Swing(amplitude=0.3, period=6.0)
    assert record["contact"][0] > 70.0
    assert record.ended == ""
