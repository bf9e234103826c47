import ast
from pathlib import Path

import pytest

import helisim
from command import python

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
SHOWN = "import numpy as np, helisim as hs; from helisim.records.record import CHANNELS as C\n"
SHOWN += "record = hs.FlightRecord(np.arange(9.0), np.ones((9, 1)), [C['p']]); record._repr_html_()"
EXAMPLES = "import helisim as hs; hs.examples(); hs.open_example('sweep_lat')"
FLOWN = "import helisim as hs; hs.fly(hs.load('jr700'), hs.Doublet(axis='lat', duration=8.0))"


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        *(
            (f"import helisim.{one}", HEAVY)
            for one in ("records.record", "records.storage", "logs")
        ),
        *(
            (COMMAND.format(words.split()), HEAVY)
            for words in ("--version", "fly -h", "identify -h")
        ),
        (f"{EXAMPLES}; hs.open_example('logger')", {"mujoco", "numba", "matplotlib"}),
        (SHOWN, {"mujoco", "numba", "matplotlib", "rerun", "pyarrow"}),
        (f"{SHOWN}; record.plot()", {"mujoco", "numba", "rerun", "pyarrow"}),
        (FLOWN, {"control", "matplotlib"}),
    ],
)
def test_a_part_loads_no_more_than_it_needs(code, heavy):
    """Each would cost a start its time: scipy.signal alone, and pyplot, take half a second."""
    python(f"import sys\n{code}\nfound = {heavy!r} & set(sys.modules)\nassert not found, found")


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


@pytest.mark.parametrize("first", ["", "import helisim.look, helisim.design.design; "])
def test_a_function_is_not_replaced_by_the_room_of_its_name(first):
    """Public names are what they are called, also where a package has the same name."""
    names = "print(*(one.__name__ for one in (hs.look, hs.look, hs.design)))"
    code = f"{first}import helisim as hs; {names}"
    assert python(code).split() == ["look", "look", "design"]
