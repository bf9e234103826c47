import ast
import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import helisim
from command import python
from tabled import tabled

ROOT = Path(__file__).parents[1]
LINT = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"


def test_data_flows_one_way():
    assert "3 kept, 0 broken" in python(LINT, cwd=ROOT)


def test_importing_does_nothing():
    code = (
        "import sys, threading, helisim\n"
        "assert not {'numpy', 'scipy', 'mujoco', 'numba', 'control'} & set(sys.modules)\n"
        "import mujoco\n"
        "getters = [n for n in dir(mujoco) if n.startswith('get_mjcb_')]\n"
        "assert getters\n"
        "assert not [n for n in getters if getattr(mujoco, n)() is not None]\n"
        "assert threading.active_count() == 1\n"
    )
    assert python(code) == ""


HEAVY = {"scipy", "pyarrow", "matplotlib", "control", "numba", "mujoco", "pandas", "rerun"}
HEAVY |= {"pyulog", "pymavlink"}
COMMAND = """from helisim.cli import main
try:
    main({!r})
except SystemExit as end:
    assert end.code == 0
"""
COMMANDS = ("--version", "fly -h", "identify -h")
SHOWN = "import numpy as np, helisim as hs; from helisim.records.record import CHANNELS as C\n"
SHOWN += "record = hs.FlightRecord(np.arange(9.0), np.ones((9, 1)), [C['p']]); record._repr_html_()"
EXAMPLES = "import helisim as hs; hs.examples(); hs.open_example('sweep_lat')"
FLOWN = "import helisim as hs; hs.fly(hs.load('jr700'), hs.Doublet(axis='lat', duration=8.0))"


DRAWN = {"mujoco", "numba", "rerun", "pyarrow"}


@tabled("parts", "heavy")
def test_a_part_loads_no_more_than_it_needs(parts, heavy):
    """Each would cost a start its time: scipy.signal alone, and pyplot, take half a second."""
    found = "found = {!r} & set(sys.modules)\nassert not found, found"
    python("\n".join(["import sys", *(f"{x}\n{found.format(y)}" for x, y in zip(parts, heavy))]))


def test_every_public_name_is_there():
    stub = (ROOT / "src" / "helisim" / "__init__.pyi").read_text(encoding="utf-8")
    listed = [node for node in ast.parse(stub).body if isinstance(node, ast.ImportFrom)]
    names = [alias.name for node in listed for alias in node.names]
    # `X as X` is what makes a name of a stub public
    assert names == [alias.asname for node in listed for alias in node.names]
    assert sorted(names) == helisim.__all__
    assert {*names, "__version__"} <= set(dir(helisim))
    for name in names:
        assert getattr(helisim, name).__doc__
    with pytest.raises(AttributeError, match="nothing"):
        _ = helisim.nothing


@pytest.mark.slow
def test_a_function_is_not_replaced_by_the_package_of_its_name():
    names = "print(*(one.__name__ for one in (hs.look, hs.look, hs.design)))"
    code = f"import helisim as hs; {names}; import helisim.look, helisim.design.design; {names}"
    assert python(code).split() == 2 * ["look", "look", "design"]


# The release: one version everywhere, a short changelog, a citation, a paper, a conda recipe.

TOP = Path(__file__).parents[1]


def read(name):
    return (TOP / name).read_text(encoding="utf-8")


def test_the_version_is_one():
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
