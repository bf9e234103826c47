import base64
import hashlib
import json
import re
import shutil
from html.parser import HTMLParser

import pytest
from browser import Browser, find

from helisim.base.errors import InputError, StorageError
from helisim.show.report import write_fit_report, write_report
from helisim.study.paper import published
from helisim.study.results import read_run
from made_run import make_flight, make_model, write_run

PAIRS = ("w_col", "p_lat", "p_lon", "q_lat", "q_lon")
ROUNDING = 0.6e-3  # four digits: half a unit of the last, of numbers that begin with 1


class Page(HTMLParser):
    """Collects the cells with a key, the figures and all addresses of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.cells: dict[str, tuple[float | None, str]] = {}
        self.figures: list[str] = []
        self.addresses: list[str] = []
        self.ids: list[str] = []
        self._key: tuple[str, float | None] | None = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if "id" in given:
            self.ids.append(given["id"])
        if tag == "figure":
            self.figures.append(given["id"])
        self.addresses += [given[name] for name in ("src", "href") if name in given]
        assert tag not in ("iframe", "object")
        assert not any(name.startswith("on") for name in given)  # no handler runs
        if tag == "td" and "data-key" in given:
            value = given.get("data-value")
            self._key = (given["data-key"], None if value is None else float(value))

    def handle_data(self, data):
        if self._key is not None:
            key, value = self._key
            self.cells[key] = (value, data)
            self._key = None


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("run")
    write_run(made)
    write_report(made)
    return made


@pytest.fixture(scope="module")
def page(folder) -> Page:
    return Page((folder / "report.html").read_text())


def test_every_number_is_that_of_the_results(folder, page):
    """Each number of results.json is in the page in full, and shown to its four digits."""
    results = json.loads((folder / "results.json").read_text())
    shown = {key for key in page.cells if key.startswith("tables.")}
    expected = set()
    for table in results["tables"]:
        for row in table["parameters"]:
            prefix = f"tables.{table['name']}.{row['name']}"
            expected |= {f"{prefix}.support", f"{prefix}.agreement"}
            assert page.cells[f"{prefix}.support"][1] == row["support"]
            judged = {row["truth_agreement"], row["paper_agreement"]}
            agrees = "differs" if "differs" in judged else "agrees"
            assert page.cells[f"{prefix}.agreement"][1] == agrees
            for column in ("paper", "truth", "identified", "cr_percent", "insensitivity_percent"):
                if row[column] is None:
                    continue
                value, text = page.cells[f"{prefix}.{column}"]
                expected.add(f"{prefix}.{column}")
                assert value == row[column]
                digits = ROUNDING if not column.endswith("percent") else 0.06  # two digits
                largest = max(abs(row[name] or 0.0) for name in ("paper", "truth", "identified"))
                scale = largest if not column.endswith("percent") else abs(value)
                assert abs(float(text) - value) <= digits * scale
    assert shown == expected


def test_what_was_found_beyond_the_models_is_shown(folder, page):
    """Ground tests, the gyro's effect and eq. (8): each number in full, and shown rounded."""
    results = json.loads((folder / "results.json").read_text())
    lists = {
        "ground.bench": results["ground"]["bench"]["findings"],
        "before_after": results["before_after"]["changes"],
        "eq_8": results["eq_8"]["coefficients"],
    }
    two_digits = {"error", "standard_error", "difference_percent"}
    for place, items in lists.items():
        for item in items:
            for column, value in item.items():
                if isinstance(value, float):
                    shown, text = page.cells[f"{place}.{item['name']}.{column}"]
                    assert shown == value
                    digits = 0.06 if column in two_digits or "ratio" in column else ROUNDING
                    rounded = 0.0 if value == 2.776e-17 else value  # beside 0.3 mm
                    assert float(text) == pytest.approx(rounded, rel=digits)
    text = (folder / "report.html").read_text()
    for words in ("One factor is a convention", "tau_f rises", "-0.12 dB at 20 rad/s"):
        assert words in text


