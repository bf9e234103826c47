"""The wheel works on its own, outside the checkout, and where nothing can be written.

The fresh environment sees the dependencies of the environment that runs the tests through a
path file, so that nothing heavy is downloaded twice. It lists only folders of that
environment's site-packages: neither the checkout nor an editable install of it is on the path.
"""

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow


def run(command: list[str | Path], cwd: Path, **variables: str) -> str:
    environment = {key: text for key, text in os.environ.items() if key != "PYTHONPATH"}
    environment |= variables
    asked = {"capture_output": True, "text": True, "check": False}
    done = subprocess.run(command, cwd=cwd, env=environment, **asked)
    assert done.returncode == 0, f"{command} failed:\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run([sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, "."], ROOT)
    (path,) = folder.glob("helisim-*.whl")
    return path


def test_an_index_would_take_wheel_and_archive(wheel):
    files = sorted(wheel.parent.glob("helisim-*"))
    assert [one.suffix for one in files] == [".whl", ".gz"]
    said = run([sys.executable, "-m", "twine", "check", "--strict", *files], wheel.parent)
    assert said.count("PASSED") == 2


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    home = tmp_path_factory.mktemp("fresh") / "venv"
    venv.create(home, symlinks=os.name != "nt")
    programs = home / ("Scripts" if os.name == "nt" else "bin")
    python = programs / "python"
    install = ("install", "--no-deps", "--no-compile", wheel)
    run([sys.executable, "-m", "pip", "--python", python, *install], home)
    ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
    site = Path(run([python, "-c", ask], home).strip())
    ours = {Path(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")}
    shared = [entry for entry in sys.path if ours & {Path(entry), *Path(entry).parents} and entry]
    (site / "dependencies.pth").write_text("\n".join(shared) + "\n")
    return programs


def test_the_wheel_holds_what_it_needs_and_finds_its_models(wheel, installed, tmp_path):
    names = zipfile.ZipFile(wheel).namelist()
    assert "helisim/models/jr700/jr700.xml" in names
    assert "helisim/models/jr700/scene.xml" in names
    assert {"helisim/py.typed", "helisim/__init__.pyi"} <= set(names)
    assert "helisim/show/report.css" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    sources = {path.relative_to(ROOT / "src") for path in (ROOT / "src").rglob("*.py")}
    assert {path.as_posix() for path in sources} <= set(names)
    assert not [name for name in names if "tests" in Path(name).parts or "__pycache__" in name]
    code = (
        "import pathlib, helisim, mujoco\n"
        "folder = pathlib.Path(helisim.__file__).parent\n"
        "mujoco.MjModel.from_xml_path(str(folder / 'models' / 'jr700' / 'scene.xml'))\n"
        "assert 'Sweep' in dir(helisim) and helisim.Sweep(axis='lat').axis == 'lat'\n"
        "print(folder)\n"
    )
    command = [installed / "python", "-B", "-c", code]
    folder = Path(run(command, tmp_path).strip())
    assert installed.parent in folder.parents
    assert ROOT not in folder.parents
    # No cache can be written: permissions do not stop root, so its folders are a file instead.
    (folder / "physics" / "__pycache__").write_text("not a folder")
    names = ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR")
    blocked = dict.fromkeys(names, str(folder / "physics" / "__pycache__" / "cache"))
    command = [installed / "helisim", "vehicle", "linearize", "--json"]
    assert json.loads(run(command, tmp_path, PYTHONDONTWRITEBYTECODE="1", **blocked))
    assert not list(folder.rglob("*.nb[ci]"))
    assert list(tmp_path.iterdir()) == []
