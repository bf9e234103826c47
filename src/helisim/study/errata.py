"""Errors in the paper, each with its calculation (`errata.toml`)."""

from dataclasses import dataclass
from pathlib import Path

from helisim.base.files import read_toml


@dataclass(frozen=True, kw_only=True)
class Erratum:
    """One statement of the paper that its own numbers contradict."""

    title: str
    where: str
    printed: str
    calculation: str
    computed: str
    conclusion: str


def errata() -> tuple[Erratum, ...]:
    """Return all known errors of the paper, in the order of its sections."""
    return tuple(Erratum(**one) for one in read_toml(Path(__file__).with_suffix(".toml"))["errata"])
