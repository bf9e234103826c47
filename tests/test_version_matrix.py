"""The version matrix reads its bounds from pyproject.toml and says what could not be had."""

import subprocess
from pathlib import Path

import pytest

from script import loaded

ROOT = Path(__file__).parents[1]


@pytest.fixture
def matrix():
    return loaded("proof/version_matrix")


def done(status, text=""):
    return subprocess.CompletedProcess([], status, "", text)


def test_the_tools_come_with_the_bounds_of_the_test_extra(matrix):
    """The programs that run tests as pyproject.toml has them, and nothing else of that extra."""
    names = [one.split(">")[0] for one in matrix.needs()]
    assert sorted(names) == ["hypothesis", "pytest", "pytest-xdist"]
    assert all(">=" in one for one in matrix.needs())


def test_the_tests_that_run_by_default_exist(matrix):
    """A renamed test is missed here and not in the matrix."""
    assert [one for one in matrix.TESTS if not (ROOT / one).exists()] == []


def test_a_dependency_without_a_wheel_is_no_failure(matrix, tmp_path, monkeypatch, capsys):
    """The combination is listed with the resolver's reason, and counts as not to be had."""
    refusal = done(1, "  x No solution found\n  because numba has no wheel for Python 3.99\n")
    monkeypatch.setattr(matrix, "run", lambda *_, **__: refusal)
    assert matrix.tested("3.99", "newest", tmp_path / "a.whl", ["tests"]) is None
    assert "not to be had: because numba has no wheel" in capsys.readouterr().out


@pytest.mark.parametrize("status", [0, 1])
def test_a_combination_passes_as_its_tests_do(matrix, tmp_path, monkeypatch, capsys, status):
    """Pytest's status decides, and its last line is shown beside the versions."""

    def run(*command, check=True):
        if "compile" in command:
            lines = [f"{name}==1.0" for name in matrix.SHOWN]
            Path(command[command.index("--output-file") + 1]).write_text("\n".join(lines))
        if "pytest" in command:
            return subprocess.CompletedProcess(command, status, "..\n2 passed\n", "")
        return done(0)

    monkeypatch.setattr(matrix, "run", run)
    outcome = matrix.tested("3.12", "oldest", tmp_path / "a.whl", ["tests"])
    assert outcome is (status == 0)
    printed = capsys.readouterr().out
    assert "Python 3.12 oldest: 2 passed" in printed
    assert "numba 1.0" in printed
