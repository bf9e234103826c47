"""The release: one version everywhere, a short changelog, a citation, a paper, a conda recipe."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import helisim

TOP = Path(__file__).parents[1]


def read(name):
    return (TOP / name).read_text(encoding="utf-8")


def test_the_version_is_one():
    """`helisim.__version__` is where it stands; what can't read it from there repeats it."""
    own = helisim.__version__
    assert version("helisim") == own
    assert re.findall(r"^version: (\S+)$", read("CITATION.cff"), re.M) == [own]
    assert re.findall(r'version: "(.+)"$', read("scripts/release/recipe.yaml"), re.M) == [own]
    assert re.search(rf"^## {re.escape(own)}\b", read("CHANGELOG.md"), re.M)


def test_a_release_has_at_most_80_lines_of_changes():
    releases = re.split(r"^## ", read("CHANGELOG.md"), flags=re.M)[1:]
    assert len(releases) >= 2
    assert max(text.count("\n") for text in releases) <= 80


def test_conda_installs_what_pip_does():
    """The same packages from the same versions on; conda-forge calls two of them otherwise."""
    named = {"mujoco": "mujoco-python", "matplotlib": "matplotlib-base"}
    asked = [
        one.split(">=") for one in tomllib.loads(read("pyproject.toml"))["project"]["dependencies"]
    ]
    run = read("scripts/release/recipe.yaml").split("  run:\n")[1].split("\ntests:")[0]
    listed = re.findall(r"^    - (\S+) >=(\S+)$", run, re.M)
    assert sorted(listed) == sorted(
        [("python", "3.11"), *((named.get(name, name), least) for name, least in asked)]
    )


def test_the_paper_cites_what_it_lists():
    text = read("docs/paper/paper.md")
    cited = set(re.findall(r"@(\w+\d{4})", text))
    assert cited == set(re.findall(r"^@\w+\{(\w+),$", read("docs/paper/paper.bib"), re.M))
    assert len(text.split()) <= 1200
