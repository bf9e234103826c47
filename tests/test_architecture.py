import ast
import subprocess
import sys
from pathlib import Path

import pytest

import helisim

ROOT = Path(__file__).parents[1]
LINT = "from importlinter.cli import lint_imports; raise SystemExit(lint_imports())"


def test_data_flows_one_way():
    """The import contracts of pyproject.toml hold: layers, and an identification that is blind."""
    check = subprocess.run(
        [sys.executable, "-c", LINT], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert check.returncode == 0, check.stdout + check.stderr
    assert "3 kept, 0 broken" in check.stdout


def test_importing_does_nothing():
    """`import helisim` loads no library, starts no thread, prints nothing, installs no callback."""
    code = (
        "import sys, threading, helisim\n"
        "assert not {'numpy', 'scipy', 'mujoco', 'numba', 'control'} & set(sys.modules)\n"
        "import mujoco\n"
        "getters = [n for n in dir(mujoco) if n.startswith('get_mjcb_')]\n"
        "assert getters\n"
        "assert not [n for n in getters if getattr(mujoco, n)() is not None]\n"
        "assert threading.active_count() == 1\n"
    )
    check = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert check.returncode == 0, check.stderr
    assert check.stdout == ""


def test_every_public_name_is_there():
    """The names of `__init__.pyi`, each documented, and no others."""
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
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["look", "look", "design"]
