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


UNSAFE_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "joblib"}
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__"}
UNSAFE_FUNCTIONS = {"os.system", "os.popen"}
UNSAFE_OPTIONS = {"allow_pickle", "shell"}


def unsafe(tree):
    """Yield the line and name of whatever could run a file's or a user's text as a program."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = {alias.name.split(".")[0] for alias in node.names} & UNSAFE_MODULES
        elif isinstance(node, ast.ImportFrom):
            names = {(node.module or "").split(".")[0]} & UNSAFE_MODULES
        elif isinstance(node, ast.Call):
            called = {node.func.id} if isinstance(node.func, ast.Name) else set()
            options = {word.arg for word in node.keywords if word.arg}
            names = (called & UNSAFE_CALLS) | (options & UNSAFE_OPTIONS)
            names |= {ast.unparse(node.func)} & UNSAFE_FUNCTIONS
        else:
            continue
        yield from ((node.lineno, name) for name in names)


def test_nothing_that_is_read_is_ever_run():
    """No pickle, no eval, no shell in the whole source: what comes from a file stays data."""
    sources = sorted((ROOT / "src").rglob("*.py"))
    assert len(sources) > 100
    found = [
        f"{path.name}:{line} {name}"
        for path in sources
        for line, name in unsafe(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert found == []


def test_the_search_for_unsafe_calls_finds_them():
    """It is not blind: each kind of such a line is seen."""
    lines = ["import pickle", "from joblib import load", "eval(x)", "np.load(f, allow_pickle=True)"]
    lines += ["os.system(x)", "subprocess.run(x, shell=True)"]
    assert [line for line, _ in unsafe(ast.parse("\n".join(lines)))] == [1, 2, 3, 4, 5, 6]
