"""Killed at random moments: nothing that was reported as saved is lost, and nothing is torn."""

import pytest

from script import loaded

pytestmark = pytest.mark.study


@pytest.fixture(scope="module")
def study():
    return loaded("proof/kill_study")


@pytest.fixture(scope="module")
def found(study, tmp_path_factory):
    return study.study("fly", 3, tmp_path_factory.mktemp("kills"))


def test_a_folder_of_flights_survives_kills(found):
    """Three kills; then it is gone on with, to the same bytes as an undisturbed run's."""
    assert found["kills"] >= found["in time"] == 3
    assert found["reported"] > 0
    assert (found["lost"], found["torn"], found["not complete in the end"]) == (0, 0, 0)


def test_the_study_sees_what_is_torn_or_missing(study, found, tmp_path):
    """A file that was cut, one of other bytes, one that is gone."""
    whole, folder = tmp_path / "fly whole", tmp_path / "fly 0"
    for one in (whole, folder):
        one.mkdir()
        (one / "lat_0001.parquet").write_bytes(b"PAR1 whole PAR1")
        (one / "results.json").write_text("{}")
    assert study.torn(folder, whole) == []
    (folder / "lat_0001.parquet").write_bytes(b"PAR1 wh")
    (folder / "lat_0002.parquet").write_bytes(b"PAR1 of a part")
    (folder / "fits.json").write_text('{"a":')
    (folder / ".lat_0003.12345678.tmp.parquet").write_bytes(b"a stray")
    assert len(study.torn(folder, whole)) == 3
    assert study.units("fly", folder) == 2
