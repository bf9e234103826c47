"""Ground tests and the paper's errata as text of 80 columns."""

import textwrap
from collections.abc import Sequence

from helisim.paper.errata import Erratum
from helisim.sim.rigs import Finding, RigTest

_WIDTH = 80
_DIGITS = 5
_FORM = "  {:<12} {:>5} {:>12} {:>12} {:>10} {:>10}  {}"
_SMALL = 1e-6
"""A truth below this is a zero of the drawing: no percentage of it is given."""


def render_rigs(tests: Sequence[RigTest]) -> str:
    """Return what the rigs found, each value beside the truth."""
    return "\n\n".join(_rig(test) for test in tests)


def _rig(test: RigTest) -> str:
    heading = ("found", "unit", "value", "truth", "error", "std error", "error %")
    lines = [test.rig, _FORM.format(*heading).rstrip()]
    lines += [_finding(finding) for finding in test.findings]
    for note in test.notes:
        lines.append(_wrapped("", note[0].upper() + note[1:] + "."))
    return "\n".join(lines)


def _finding(finding: Finding) -> str:
    truth, error, share = "-", "-", ""
    if finding.truth is not None and finding.error is not None:
        rounded = 0.0 if abs(finding.truth) < _SMALL else finding.truth
        truth, error = f"{rounded:.{_DIGITS}g}", f"{finding.error:.1e}"
        if rounded != 0.0:
            share = f"{100.0 * finding.error / rounded:.2f}"
    spread = "-" if finding.standard_error is None else f"{finding.standard_error:.1e}"
    value = f"{finding.value:.{_DIGITS}g}"
    return _FORM.format(finding.name, finding.unit, value, truth, error, spread, share).rstrip()


def render_errata(found: Sequence[Erratum]) -> str:
    """Return the errata, numbered, each with its calculation."""
    blocks = []
    for number, erratum in enumerate(found, 1):
        title = f"{number}. {erratum.title} ({erratum.where})"
        lines = [textwrap.fill(title, _WIDTH, subsequent_indent="   ")]
        lines.append(_wrapped("printed", erratum.printed))
        lines.append(_wrapped("calculated", erratum.calculation))
        lines.append(_wrapped("so", erratum.computed))
        lines.append(_wrapped("", erratum.conclusion))
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def _wrapped(label: str, text: str) -> str:
    start = f"   {label + ':':<12}" if label else "   "
    return textwrap.fill(
        text,
        _WIDTH,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_on_hyphens=False,
    )
