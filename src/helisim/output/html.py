"""The few pieces of HTML that the reports are made of; every text is escaped here."""

import base64
from collections.abc import Iterable
from html import escape
from importlib.resources import files

from helisim.output.plots import Drawing
from helisim.output.table import Cell, Table


def page(title: str, sections: Iterable[tuple[str, str, str]], head: str) -> str:
    """Return a whole document that needs nothing but itself.

    Args:
        title: of the document.
        sections: anchor, heading and inner HTML of each.
        head: inner HTML between the title and the list of sections.
    """
    kept = [section for section in sections if section[2]]
    links = "".join(f'<a href="#{anchor}">{escape(name)}</a>' for anchor, name, _ in kept)
    body = "\n".join(
        f'<section id="{anchor}">\n<h2>{escape(name)}</h2>\n{inner}\n</section>'
        for anchor, name, inner in kept
    )
    style = files("helisim.output").joinpath("report.css").read_text(encoding="utf-8")
    # The policy makes it certain that nothing is fetched and no script runs.
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<link rel="icon" href="data:,">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n{head}\n<nav>{links}</nav>\n{body}\n</body>\n</html>\n"
    )


def paragraph(text: str, style: str = "") -> str:
    """Return a paragraph, or nothing for no text."""
    if not text:
        return ""
    return f'<p class="{style}">{escape(text)}</p>' if style else f"<p>{escape(text)}</p>"


def heading(text: str) -> str:
    """Return a heading inside a section."""
    return f"<h3>{escape(text)}</h3>"


def bullets(items: Iterable[str]) -> str:
    """Return a list, or nothing for no items."""
    inner = "".join(f"<li>{escape(item)}</li>" for item in items)
    return f"<ul>{inner}</ul>" if inner else ""


def folded(summary: str, text: str) -> str:
    """Return text that opens on a click."""
    return f"<details><summary>{escape(summary)}</summary><pre>{escape(text)}</pre></details>"


def table(shown: Table) -> str:
    """Return the rows of a table, which become cards on a phone; nothing for no rows."""
    if not shown.rows:
        return ""
    names = [column.page_heading for column in shown.columns]
    sides = ["text" if column.left else "" for column in shown.columns]
    head = "".join(f"<th{_style(side)}>{escape(name)}</th>" for name, side in zip(names, sides))
    body = "".join(
        "<tr>" + "".join(map(_cell, row, texts, names, sides)) + "</tr>\n"
        for row, texts in zip(shown.rows, shown.texts)
    )
    return (
        f'<table class="cards">\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table>'
    )


def figures(drawings: Iterable[Drawing]) -> str:
    """Return drawings side by side as far as the page is wide, or nothing for none."""
    made = [_figure(drawing) for drawing in drawings]
    style = "figures pairs" if len(made) % 2 == 0 else "figures"  # none is left alone in a row
    inner = "\n".join(made)
    return f'<div class="{style}">\n{inner}\n</div>' if made else ""


def photograph(png: bytes, title: str, caption: str) -> str:
    """Return a picture that is wider than a figure."""
    return _picture('class="photograph"', "image/png", png, title, caption)


def side_by_side(blocks: Iterable[tuple[str, bool]]) -> str:
    """Return blocks of HTML beside each other; one that is marked wide has a row of its own."""
    inner = "\n".join(
        f'<div class="wide">{block}</div>' if wide else f"<div>{block}</div>"
        for block, wide in blocks
    )
    return f'<div class="blocks">\n{inner}\n</div>'


def _figure(drawing: Drawing) -> str:
    # As an image, not inline: identifiers of several drawings can't meet.
    mark, svg = f'id="{escape(drawing.name)}"', drawing.svg.encode()
    return _picture(mark, "image/svg+xml", svg, drawing.title, drawing.caption)


def _picture(mark: str, kind: str, contents: bytes, title: str, caption: str) -> str:
    data = base64.b64encode(contents).decode()
    return (
        f'<figure {mark}><img alt="{escape(title)}" src="data:{kind};base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def _cell(cell: Cell, text: str, label: str, side: str) -> str:
    style = _style(f"{side} {cell.style}".strip())
    key = f' data-key="{escape(cell.key)}"' if cell.key else ""
    value = "" if cell.value is None else f' data-value="{cell.value!r}"'
    return f'<td{style} data-label="{escape(label)}"{key}{value}>{escape(text)}</td>'


def _style(style: str) -> str:
    return f' class="{style}"' if style else ""
