"""The correlations between a fit's parameters as a map: which can stand in for which."""

from html import escape

from helisim.ident import Fit
from helisim.ident.fitting.result import CORRELATION_LIMIT

_CELL, _LETTER = 27.0, 6.3
"""Units of a cell's side, and of an average letter of a name."""
_NARROWEST = 320.0
"""Units of a map of few parameters: as much as a figure on a phone."""
_SHOWN = 0.5
"""Correlations from which a cell has its number."""


def correlation_map(fit: Fit) -> str:
    """Return a triangle of cells as a figure of a page; nothing of fewer than two parameters.

    Blue parameters rise together, orange ones one against the other; the stronger, the deeper.
    """
    names = [parameter.name for parameter in fit.structure.free]
    if len(names) < 2:
        return ""
    left = _LETTER * max(map(len, names)) + 10.0
    parts = []
    for row in range(1, len(names)):
        y = (row - 1) * _CELL
        parts.append(_words(left - 6.0, y + 17.5, names[row], "end"))
        for column in range(row):
            found = float(fit.correlation[row, column])
            parts.append(_cell(left + column * _CELL, y, found, f"{names[row]}, {names[column]}"))
    foot = (len(names) - 1) * _CELL
    for column, name in enumerate(names[:-1]):
        x, y = left + (column + 0.5) * _CELL + 4.0, foot + 6.0
        parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" transform="rotate(-90 {x:.1f} {y:.1f})" class="end">'
            f"{escape(name)}</text>"
        )
    width, height = max(left + foot + 2.0, _NARROWEST), foot + left
    caption = (
        "Correlations of the parameters' errors, numbers from 0.5. Two beyond "
        f"{CORRELATION_LIMIT:g} can stand in for each other: fix one, or fly what tells them apart."
    )
    return (
        f'<figure id="correlation_{escape(fit.structure.name)}"><svg class="drawing" role="img" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" style="max-width: {width:.0f}px">'
        f"<title>{escape(caption)}</title>{''.join(parts)}</svg><figcaption>{escape(caption)}</figcaption></figure>"
    )


def _cell(x: float, y: float, found: float, pair: str) -> str:
    ink = "identified" if found > 0.0 else "data"
    number = f"{found:.2f}".replace("0.", ".").replace("-", "\u2212")
    text = "" if abs(found) < _SHOWN else _words(x + 0.5 * _CELL, y + 17.5, number, "middle ink")
    return (
        f'<g><title>{escape(pair)}: {found:.3f}</title><rect class="frame" x="{x:.1f}" y="{y:.1f}" '
        f'width="{_CELL:g}" height="{_CELL:g}" style="fill: var(--{ink}); '
        f'fill-opacity: {0.75 * abs(found):.2f}; stroke: var(--grid)"/>{text}</g>'
    )


def _words(x: float, y: float, text: str, style: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" class="{style}">{escape(text)}</text>'
