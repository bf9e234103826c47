"""What a program leaves that is killed while it writes: a complete file, or the one before."""

import pytest

from helisim.cli import main
from killing import kill_at
from made_run import write_run

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("run")
    write_run(made)
    return made


def test_a_killed_recording_leaves_the_file_before(folder):
    """There is no half recording; the next one is not disturbed by what was left."""
    target = folder / "run.rrd"
    target.write_text("what was there")
    kill_at("run.rrd", "record", str(folder), "--out", str(target))
    assert target.read_text() == "what was there"
    # as a run that was killed among its flights leaves one
    (folder / "flights" / ".lat_03.0123abcd.tmp.parquet").write_bytes(b"PAR1 and no more")
    assert main(["record", str(folder), "--out", str(target), "--quiet"]) == 0
    assert target.read_bytes().startswith(b"RRF2")


def test_a_killed_report_leaves_whole_figures_and_the_page_before(folder):
    """Each figure that is there is whole; the page is the one before; then it works again."""
    page = folder / "report.html"
    page.write_text("what was there")
    kill_at("bode_rollpitch_in1_p_lon.svg", "report", str(folder))
    assert page.read_text() == "what was there"
    pictures = {path.name: path for path in (folder / "figures").glob("[!.]*.svg")}
    assert "bode_rollpitch_in1_p_lat.svg" in pictures  # it came before
    assert "bode_rollpitch_in1_p_lon.svg" not in pictures
    assert all(path.read_text().endswith("</svg>\n") for path in pictures.values())
    assert main(["report", str(folder), "--quiet"]) == 0
    assert page.read_text().endswith("</html>\n")
