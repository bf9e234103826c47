"""The release: one version everywhere, a changelog, a citation."""

import re
from importlib.metadata import version
from pathlib import Path

import helisim

TOP = Path(__file__).parents[1]


def test_the_version_is_one():
    """`helisim.__version__` is where it stands; what can't read it from there repeats it."""
    own = helisim.__version__
    assert version("helisim") == own
    said = re.findall(r"^version: (\S+)$", (TOP / "CITATION.cff").read_text(encoding="utf-8"), re.M)
    assert said == [own]
    assert re.search(rf"^## {re.escape(own)}\b", (TOP / "CHANGELOG.md").read_text("utf-8"), re.M)
