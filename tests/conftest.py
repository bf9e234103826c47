"""What the tests of physics, vehicle and simulation share."""

import copy
import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # there is a worker for each core

import mujoco
import numpy as np
import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

import interpreted
from helisim.physics.layout import PARAM
from helisim.vehicle import Vehicle, load
from helisim.vehicle.addresses import addresses

if interpreted.wanted():
    interpreted.install()

# No deadline: the first example may compile. Derandomised: a failure repeats everywhere.
settings.register_profile(
    "helisim", deadline=None, derandomize=True, database=None, max_examples=50
)
settings.load_profile("helisim")


LONG = {"docs", "sitl", "study", "test_packaging.py"}
"""Folders and files of long tests."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what lasts: else a worker has it to do when the others are done."""
    items.sort(key=lambda item: LONG.isdisjoint(item.path.parts))


class Sharing(LoadScopeScheduling):
    """Gives each file to a worker, but for the commands of pages: to any, one by one."""

    def _split_scope(self, nodeid: str) -> str:
        return nodeid if "docs/test_pages.py" in nodeid else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> Sharing:
    return Sharing(config, log)


HOOKS = ("passive", "control", "act_dyn", "sensor", "time")


@pytest.fixture(autouse=True)
def no_callback_left_behind() -> Iterator[None]:
    """Fail any test after which one of MuJoCo's global callbacks is still set."""
    yield
    left = [hook for hook in HOOKS if getattr(mujoco, f"get_mjcb_{hook}")() is not None]
    for hook in left:
        getattr(mujoco, f"set_mjcb_{hook}")(None)
    assert not left
    errors = interpreted.raised.copy()
    interpreted.raised.clear()
    assert not errors


SHARED = Path(__file__).parents[2] / "shared" / "ardupilot" / "arducopter-heli"
"""Where a program of ArduPilot's may lie beside the project."""


@pytest.fixture(scope="session")
def ardupilot() -> Path:
    """ArduPilot's program arducopter-heli; without one the test is skipped, and says so."""
    path = Path(os.environ.get("HELISIM_ARDUPILOT") or SHARED)
    if not path.is_file():
        pytest.skip(f"no ArduPilot to fly: {path} is not there, set HELISIM_ARDUPILOT")
    pytest.importorskip("pymavlink", reason="flights by a script need pymavlink")
    return path


@pytest.fixture(scope="session")
def jr700() -> Vehicle:
    """The calibrated vehicle. Tests copy its model before they change it."""
    return load("jr700")


ROOT = str(Path(__file__).parents[1])
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")


def flat(data: object, place: str = "") -> Iterator[tuple[str, str]]:
    """Yield the places of plain data, such as "logs[0].path", each with its text."""
    if isinstance(data, dict | list | tuple) and data:
        named = data.items() if isinstance(data, dict) else enumerate(data)
        for name, one in named:
            yield from flat(one, f"{place}.{name}".lstrip("."))
    else:
        yield place, f"{data:.6g}" if isinstance(data, float) else str(data)


@pytest.fixture
def kept(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[object], None]:
    """Compare plain data with what test_a.json keeps of this test, or keep it: HELISIM_KEEP=1.

    Words as they are; numbers within 0.2 %, half of a third digit that is rounded.
    """

    def compare(data: object) -> None:
        path = request.path.with_suffix(".json")
        known = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        found = {
            place: text.replace(str(tmp_path), "TMP").replace(ROOT, "ROOT")
            for place, text in flat(data)
        }
        if os.environ.get("HELISIM_KEEP"):
            text = json.dumps(dict(sorted({**known, request.node.name: found}.items())), indent=1)
            path.write_text(text + "\n", encoding="utf-8")
            return
        one, other = (
            {place: NUMBER.sub("#", text) for place, text in each.items()}
            for each in (found, known[request.node.name])
        )
        assert one == other
        for place, text in known[request.node.name].items():
            numbers = [list(map(float, NUMBER.findall(each))) for each in (found[place], text)]
            assert numbers[0] == pytest.approx(numbers[1], rel=2e-3, abs=1e-9), place

    return compare


@pytest.fixture
def par(jr700: Vehicle) -> np.ndarray:
    """A writable copy of the numbers that the vehicle's force laws read."""
    return jr700.model.actuator_user[addresses(jr700.model).rotor].copy()


@pytest.fixture
def altered(jr700: Vehicle) -> Callable[..., mujoco.MjModel]:
    """Return a copy of the vehicle's model with some force-law numbers replaced."""

    def alter(**changes: float) -> mujoco.MjModel:
        model = copy.copy(jr700.model)
        numbers = model.actuator_user[addresses(model).rotor]
        for slot, value in changes.items():
            numbers[getattr(PARAM, slot)] = value
        return model

    return alter
