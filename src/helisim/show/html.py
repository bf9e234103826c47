"""The few pieces of HTML that the reports are made of; every text is escaped here."""

import base64
import hashlib
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from typing import Literal

from helisim.show.svg import Drawing, page_style
from helisim.show.table import Cell, Table


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
    style, script = _file("report.css"), _file("report.js")
    # The policy makes it certain that nothing is fetched, and no other script runs.
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<link rel="icon" href="data:,">\n'
        f"<title>{escape(title)}</title>\n<style>\n{page_style()}{style}</style>\n</head>\n<body>\n"
        '<nav aria-label="Sections"><button popovertarget="sections">\u2630 Sections</button>'
        f'<div id="sections" popover>{links}</div></nav>\n'
        f"<main>\n<h1>{escape(title)}</h1>\n{head}\n{body}\n</main>\n"
        f"<script>{script}</script>\n</body>\n</html>\n"
    )


def _file(name: str) -> str:
    return files("helisim.show").joinpath(name).read_text(encoding="utf-8")


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


def folded_list(summary: str, items: Iterable[str]) -> str:
    """Return a list that opens on a click, or nothing for no items."""
    inner = bullets(items)
    return f"<details><summary>{escape(summary)}</summary>{inner}</details>" if inner else ""


def preformatted(text: str) -> str:
    """Return text of a file, line by line."""
    return f"<pre>{escape(text)}</pre>"


def table(shown: Table) -> str:
    """Return the rows of a table, which become cards on a phone; nothing for no rows."""
    if not shown.rows:
        return ""
    names = [column.page_heading for column in shown.columns]
    sides = ["text" if column.left else "" for column in shown.columns]
    head = "".join(
        f'<th scope="col"{_style(side)}>{escape(name)}</th>' for name, side in zip(names, sides)
    )
    body = "".join(
        "<tr>" + "".join(map(_cell, row, texts, names, sides)) + "</tr>\n"
        for row, texts in zip(shown.rows, shown.texts)
    )
    return (
        f'<table class="cards" aria-label="{escape(shown.title)}">\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table>"
    )


def figures(drawings: Iterable[Drawing], *, anchors: bool = True) -> str:
    """Return drawings side by side as far as the page is wide, or nothing for none.

    Args:
        drawings: of which each is a figure.
        anchors: False leaves out their names, in a page that isn't ours.
    """
    inner = "\n".join(
        f"<figure{_anchor(drawing) if anchors else ''}>{drawing.inline}"
        f"<figcaption>{escape(drawing.caption)}</figcaption></figure>"
        for drawing in drawings
    )
    return f'<div class="figures">\n{inner}\n</div>' if inner else ""


def photograph(png: bytes, title: str, caption: str) -> str:
    """Return a picture that is wider than a figure."""
    data = base64.b64encode(png).decode()
    return (
        f'<figure class="photograph"><img alt="{escape(title)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def side_by_side(blocks: Iterable[tuple[str, Literal[1, 2, 4]]]) -> str:
    """Return blocks of HTML beside each other, each with its columns of the four of a wide page."""
    inner = "\n".join(f'<div class="span{columns}">{block}</div>' for block, columns in blocks)
    return f'<div class="blocks">\n{inner}\n</div>' if inner else ""


def _cell(cell: Cell, text: str, label: str, side: str) -> str:
    style = _style(f"{side} {cell.style}".strip())
    key = f' data-key="{escape(cell.key)}"' if cell.key else ""
    value = "" if cell.value is None else f' data-value="{cell.value!r}"'
    tag, scope = ("th", ' scope="row"') if "name" in cell.style.split() else ("td", "")
    label = f' data-label="{escape(label)}"'
    return f"<{tag}{scope}{style}{label}{key}{value}>{escape(text)}</{tag}>"


def _anchor(drawing: Drawing) -> str:
    return f' id="{escape(drawing.name)}"'


def _style(style: str) -> str:
    return f' class="{style}"' if style else ""
