"""The option --band: one for all responses, and others by response."""

import argparse
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.common import names

Band = tuple[float, float]

_FORMS = "--band takes LO HI, or for one response p/lat=LO:HI, in rad/s"


class Bands(NamedTuple):
    """What --band says, rad/s.

    Attributes:
        common: of all responses that have none of their own; None leaves it to the records.
        own: by response.
    """

    common: Band | None
    own: Mapping[str, Band]

    @classmethod
    def of(cls, options: argparse.Namespace) -> "Bands":
        """Return what the options say. Raises InputError."""
        common, own = None, {}
        for item in [one for text in options.band for one in names(text)]:
            response, equals, edges = item.rpartition("=")
            if not equals and common is not None:
                raise InputError(f"{_FORMS}; LO HI was given twice")
            if equals:
                own[response.strip()] = _edges(edges, item)
            else:
                common = _edges(edges, item)
        return cls(common, own)

    def around(self, common: Band) -> Band:
        """Return the band that holds `common` and all responses' own."""
        low, high = common
        edges = list(self.own.values())
        return min([low, *(edge[0] for edge in edges)]), max([high, *(edge[1] for edge in edges)])

    def check(self, fitted: Sequence[str]) -> None:
        """Raise UnknownNameError if a band's response is not one of those fitted."""
        for response in self.own:
            if response not in fitted:
                raise UnknownNameError("response of --band", response, fitted)

    def by_response(self, fitted: Sequence[str], default: Band) -> dict[str, Band] | None:
        """Return each fitted response's band, `default` without a common one; None if no own."""
        common = dict.fromkeys(fitted, self.common or default)
        return common | dict(self.own) if self.own else None


def joined(words: Sequence[str]) -> list[str]:
    """Return a command line with `--band LO HI` as one word, so that argparse takes it."""
    result = list(words)
    for k in range(len(result) - 3, -1, -1):
        if result[k].startswith("--ba") and all(map(_is_number, result[k + 1 : k + 3])):
            result[k : k + 3] = [f"--band={result[k + 1]}:{result[k + 2]}"]
    return result


def _edges(text: str, item: str) -> Band:
    low, _, high = text.partition(":")
    if not (_is_number(low) and _is_number(high)):
        raise InputError(f"{_FORMS}; got {item!r}")
    return float(low), float(high)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
