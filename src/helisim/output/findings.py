"""What a run found beside its tables, as text of 80 columns."""

import textwrap
from collections.abc import Mapping, Sequence

from helisim.ident import Verification
from helisim.paper.eq8 import OverallCheck
from helisim.paper.gyro_effect import BeforeAfter, Change
from helisim.study.results import Plain

_WIDTH = 80


def render_further(found: Mapping[str, Plain | Mapping[str, Plain]]) -> tuple[str, ...]:
    """Return a block of lines for each thing that there is to say beside the tables."""
    blocks = []
    for one in found.values():
        if isinstance(one, BeforeAfter):
            blocks.append(render_before_after(one))
        elif isinstance(one, OverallCheck):
            blocks.append(render_overall(one))
        elif isinstance(one, Mapping):
            checked = {name: item for name, item in one.items() if isinstance(item, Verification)}
            blocks += [render_verifications(checked)] if checked else []
    return tuple(blocks)


def render_before_after(found: BeforeAfter) -> str:
    """Return the roll-pitch parameters before and after the gyro, and what is said of them."""
    heading = ("parameter", "unit", "paper IN1", "IN2", "ratio", "found IN1", "IN2", "ratio")
    lines = [
        "Before and after the gyro: roll-pitch from IN1 and from IN2",
        *_columns([heading, *(_change(one) for one in found.changes)]),
    ]
    for statement in found.statements:
        lines.append(_wrapped(f'- said: "{statement.said}"'))
        lines.append(_wrapped(f"  paper: {statement.paper}"))
        lines.append(_wrapped(f"  found: {statement.identified}"))
    return "\n".join(lines)


def _change(one: Change) -> tuple[str, ...]:
    paper = (f"{one.paper_before:.4g}", f"{one.paper_after:.4g}", f"{one.paper_ratio:.3f}")
    found = (f"{one.before:.4g}", f"{one.after:.4g}", f"{one.ratio:.3f}")
    return (one.name, one.unit, *paper, *found)


def render_overall(found: OverallCheck) -> str:
    """Return eq. (8) as printed, from the parts, and identified directly."""
    heading = ("coefficient", "unit", "paper", "from parts", "direct", "difference %")
    rows = [
        (
            one.name,
            one.unit,
            f"{one.paper:.5g}",
            f"{one.parts:.5g}",
            f"{one.direct:.5g}",
            f"{one.difference_percent:+.2f}",
        )
        for one in found.coefficients
    ]
    low, high = found.band_rad_s
    responses = (
        f"Largest differences from {low:.3g} to {high:.3g} rad/s: {found.gain_db:+.2f} dB at "
        f"{found.gain_at_rad_s:.3g} rad/s, {found.phase_deg:+.1f} degrees at "
        f"{found.phase_at_rad_s:.3g} rad/s."
    )
    title = "Eq. (8) by eq. (5) from base, gyro and ground tests, beside the one identified"
    return "\n".join([title, *_columns([heading, *rows]), _wrapped(responses)])


def render_verifications(found: Mapping[str, Verification]) -> str:
    """Return J_rms and Theil's coefficient of each verified model."""
    heading = ("verified on doublets", "output", "unit", "J_rms", "TIC")
    rows = [
        (
            name,
            output,
            unit,
            f"{checked.j_rms_by_output[output]:.4f}",
            f"{checked.tic_by_output[output]:.3f}",
        )
        for name, checked in found.items()
        for output, unit in zip(checked.outputs, checked.units)
    ]
    return "\n".join(_columns([heading, *rows]))


def _columns(rows: Sequence[tuple[str, ...]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows)]
    words = sum(not _is_number(cell) for cell in rows[-1])
    return [
        "  ".join(
            cell.ljust(width) if k < words else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths))
        ).rstrip()
        for row in rows
    ]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _wrapped(text: str) -> str:
    return textwrap.fill(text, _WIDTH, subsequent_indent="         ")
