"""Write into a vehicle's MJCF the numbers with which stock MuJoCo flies it; its text else stays."""

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from os import PathLike
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.base.files import atomic_write, read_bytes
from helisim.physics.layout import ACTUATORS, PARAM, ROTOR
from helisim.physics.memory import check_model
from helisim.vehicle.assembly import NEEDS_INERTIAL, force_law_block, put_into
from helisim.vehicle.parameters import mjcf_file, model_folder
from helisim.vehicle.vehicle import load

_MAX_BYTES = 1 << 26
_WIDTH = 100
_ROUNDING = 1e-14  # relative, by which a number may differ and stand: processors differ
_DECIMALS = 10  # of the trim, whose solver leaves 1e-13 rad
_ATTRIBUTE = r"""(\s+)(%s)\s*=\s*(?:"([^"]*)"|'([^']*)')"""
_ATTRIBUTES = f"(?:{_ATTRIBUTE % '[^=>]+?'})*"
_TAG = re.compile(rf"<!--.*?-->|<(\w+){_ATTRIBUTES}\s*/?>".encode(), flags=re.DOTALL)


@dataclass(frozen=True, eq=False)
class Element:
    """One element of an MJCF; written: its start tag; line: from 1; start: of the tag, a byte."""

    tag: str
    written: bytes
    file: Path
    line: int
    start: int

    def attribute(self, name: str) -> str:
        """Return what an attribute says, "" if it isn't there."""
        found = re.search((_ATTRIBUTE % name).encode(), self.written)
        return (found[3] or found[4] or b"").decode() if found else ""

    def numbers(self, name: str) -> list[float]:
        """Return the numbers of an attribute, none if it has no others."""
        try:
            return [float(word) for word in self.attribute(name).split()]
        except ValueError:
            return []

    @property
    def name(self) -> str:
        """Its name, or ""."""
        return self.attribute("name")

    @property
    def place(self) -> str:
        """Its place for a message: file, line, tag and name."""
        named = f' name="{self.name}"' if self.name else ""
        return f"{self.file}, line {self.line}: <{self.tag}{named}>"


def elements(path: Path, text: bytes) -> Iterator[Element]:
    """Give the elements of an MJCF file's text, as they stand in it."""
    for found in _TAG.finditer(text):
        if found[1]:
            line = 1 + text.count(b"\n", 0, found.start())
            yield Element(found[1].decode(), found[0], path, line, found.start())


@dataclass(frozen=True, eq=False)
class Change:
    """An element that has other numbers than the parameters give, in these attributes.

    new: its start tag with the right ones.
    """

    element: Element
    attributes: tuple[str, ...]
    new: bytes

    @classmethod
    def to(
        cls,
        element: Element,
        numbers: Mapping[str, Sequence[float] | NDArray[np.float64]],
        solved: float = 0.0,
    ) -> "Change":
        """Return what gives an element numbers, none to drop an attribute; solved: accuracy."""
        new, changed = element.written, []
        for name, wanted in numbers.items():
            found = element.numbers(name)
            if len(found) == len(wanted) and np.allclose(found, wanted, _ROUNDING, solved):
                continue
            changed.append(name)
            attribute = re.compile((_ATTRIBUTE % name).encode())
            text = f'{name}="{_text(wanted)}"'.encode() if len(wanted) else b""
            if attribute.search(new):
                new = attribute.sub(rb"\g<1>" + text if text else b"", new, count=1)
            else:
                new = re.sub(rb"(\s*/?>)$", b" " + text + rb"\1", new)
        return cls(element, tuple(changed), new)


def write_numbers(vehicle: str | PathLike[str]) -> tuple[Path, ...]:
    """Write a vehicle's numbers into its MJCF; return the file, nothing where it was up to date.

    Raises UnknownNameError, ModelError (with file and line), TrimError, StorageError; CallbackError
    if, written, it would not fly: the file is then unchanged.
    """
    changes = unwritten(vehicle)
    return (write_changes(changes),) if changes else ()


def write_changes(changes: Sequence[Change]) -> Path:
    """Write changes into their file, in its order; return it. Raises as `write_numbers`."""
    path = changes[0].element.file
    text = read_bytes(path, limit=_MAX_BYTES)
    for change in reversed(changes):  # each moves what stands behind it
        start, old = change.element.start, change.element.written
        text = text[:start] + change.new + text[start + len(old) :]
    with atomic_write(path) as temporary:
        temporary.write_bytes(text)
        check_model(mujoco.MjModel.from_xml_path(str(temporary)))
    return path


def unwritten(vehicle: str | PathLike[str]) -> tuple[Change, ...]:
    """Return the differences of a vehicle's MJCF from its parameters, in the file's order."""
    wanted = sorted(_changes(model_folder(vehicle)), key=lambda change: change.element.start)
    return tuple(change for change in wanted if change.attributes)


def _changes(folder: Path) -> Iterator[Change]:
    vehicle, path = load(folder, tuned=False), mjcf_file(folder)
    found = [*elements(path, read_bytes(path, limit=_MAX_BYTES))]
    spec = mujoco.MjSpec.from_file(str(path))
    put_into(spec, vehicle.parameters, force_law_block(vehicle.parameters))
    for ordinal, role in enumerate(ACTUATORS):
        user = np.asarray(spec.actuator(role).userdata)
        numbers = {"user": user if ordinal == ROTOR else user[: PARAM.ordinal + 1]}
        if role == "PED":
            kept = spec.actuator(role).nsample
            delays = [[spec.actuator(role).delay], [kept]] if kept else [[], []]
            numbers |= dict(zip(("delay", "nsample"), map(np.array, delays)))
        yield Change.to(_found(path, found, "general", role), numbers)
    seen = spec.sensor("gyro_rate")
    timing = {
        "interval": np.asarray(seen.interval),
        "nsample": [seen.nsample],
        "delay": [seen.delay] if seen.delay else [],
    }
    yield Change.to(_found(path, found, "gyro", "gyro_rate"), timing)
    fuselage = _found(path, found, "body", "fuselage")
    own = takewhile(lambda one: one.tag != "body", found[found.index(fuselage) + 1 :])
    inertial = next((one for one in own if one.attribute("fullinertia")), None)
    if inertial is None:
        raise ModelError(f"{fuselage.place} {NEEDS_INERTIAL}")
    own = spec.body("fuselage")
    body = {"pos": own.ipos, "mass": [own.mass], "fullinertia": own.fullinertia}
    yield Change.to(inertial, {name: np.asarray(value) for name, value in body.items()})
    data, hover = vehicle.hovering(), _found(path, found, "key", "hover")
    moving = data.qvel if np.any(data.qvel) else np.array([])
    state = {"qpos": data.qpos, "qvel": moving, "ctrl": data.ctrl, "act": data.act}
    rounded = {name: np.round(kept, _DECIMALS) for name, kept in state.items()}
    yield Change.to(hover, rounded, solved=10.0 * 10.0**-_DECIMALS)


def _found(path: Path, among: Sequence[Element], tag: str, name: str) -> Element:
    for one in among:
        if one.tag == tag and one.name == name:
            return one
    raise ModelError(f'{path}: no <{tag} name="{name}"/> in this file: add it')


def _text(numbers: Sequence[float] | NDArray[np.float64]) -> str:
    words = [str(int(n)) if abs(n) < 1e15 and n == int(n) else repr(float(n)) for n in numbers]
    text = " ".join(words)
    if len(text) <= _WIDTH:
        return text
    lines = textwrap.wrap(text, _WIDTH, break_long_words=False, break_on_hyphens=False)
    return "".join(f"\n      {line}" for line in lines)
