"""Sections of a run's report beyond its models: ground tests, the gyro's effect, eq. (8)."""

from collections.abc import Mapping
from typing import Any

from helisim.output import html
from helisim.output.html import Cell
from helisim.output.report_tables import number


def ground_section(tests: Mapping[str, Any]) -> str:
    """Return what the rigs found, `results["ground"]`."""
    parts = []
    for rig, test in tests.items():
        rows = [
            (
                Cell(found["name"], "name"),
                Cell(found["unit"], "unit"),
                _value(f"ground.{rig}.{found['name']}.value", found["value"]),
                _value(f"ground.{rig}.{found['name']}.truth", found["truth"]),
                _value(f"ground.{rig}.{found['name']}.standard_error", found["standard_error"]),
                Cell(found["how"], "long"),
            )
            for found in test["findings"]
        ]
        headings = ("found", "unit", "value", "truth", "std error", "how")
        parts += [
            html.heading(test["rig"]),
            html.table(headings, rows, ("found", "unit", "how")),
            html.bullets(test["notes"]),
        ]
    return "\n".join(parts)


def before_after_section(found: Mapping[str, Any]) -> str:
    """Return the roll-pitch model before and after the gyro, `results["before_after"]`."""
    if not found:
        return ""
    columns = ("paper_before", "paper_after", "paper_ratio", "before", "after", "ratio")
    rows = [
        (
            Cell(one["name"], "name"),
            Cell(one["unit"], "unit"),
            *(_value(f"before_after.{one['name']}.{column}", one[column]) for column in columns),
        )
        for one in found["changes"]
    ]
    headings = (
        *("parameter", "unit", "paper IN1", "paper IN2", "paper ratio"),
        *("identified IN1", "identified IN2", "identified ratio"),
    )
    said = [
        (
            Cell(one["said"], "name long"),
            Cell(one["paper"], "long"),
            Cell(one["identified"], "long"),
        )
        for one in found["statements"]
    ]
    sides = ("the paper says", "its table", "identified")
    return (
        html.paragraph(
            "The same structure from the servos (IN1: the base helicopter) and from the sticks "
            "(IN2: the helicopter with its gyro).",
            "note",
        )
        + html.table(headings, rows, ("parameter", "unit"))
        + html.table(sides, said, sides)
    )


def overall_section(found: Mapping[str, Any]) -> str:
    """Return the overall yaw model from its parts beside the direct one, `results["eq_8"]`."""
    if not found:
        return ""
    columns = ("paper", "parts", "direct", "difference_percent")
    rows = [
        (
            Cell(one["name"], "name"),
            Cell(one["unit"], "unit"),
            *(_value(f"eq_8.{one['name']}.{column}", one[column]) for column in columns),
        )
        for one in found["coefficients"]
    ]
    low, high = found["band_rad_s"]
    text = (
        f"Base helicopter and gyro, put together by eq. (5), against the model identified from "
        f"[IN2 OUT] directly. From {low:.3g} to {high:.3g} rad/s their responses differ by at most "
        f"{abs(found['gain_db']):.3g} dB (at {found['gain_at_rad_s']:.3g} rad/s) and "
        f"{abs(found['phase_deg']):.3g} degrees (at {found['phase_at_rad_s']:.3g} rad/s)."
    )
    headings = ("coefficient", "unit", "paper", "from parts", "direct", "difference %")
    return html.paragraph(text) + html.table(headings, rows, ("coefficient", "unit"))


def _value(key: str, value: float | None) -> Cell:
    return Cell("-") if value is None else number(key, value, digits=4)
