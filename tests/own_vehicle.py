"""A vehicle of one's own: a copy of the JR700's folder, elsewhere, under other names."""

import re
import shutil
from pathlib import Path

from helisim.vehicle.folder import ROLES, model_folder

TAGS = {
    "body": "body",
    "site": "site",
    "geom": "geom",
    "actuator": "general",
    "sensor": r"(?:gyro|accelerometer|velocimeter|framequat|framepos|user|clock)",
    "keyframe": "key",
}
"""Kind -> tag of its elements in the shipped MJCF."""


def copied(folder: Path, like: str = "jr700") -> Path:
    """Copy a shipped vehicle to a folder, which gives it its name."""
    shutil.copytree(model_folder(like), folder, ignore=shutil.ignore_patterns("*.png", "build.py"))
    return folder


def renamed(folder: Path, like: str = "jr700") -> Path:
    """Copy a shipped vehicle and give every element of its MJCF another name, with the roles."""
    copied(folder, like)
    mjcf = folder / f"{like}.xml"
    text = mjcf.read_text()
    for kind, tag in TAGS.items():
        text = re.sub(rf'(<{tag} (?:[^>]*? )?name=")([^"]*)"', rf'\1my_\2_{kind}"', text)
    text = re.sub(r'(objname|site)="(\w+)"', lambda m: f'{m[1]}="{_referred(m[2], like)}"', text)
    text = text.replace('"root"', '"floating"')
    mjcf.rename(folder / "drawing.xml").write_text(text)
    for path in (folder / "scene.xml", *(folder / "rigs").glob("*.xml")):
        path.write_text(
            path.read_text()
            .replace(f"{like}.xml", "drawing.xml")
            .replace(f'body2="{like}"', f'body2="my_{like}_body"')
        )
    (folder / "scene.xml").rename(folder / "stage.xml")
    lines = ["[roles]", 'mjcf = "drawing.xml"', 'scene = "stage.xml"']
    for kind, roles in ROLES.items():
        lines += [f"[roles.{kind}]", *(f'{role} = "my_{role}_{kind}"' for role in roles)]
    with (folder / "parameters.toml").open("a") as file:
        file.write("\n".join(["", *lines, ""]))
    return folder


def _referred(name: str, like: str) -> str:
    return f"my_{name}_{'body' if name == like else 'site'}"


def edited(folder: Path, file: str, old: str, new: str) -> int:
    """Replace what stands once in a file of a folder; return the number of its line."""
    text = (folder / file).read_text()
    assert text.count(old) == 1, (file, old, text.count(old))
    (folder / file).write_text(text.replace(old, new))
    return text[: text.index(old)].count("\n") + 1
