"""Every command and every snippet of the README and of the site runs as it is printed."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import helisim
from helisim import cli
from tabled import section

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
PAGES = sorted([README, *(ROOT / "docs").rglob("*.md")])
PAGES = [page for page in PAGES if "_build" not in page.parts]
BLOCK = re.compile(
    r"(?:<!-- (?P<note>[^\n]*) -->\n)?^```(?P<language>[a-z]+)\n(?P<text>.*?)^```$", re.M | re.S
)
SLOW, STUDY = pytest.mark.slow, pytest.mark.study
RUN = ("python", "sh")
PLAIN = re.compile(r"(helisim|python \w)[^|>;&$]*")
"""A command of the shell that a process can do beside others."""
IN_ONE = section(globals(), "IN_ONE")
HERE = Path(sys.executable).parent


def blocks(page):
    for found in BLOCK.finditer(page.read_text(encoding="utf-8")):
        yield found["note"] or "", found["language"], found["text"]


def program(page, folder):
    """Return a page as a script of bash, and write the files that it shows into a folder.

    One process does all commands of a page, unless one needs the shell: each takes 2 s to start.
    """
    lines, python = [], []
    for note, language, text in blocks(page):
        if note.startswith("file: "):
            (folder / note.removeprefix("file: ")).write_text(text)
        elif language in RUN and not note.startswith("not run: "):
            if language == "python":
                python.append(text)
                script = folder / f"snippet_{len(python)}.py"
                script.write_text("".join(python) if note == "goes on" else text)
                lines.append(f"python {script.name}")
            else:
                lines += text.replace("\\\n", " ").splitlines()
    text = "\n".join(lines)
    if not all(map(PLAIN.fullmatch, lines)):
        return f"set -euo pipefail\n{text}"
    (folder / "commands.txt").write_text(text)
    (folder / "in_one.py").write_text(IN_ONE)
    return "python in_one.py"


def name(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_what_is_not_run_has_a_reason(page):
    text = page.read_text(encoding="utf-8")
    assert len(re.findall(r"^```[a-z{]", text, re.M)) * 2 == len(re.findall(r"^```", text, re.M))
    notes = [note for note, language, _ in blocks(page) if note and language in RUN]
    assert all(re.match(r"(not run: \w+|file: \w+|goes on$)", note) for note in notes)


LONG = {
    *("design.md", "plant.md", "lqg.md", "law.md"),
    *("reproduce.md", "report.md", "vehicle.md", "notebook.md", "excitation.md"),
    *("own_log.md", "parm.md", "stock_mujoco.md", "swashplate.md", "margins.md", "by_hand.md"),
}
"""Pages of a whole experiment, or of many flights and processes; the README has every door."""
RUNNING = [
    pytest.param(one, marks=STUDY if one.name in LONG else SLOW)
    for one in PAGES
    if "```sh" in one.read_text()
]


def run(script, folder):
    environment = {**os.environ, "PATH": f"{HERE}{os.pathsep}{os.environ['PATH']}"}
    for part in ("scripts", "models"):
        (folder / part).symlink_to(ROOT / part)
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("page", RUNNING, ids=name)
def test_every_command_and_snippet_of_a_page_runs(page, tmp_path):
    run(program(page, tmp_path), tmp_path)


OTHERS = {"helisim look logs/logger.csv": (), "python scripts/proof/inflow_study.py": STUDY}
PRINTED = [
    pytest.param(one[12:], text, marks=OTHERS.get(one[12:], SLOW), id=one[12:])
    for page in PAGES
    for one, _, text in blocks(page)
    if one.startswith("printed by: ")
]


@pytest.mark.parametrize(("command", "text"), PRINTED)
def test_a_page_shows_what_its_command_prints(command, text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["examples", "--to", "logs", "--quiet"]) == 0
    capsys.readouterr()
    program_, *words = shlex.split(command)
    if program_ == "helisim":
        assert cli.main(words) == 0
        assert text in capsys.readouterr().out
    else:
        assert text in run(command, tmp_path)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    words = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.S)
    for target in re.findall(r"\]\((?!https?://|#)([^)#]+)", words):
        assert (page.parent / target).exists(), target


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    """No broken reference, no page outside the contents, and nothing that needs a network."""
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "--keep-going", "docs", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "theory" / "identification.html").read_text(encoding="utf-8")
    assert page.count("<math") > 30
    assert not re.search(r"<(?:script|img|link)[^>]*(?:src|href)=\"https?:", page)


NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda one: one.stem)
def test_a_notebook_runs_from_top_to_bottom(notebook, tmp_path):
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    code = ["".join(one["source"]) for one in cells if one["cell_type"] == "code"]
    (tmp_path / "cells.py").write_text("\n\n".join(code))
    run("MPLBACKEND=agg ipython --colors=NoColor cells.py", tmp_path)


def test_the_readme_is_short_and_each_door_takes_at_most_ten_lines():
    text = README.read_text(encoding="utf-8")
    assert len(text.split()) <= 900
    section = text.split("## Make it yours")[1].split("\n## ")[0]
    doors = [text.split("\n") for _, _, text in BLOCK.findall(section)]
    assert len(doors) == 11
    assert max(len([line for line in door if line]) for door in doors) <= 10


def test_the_command_of_the_page_works(tmp_path, monkeypatch, capsys):
    program(ROOT / "docs" / "extend" / "command.md", tmp_path)
    monkeypatch.setattr(cli, "__path__", [*cli.__path__, str(tmp_path)])
    monkeypatch.setitem(cli._COMMANDS, "mass", "mass")
    assert "mass" in cli.command_names()
    assert cli.main(["mass"]) == 0
    assert capsys.readouterr().out == "8.01 kg\n"  # Wu and Chen, Table 1
    sys.modules.pop("helisim.cli.mass")


def test_every_public_name_is_in_the_reference():
    text = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    home = r"(?:helisim\.(?:(?:ident\.model|ident|sim|handling|design)\.)?)?"
    named = set(re.findall(rf"^\.\. auto\w+:: {home}(\w+)$", text, re.M))
    assert set(helisim.__all__) - named == set()
