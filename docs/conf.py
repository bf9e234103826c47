"""How Sphinx builds the site: `sphinx-build -W docs docs/_build`."""

import os
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.writers.html5 import HTML5Translator

import helisim
from helisim.cli import command_names, parser
from helisim.cli.options import Parser

os.environ["COLUMNS"] = "80"

project = "helisim"
author = "The helisim developers"
copyright = author
release = helisim.__version__

extensions = [
    "myst_parser",  # pages in Markdown
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",  # Args, Returns, Raises as the docstrings write them
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "paper"]
html_theme = "furo"
html_math_renderer = "mathml"
html_title = f"helisim {release}"
html_static_path: list[str] = []

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_google_docstring = True
napoleon_use_ivar = True  # "Attributes" describe the fields and do not declare them twice


class Commands(SphinxDirective):
    """What each command says of itself: its --help, under its name."""

    def run(self) -> list[nodes.Node]:
        """Return a section a command, within it those of its parts."""
        return [self._section(parser([name]), "command", name) for name in command_names()]

    def _section(self, whole: Parser, kind: str, name: str) -> nodes.Node:
        (choices,) = (one.choices for one in whole._actions if one.dest == kind)
        command = choices[name]
        label = command.prog.replace(" ", "-")
        section = nodes.section(ids=[label], names=[label])
        section += nodes.title(text=command.prog)
        text = command.format_help()
        section += nodes.literal_block(text, text, language="text")
        self.state.document.note_implicit_target(section, section)
        for parts in (one.choices for one in command._actions if one.dest == "part"):
            section += [self._section(command, "part", part) for part in parts]
        return section


def mathml(writer: HTML5Translator, node: nodes.math | nodes.math_block) -> None:
    """Write an equation as MathML, which browsers draw without a script or a network."""
    writer.body.append(tex2mathml(node.astext(), as_block=isinstance(node, nodes.math_block)))
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive and how equations are written."""
    app.add_directive("commands", Commands)
    app.add_html_math_renderer("mathml", (mathml, None), (mathml, None))
    return {"parallel_read_safe": True}
