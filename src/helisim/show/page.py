"""Self-contained HTML pages of sections, and the pieces that they are made of.

Every text is escaped here. A page fetches nothing and runs no script but its own.
"""

import base64
import hashlib
import json
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, Literal

from helisim.base.files import atomic_write
from helisim.show.figure import Drawing, page_style
from helisim.show.table import Cell, Table

Section = tuple[str, str, str]
"""Anchor, heading and inner HTML; a section without any is left out."""


def write_page(path: Path, title: str, sections: Iterable[Section], head: str) -> Path:
    """Write a whole document that needs nothing but itself; return its path. Raises StorageError.

    Args:
        path: of the HTML file.
        title: of the document.
        sections: in order.
        head: inner HTML between the title and the list of sections.
    """
    kept = [section for section in sections if section[2]]
    script = asset("report.js")
    text = Template(asset("page.html")).substitute(
        digest=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        title=escape(title),
        style=page_style() + asset("report.css"),
        links="".join(f'<a href="#{anchor}">{escape(name)}</a>' for anchor, name, _ in kept),
        head=head,
        body="\n".join(
            f'<section id="{anchor}">\n<h2>{escape(name)}</h2>\n{inner}\n</section>'
            for anchor, name, inner in kept
        ),
        script=script,
    )
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def asset(name: str) -> str:
    """Return the text of a file that stands beside this module."""
    return files("helisim.show").joinpath(name).read_text(encoding="utf-8")


def as_json(data: Any) -> str:
    """Return data as a person reads it."""
    return json.dumps(data, indent=2, ensure_ascii=False, default=str)


def paragraph(text: str, style: str = "") -> str:
    """Return a paragraph, or nothing for no text."""
    return f"<p{_style(style)}>{escape(text)}</p>" if text else ""


def heading(text: str) -> str:
    """Return a heading inside a section."""
    return f"<h3>{escape(text)}</h3>"


def bullets(items: Iterable[str]) -> str:
    """Return a list, or nothing for no items."""
    inner = "".join(f"<li>{escape(item)}</li>" for item in items)
    return f"<ul>{inner}</ul>" if inner else ""


def preformatted(text: str) -> str:
    """Return text of a file, line by line."""
    return f"<pre>{escape(text)}</pre>"


def folded(summary: str, inner: str) -> str:
    """Return HTML that opens on a click, or nothing for none."""
    return f"<details><summary>{escape(summary)}</summary>{inner}</details>" if inner else ""


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


def block(shown: Table) -> str:
    """Return a table under its title, with its notes."""
    return "\n".join([heading(shown.title), table(shown), *notes(shown)])


def notes(shown: Table) -> list[str]:
    """Return the notes of a table as paragraphs."""
    return [
        paragraph(f"{label[:1].upper()}{label[1:]}: {text}." if label else text, "note")
        for label, text in shown.notes
    ]


def figures(drawings: Iterable[Drawing], *, anchors: bool = True) -> str:
    """Return drawings side by side as far as the page is wide, or nothing for none.

    Args:
        drawings: of which each is a figure.
        anchors: False leaves out their names, in a page that isn't ours.
    """
    inner = "\n".join(
        f"<figure{f' id={chr(34)}{escape(one.name)}{chr(34)}' if anchors else ''}>{one.inline}"
        f"<figcaption>{escape(one.caption)}</figcaption></figure>"
        for one in drawings
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
    inner = "\n".join(f'<div class="span{columns}">{one}</div>' for one, columns in blocks)
    return f'<div class="blocks">\n{inner}\n</div>' if inner else ""


def _cell(cell: Cell, text: str, label: str, side: str) -> str:
    style = _style(f"{side} {cell.style}".strip())
    key = f' data-key="{escape(cell.key)}"' if cell.key else ""
    value = "" if cell.value is None else f' data-value="{cell.value!r}"'
    tag, scope = ("th", ' scope="row"') if "name" in cell.style.split() else ("td", "")
    label = f' data-label="{escape(label)}"'
    return f"<{tag}{scope}{style}{label}{key}{value}>{escape(text)}</{tag}>"


def _style(style: str) -> str:
    return f' class="{style}"' if style else ""
