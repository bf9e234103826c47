"""A third vehicle for the tests: all its own, of any size, built from nothing in a folder.

Three blades that turn counter-clockwise, an H3-140 swashplate with its servo behind, more travel.
Sizes are Froude's: lengths scale with n, masses with n^3, times and speeds with the root of n.
"""

import shutil
from pathlib import Path
from xml.etree import ElementTree

from helisim.vehicle.parameters import model_folder, term

TARGETS = {
    "tau_f": 0.0360, "A_b": 0.300, "B_a": -0.360, "A_lat": -0.040, "A_lon": 0.300, "B_lat": 0.310,
    "B_lon": 0.050, "Z_w": -1.10, "Z_col": -50.0, "N_r": -0.84, "N_ped": 62.0, "L_b": 1130.0,
    "M_a": 402.0,
}  # fmt: skip
"""What the vehicle of size 1 is calibrated to.

The signs of A_b, B_a, A_lat and B_lon are those of a rotor that turns counter-clockwise.
"""

_GIVEN = Path(__file__).with_name("heron.txt").read_text(encoding="utf-8")
"""The parameters at size 1."""

_POWERS = {"m": 1.0, "m^2": 2.0, "kg m^2": 5.0, "s/rad": 0.5, "rad/s^2": -1.0, "1/s^2": -1.0}
_POWERS |= dict.fromkeys(("rad/s", "1/s", "s/m", "rad s/m"), -0.5)
"""Of n, by unit; servos and the times of gyro and recorder don't scale."""


def build(folder: Path, *, size: float = 1.0) -> Path:
    """Write the vehicle's folder, not calibrated and not tuned, and return it.

    folder: made; its name is the vehicle's; size: n, masses are n^3 times 4.2 kg.
    """
    folder.mkdir(parents=True)
    (folder / "parameters.toml").write_text(_toml(size))
    (folder / f"{folder.name}.xml").write_text(_mjcf(size))
    return folder


def _toml(size: float) -> str:
    sections = {"targets": dict(TARGETS)}
    for section, items in (line.split(": ") for line in _GIVEN.split("\n") if line):
        values = (item.split() for item in items.split(", "))
        sections.setdefault(section, {}).update({key: float(value) for key, value in values})
    lines = []
    for section, entries in sections.items():
        lines += ["", f"[{section}]"]
        for name, value in entries.items():
            known = term(f"{section}.{name}")
            assert known is not None
            unit = known.unit
            power = 0.5 if name == "tau_f" else _POWERS.get(unit, 0.0)
            scaled = value if section == "servo" else value * size**power
            lines.append(f'{name} = {{ value = {scaled!r}, unit = "{unit}", source = "chosen" }}')
    return "\n".join(lines) + "\n"


_SCALED = {"pos": 1, "size": 1, "fromto": 1, "mass": 3, "fullinertia": 5, "diaginertia": 5}
"""Power of n of each attribute of the MJCF."""


def _mjcf(n: float) -> str:
    """Return the MJCF of a vehicle of size n, from that of size 1 beside this file."""
    tree = ElementTree.parse(Path(__file__).with_name("heron.xml")).getroot()
    for one in tree.iter():
        for name in _SCALED.keys() & one.attrib.keys():
            numbers = (float(number) * n ** _SCALED[name] for number in one.attrib[name].split())
            one.attrib[name] = " ".join(map(repr, numbers))
    return ElementTree.tostring(tree, encoding="unicode")


def copied(folder: Path, like: str = "jr700") -> Path:
    shutil.copytree(model_folder(like), folder, ignore=shutil.ignore_patterns("*.png", "build.py"))
    return folder


def edited(folder: Path, file: str, old: str, new: str) -> int:
    """Replace what stands once in a file of a folder; return the number of its line."""
    text = (folder / file).read_text()
    assert text.count(old) == 1, (file, old, text.count(old))
    (folder / file).write_text(text.replace(old, new))
    return text[: text.index(old)].count("\n") + 1