def test_the_verifications_numbers_are_the_fits(folder, page):
    """J_rms and TIC of each output are those of the verification."""
    (item,) = (item for item in read_run(folder).models if item.verification is not None)
    for output in item.verification.outputs:
        place = f"verification.{item.name}.{output}"
        assert page.cells[f"{place}.j_rms"][0] == item.verification.j_rms_by_output[output]
        assert page.cells[f"{place}.tic"][0] == item.verification.tic_by_output[output]


def test_every_tolerance_has_its_reason_in_the_page(folder):
    """What an agreement rests on is said, and against what."""
    text = (folder / "report.html").read_text()
    assert "Z_w: within 3 % of the truth (for the test)" in text


def test_the_papers_numbers_are_the_references(page):
    """Table 1 and the paper's own bounds are those of the reference."""
    for value in published("jr700")["airframe"]:
        assert page.cells[f"paper.airframe.{value.name}"][0] == value.value
    assert page.cells["paper.rollpitch_in1.L_b.cr_percent"][0] == 13.9  # Table 3


def test_every_pair_sweep_and_verification_has_its_figure(folder, page):
    """One figure a pair, a kept sweep of each axis, one a verified flight; a file of each."""
    expected = {f"bode_heave_{PAIRS[0]}", *(f"bode_rollpitch_in1_{pair}" for pair in PAIRS[1:])}
    expected |= {"sweep_lat", "sweep_col", "time_rollpitch_in1_1"}
    maps = {"correlation_heave", "correlation_rollpitch"}
    assert set(page.figures) == expected | maps
    files = {path.name for path in (folder / "figures").iterdir()}
    assert files == {f"{name}.svg" for name in expected}


def test_the_one_script_is_the_one_that_may_run(folder):
    """The policy names its hash alone: nothing that came in with a text of the run can run."""
    text = (folder / "report.html").read_text()
    (script,) = re.findall("<script>(.*?)</script>", text, flags=re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'\"" in text
    assert "default-src 'none'" in text


def test_no_axis_shows_what_rounding_left(folder):
    """Neither a negative zero nor 2.776e-17 is a number of an axis, in the page or its files."""
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", (folder / "report.html").read_text())
    numbers = [text.replace("\N{MINUS SIGN}", "-") for text in texts]
    numbers = [text for text in numbers if re.fullmatch(r"-?[\d.]+(e[+-]?\d+)?", text)]
    assert len(numbers) > 100
    for number in numbers:
        assert float(number) != 0.0 or not number.startswith("-")
        assert not 0.0 < abs(float(number)) < 1e-9


def test_the_page_needs_nothing_else(page):
    """Every picture is inside, every link stays on the page, no identifier is there twice."""
    for address in page.addresses:
        assert address.startswith(("data:", "#")), address
    assert len(set(page.ids)) == len(page.ids)
    assert {a[1:] for a in page.addresses if a.startswith("#")} <= set(page.ids)


def test_all_is_said(folder):
    """What was left out, errata, seed and versions are in the page, and texts are escaped."""
    text = (folder / "report.html").read_text()
    assert "flight lat_01: its mean coherence" in text
    assert 'id="errata"' in text
    assert "Seed 7" in text
    assert "4.0.0" in text
    assert "a note with &lt; and &amp;" in text


def test_the_kept_sweep_is_shown(folder):
    """A flight that was left out is not the one that stands for its axis."""
    assert read_run(folder).sweeps["lat"].provenance["flight"] == "lat_02"


def test_the_report_is_the_same_again(folder):
    """Made again from the same files, it has the same bytes."""
    before = (folder / "report.html").read_bytes()
    write_report(folder)
    assert (folder / "report.html").read_bytes() == before


def test_a_run_with_tables_alone_has_a_report(folder, tmp_path):
    """Without fits and flights the tables are still a report."""
    shutil.copy(folder / "results.json", tmp_path)
    page = Page(write_report(tmp_path).read_text())
    assert "tables.heave.Z_w.truth" in page.cells
    assert page.figures == []


def test_a_folder_without_a_run_is_refused(tmp_path):
    """The fault is named in one line."""
    with pytest.raises(StorageError, match=r"has no results\.json"):
        write_report(tmp_path)
    for text in (
        '{"tables": []}',
        '{"tables": [{}], "seed": 1, "versions": {}, "configuration": {}}',
    ):
        (tmp_path / "results.json").write_text(text)
        with pytest.raises(InputError, match="not the results of a run"):
            write_report(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"recorder": {}}, "configuration of the run.recorder needs rate_hz"),
        (
            {"timestep_s": "short"},
            "run.timestep_s must be a number, got 'short'",
        ),
        ({"parameters": [1]}, "configuration of the run.parameters must be a table"),
    ],
)
def test_a_configuration_that_says_too_little_is_refused(folder, tmp_path, change, message):
    """What the page says of the experiment is checked where it is read."""
    results = json.loads((folder / "results.json").read_text())
    results["configuration"] |= change
    (tmp_path / "results.json").write_text(json.dumps(results))
    with pytest.raises(InputError, match=message):
        write_report(tmp_path)


