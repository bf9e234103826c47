"""Self-contained HTML pages without scripts; all texts are escaped here."""

import json
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from helisim.base.files import write_text
from helisim.show.figure import COLOURS, Drawing, drawing_style
from helisim.show.table import Table

Section = tuple[str, str, str]  # anchor, heading and inner HTML; an empty section is left out

_VERDICTS = {  # a cell's word -> its CSS class
    "agrees": " ok",
    "differs": " off",
    "Level 1": " ok",
    "Level 2": " off",
    "Level 3": " off",
}


def write_page(path: Path, title: str, sections: Iterable[Section], head: str) -> Path:
    """Write a self-contained document and return its path; `head` is HTML. Raises StorageError."""
    kept = [section for section in sections if section[2]]
    text = Template(asset("page.html")).substitute(
        title=escape(title),
        style=style("report.css"),
        links="".join(f'<a href="#{anchor}">{escape(name)}</a>' for anchor, name, _ in kept),
        head=head,
        body="\n".join(
            f'<section id="{anchor}">\n<h2>{escape(name)}</h2>\n{inner}\n</section>'
            for anchor, name, inner in kept
        ),
    )
    write_text(path, text)
    return path


def asset(name: str) -> str:
    """Return the text of a file beside this module."""
    return files("helisim.show").joinpath(name).read_text(encoding="utf-8")


def style(name: str) -> str:
    """Return a CSS file beside this module, with colours and drawings' style."""
    variables = {name: f"var(--{name})" for name in COLOURS}
    colours = " ".join(f"--{name}: {colour};" for name, colour in COLOURS.items())
    return f":root, .helisim {{ {colours} }}\n{asset(name)}{drawing_style(variables)}\n"


def as_json(data: Any) -> str:
    """Return data as indented JSON."""
    return preformatted(json.dumps(data, indent=2, ensure_ascii=False, default=str))


def paragraph(text: str, style: str = "") -> str:
    """Return a paragraph, "" for no text."""
    return f'<p class="{style}">{escape(text)}</p>' if text else ""


def heading(text: str) -> str:
    """Return a heading inside a section."""
    return f"<h3>{escape(text)}</h3>"


def bullets(items: Iterable[str]) -> str:
    """Return a list, "" for no items."""
    inner = "".join(f"<li>{escape(item)}</li>" for item in items)
    return f"<ul>{inner}</ul>" if inner else ""


def preformatted(text: str) -> str:
    """Return text with its lines kept."""
    return f"<pre>{escape(text)}</pre>"


def folded(summary: str, inner: str) -> str:
    """Return HTML that opens on a click, "" for none."""
    return f"<details><summary>{escape(summary)}</summary>{inner}</details>" if inner else ""


def table(shown: Table) -> str:
    """Return a table's rows and notes, "" for no rows."""
    if not shown.rows:
        return ""
    names = [f"{one.heading}, {one.unit}" if one.unit else one.heading for one in shown.columns]
    sides = ["text" if column.left else "" for column in shown.columns]
    head = "".join(
        f'<th scope="col" class="{side}">{escape(name)}</th>' for name, side in zip(names, sides)
    )
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="{side}{_VERDICTS.get(text, "")}" data-label="{escape(name)}">'
            f"{escape(text)}</td>"
            for text, side, name in zip(row, sides, names)
        )
        + "</tr>\n"
        for row in shown.rows
    )
    notes = (
        paragraph(f"{_heading(label)}: {text}" if label else text, "note")
        for label, text in shown.notes
    )
    return (
        f'<table class="cards" aria-label="{escape(shown.title)}">\n'
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table>\n{''.join(notes)}"
    )


def block(shown: Table) -> str:
    """Return a table under its title."""
    lead = f"{shown.lead[:1].upper()}{shown.lead[1:]}." if shown.lead else ""
    return heading(shown.title) + paragraph(lead) + table(shown)


def figures(drawings: Iterable[Drawing], folder: Path | None = None) -> str:
    """Return drawings side by side, "" for none; write each into the folder too, if given."""
    parts = []
    for one in drawings:
        parts.append(
            f'<figure id="{escape(one.name)}">{one.inline}'
            f"<figcaption>{escape(one.caption)}</figcaption></figure>"
        )
        if folder is not None:
            one.write(folder)
    inner = "\n".join(parts)
    return f'<div class="figures">\n{inner}\n</div>' if inner else ""


def _heading(label: str) -> str:
    """Return a note's label with a capital, a parameter's name as it is."""
    return label if "_" in label else f"{label[:1].upper()}{label[1:]}"
