"""Test helisim with the oldest and the newest versions that its pyproject.toml admits.

    pip install uv                               # resolves the lower bounds, makes the environments
    python scripts/proof/version_matrix.py       # every Python from 3.11 up that is found here
    python scripts/proof/version_matrix.py --python 3.12 --which oldest --tests tests

For each Python and each end of the bounds: an environment of its own in a temporary folder, with
wheels only; a wheel of this checkout in it; the tests. Where a dependency has no wheel for a Python
(numba is the last to follow), the combination is listed as not to be had and doesn't count as
failed. Exit status 1: tests failed, or nothing could be tested.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
OLDEST_PYTHON, LAST_PYTHON = 11, 20
RESOLUTION = {"oldest": "lowest-direct", "newest": "highest"}
EXTRAS = ("logs", "dask")
TOOLS = ("pytest", "pytest-xdist", "hypothesis")
TESTS = (
    "tests/physics",
    "tests/vehicle/test_trim.py",
    "tests/records",
    "tests/ident/test_ident_fit.py",
    "tests/ident/test_ident_frf.py",
    "tests/ident/test_ident_result.py",
    "tests/sim/test_fly.py",
    "tests/output/test_rerun_log.py",
    "tests/output/test_report.py",
    "tests/cli/test_cli.py",
)
"""One of each kind of work: compiled callbacks, flights, files, identification, output."""
SHOWN = ("mujoco", "numpy", "scipy", "numba", "control", "pyarrow", "matplotlib", "rerun-sdk")


class NotToBeHad(Exception):
    """Some dependency has no wheel for this Python."""


def run(*command: str | Path, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command away from any other environment's packages."""
    outer = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
    environment = {name: text for name, text in os.environ.items() if name not in outer}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    if check and done.returncode:
        raise RuntimeError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done


def pythons() -> list[str]:
    """Return the versions of Python that are found here and not too old for helisim."""
    versions = [f"3.{minor}" for minor in range(OLDEST_PYTHON, LAST_PYTHON)]
    return [one for one in versions if not run("uv", "python", "find", one, check=False).returncode]


def needs() -> list[str]:
    """Return what the tests need beside helisim, with its bounds in pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = project["optional-dependencies"]["test"]
    return [one for one in listed if re.match(r"[\w-]+", one)[0] in TOOLS]


def resolved(python: str, which: str, folder: Path) -> Path:
    """Return a file of the exact version of every dependency."""
    wanted, pinned = folder / "needs.in", folder / "pinned.txt"
    wanted.write_text("\n".join(needs()), encoding="utf-8")
    extras = [word for extra in EXTRAS for word in ("--extra", extra)]
    done = run(
        *("uv", "pip", "compile", "--quiet", "--only-binary", ":all:", *extras),
        *("--python-version", python, "--resolution", RESOLUTION[which]),
        *("--output-file", pinned, "pyproject.toml", wanted),
        check=False,
    )
    if done.returncode:
        raise NotToBeHad(reason(done.stderr))
    return pinned


def reason(message: str) -> str:
    """Return the line of uv's that says why."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    return next((line for line in lines if line.startswith("error:")), lines[-1])


def made(python: str, pinned: Path, wheel: Path, folder: Path) -> Path:
    """Return the interpreter of an environment with the pinned versions and helisim's wheel."""
    interpreter = folder / "venv" / "bin" / "python"
    make = ("uv", "venv", "--quiet", "--no-python-downloads", "--python", python)
    done = run(*make, folder / "venv", check=False)
    if done.returncode:
        raise NotToBeHad(reason(done.stderr))
    install = ("uv", "pip", "install", "--quiet", "--python", interpreter, "--only-binary", ":all:")
    run(*install, "--requirement", pinned)
    run(*install, "--no-deps", wheel)
    return interpreter


def versions(pinned: Path) -> str:
    """Return the versions of the packages that matter most, for the table."""
    found = dict(re.findall(r"^([\w-]+)==(\S+)", pinned.read_text(encoding="utf-8"), re.M))
    return " ".join(f"{name} {found[name]}" for name in SHOWN)


def tested(python: str, which: str, wheel: Path, tests: list[str]) -> bool | None:
    """Test one combination and print its line; None if it is not to be had."""
    with tempfile.TemporaryDirectory(prefix="helisim-versions-") as name:
        folder = Path(name)
        try:
            pinned = resolved(python, which, folder)
            interpreter = made(python, pinned, wheel, folder)
        except NotToBeHad as message:
            print(f"Python {python} {which}: not to be had: {message}", flush=True)
            return None
        done = run(interpreter, "-m", "pytest", "-n0", *tests, check=False)
        said = done.stdout.strip().splitlines()
        print(f"Python {python} {which}: {said[-1] if said else done.stderr.strip()}")
        print(f"    {versions(pinned)}", flush=True)
        if done.returncode:
            print(done.stdout + done.stderr, file=sys.stderr, flush=True)
        return done.returncode == 0


def main() -> int:
    """Print a line for each combination; return 1 if one fails or none can be tested."""
    if shutil.which("uv") is None:
        sys.exit("version_matrix: needs uv: pip install uv")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", action="append", help="only this version, may be repeated")
    parser.add_argument("--which", choices=RESOLUTION, help="only this end of the bounds")
    parser.add_argument("--tests", nargs="+", default=TESTS, help="what pytest runs")
    options = parser.parse_args()
    which = [options.which] if options.which else list(RESOLUTION)
    with tempfile.TemporaryDirectory(prefix="helisim-wheel-") as folder:
        run("uv", "build", "--quiet", "--wheel", "--out-dir", folder)
        (wheel,) = Path(folder).glob("*.whl")
        outcomes = [
            tested(python, end, wheel, options.tests)
            for python in options.python or pythons()
            for end in which
        ]
    known = [outcome for outcome in outcomes if outcome is not None]
    print(f"{sum(known)} of {len(known)} combinations passed, {len(outcomes) - len(known)} not had")
    return 0 if known and all(known) else 1


if __name__ == "__main__":
    sys.exit(main())