def test_anyones_fit_has_a_report(tmp_path):
    """A model and its records make a page with parameters, figures and records."""
    item = make_model("heave")
    drawn = []
    path = write_fit_report(
        tmp_path / "fit.html",
        item.fit,
        records={"one": make_flight()},
        on_progress=drawn.append,
    )
    assert drawn == ["one"]
    page = Page(path.read_text())
    for name, value in item.fit.values.items():
        assert page.cells[f"parameters.{name}.value"][0] == value
    pole = item.fit.modes.poles[0].frequency
    assert page.cells["modes.poles.0.frequency_rad_s"][0] == pytest.approx(pole, rel=ROUNDING)
    assert page.figures == ["correlation_heave", "bode_heave_w_col", "flight_0"]


needs_browser = pytest.mark.skipif(
    find() is None, reason="needs Chromium (Debian: apt-get install chromium)"
)
SEEN = "document.getElementById('sections').checkVisibility()"
CURRENT = "document.querySelector('nav [aria-current]').hash"


@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_browser_shows_it_at_any_width(folder, page, tmp_path, scheme):
    """No complaint, no request, no sideways scroll from phone to wide screen; all is drawn."""
    with Browser(tmp_path) as browser:
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        browser.call("Emulation.setEmulatedMedia", features=features)
        for width in (390, 1280, 1920):
            browser.open((folder / "report.html").as_uri(), width)
            drawn = browser.evaluate(
                "[...document.querySelectorAll('figure > svg')].map(s => s.clientWidth)"
            )
            assert len(drawn) == len(page.figures)
            assert min(drawn) > 300
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
            paper = browser.evaluate("getComputedStyle(document.body).backgroundColor")
            assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
            outside = (
                "[...document.querySelectorAll('.drawing text')].filter(t => {"
                "const [a, b] = [t, t.ownerSVGElement].map(e => e.getBoundingClientRect());"
                "return a.left < b.left || a.right > b.right}).map(t => t.textContent)"
            )
            assert browser.evaluate(outside) == []
        assert browser.complaints == []
        assert [url for url in browser.fetched if not re.match("data:|file:", url)] == []


@needs_browser
def test_the_list_of_sections_stays_and_says_where_one_is(folder, tmp_path):
    """Beside the page on a desk; on a phone a menu that opens, and closes after a choice."""
    to_errata = "document.getElementById('errata').scrollIntoView()"
    settled = "new Promise(r => requestAnimationFrame(() => requestAnimationFrame(r)))"
    with Browser(tmp_path) as browser:
        browser.open((folder / "report.html").as_uri(), 1280)
        assert browser.evaluate(CURRENT) == "#experiment"
        browser.evaluate(f"{to_errata}; {settled}")
        assert browser.evaluate(CURRENT) == "#errata"
        assert browser.evaluate(SEEN)
        assert browser.evaluate("document.querySelector('nav').getBoundingClientRect().top") == 0

        browser.open((folder / "report.html").as_uri(), 390)
        assert not browser.evaluate(SEEN)
        browser.evaluate("document.querySelector('nav button').click()")
        assert browser.evaluate(SEEN)
        browser.evaluate(f"document.querySelector('nav a[href=\"#errata\"]').click(); {settled}")
        assert not browser.evaluate(SEEN)
        assert browser.evaluate(CURRENT) == "#errata"
        assert "Errors in the paper" in browser.evaluate(
            "document.querySelector('nav button').textContent"
        )
        assert browser.complaints == []
