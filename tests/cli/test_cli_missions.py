"""`helisim fly --mission`: scripts from the command line, and what they reached."""

import pytest

from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sim.plan import read_plan

MINE = """\
from dataclasses import dataclass

import helisim as hs


@dataclass(frozen=True, kw_only=True)
class Nod(hs.Mission):
    duration: float = 5.0
    north: float = 1.0

    def fly(self, pilot):
        yield from pilot.go(self.north, 0.0)
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)


def test_a_mission_is_flown_and_what_it_reached_is_said(capsys):
    """With its settings, in a line."""
    assert main(["fly", "--mission", "pirouette,turns=0.1", "--out", "a.parquet"]) == 0
    out = capsys.readouterr().out
    assert "Reached: place within 0." in out
    assert "heading within" in out
    record = read_record("a.parquet")
    assert record.provenance["mission"]["turns"] == 0.1
    assert record.provenance["reached"]["finished"]


def test_missions_fill_a_folder_and_are_not_flown_again(capsys):
    """Files are named after the mission; what they reached is no other configuration."""
    flight = ["fly", "--mission", "pirouette,turns=0.1", "--count", "2", "--out", "flights"]
    assert main(flight) == 0
    assert main(flight) == 0
    assert "2 of them there before" in capsys.readouterr().out
    assert read_record("flights/pirouette_0002.parquet").provenance["flight"] == 1


def test_a_mission_of_ones_own_is_flown(tmp_path, capsys):
    """By the module in the folder and the name of the class, with its settings."""
    (tmp_path / "my_missions.py").write_text(MINE)
    assert main(["fly", "--mission", "my_missions:Nod,north=0.5", "--out", "a.parquet"]) == 0
    assert "Reached: place within" in capsys.readouterr().out
    assert read_record("a.parquet").provenance["mission"]["north"] == 0.5


def test_a_plan_is_printed_and_flown(tmp_path, capsys):
    """With a mission, a ground of its own, and a sweep on top of it."""
    arguments = ["--mission", "take_off_hover_land,height=3", "--axis", "lat", "--print-plan"]
    assert main(["fly", *arguments]) == 0
    (tmp_path / "plan.toml").write_text(capsys.readouterr().out)
    plan = read_plan("plan.toml")
    assert plan.name == "take_off_hover_land_lat"
    assert plan.ground is not None
    assert plan.ground.parked


def test_missions_are_listed(capsys):
    """With their settings and defaults."""
    with pytest.raises(SystemExit) as caught:
        main(["fly", "--missions"])
    assert caught.value.code == 0
    out = capsys.readouterr().out
    assert "autorotation: Lose the engine" in out
    assert "height=30.0" in out
