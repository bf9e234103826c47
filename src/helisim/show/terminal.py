"""The text that the commands print: tables with the sentences around them, in 80 columns."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, TextIO

import numpy as np

from helisim.design.laws import Law
from helisim.records.record import IN1
from helisim.show import tables
from helisim.show.table import GREEN, NO_BREAK, RED, as_text, filled, formatted, paint
from helisim.sim.rigs import RigTest
from helisim.study.check import VehicleCheck
from helisim.study.errata import Erratum
from helisim.study.results import Results
from helisim.vehicle import Linearization, Vehicle

_ZERO_POLE = 1e-6
"""rad/s: smaller poles are integrals, such as position and heading, which nothing holds."""


def wants_color(stream: TextIO, environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether to colour text for a stream: on a terminal, unless NO_COLOR is set."""
    if environment.get("NO_COLOR") or environment.get("TERM") == "dumb":
        return False
    return stream.isatty()


def render_results(results: Results, *, color: bool = False) -> str:
    """Return all tables, other findings, what was left out, and what missed its tolerance."""
    shown = [tables.comparison(table) for table in results.tables]
    if results.verification:
        shown.append(tables.verification(results.verification))
    blocks = [as_text(table, color=color) for table in shown]
    if results.gyro_effect is not None:
        effect = results.gyro_effect
        changes, said = tables.gyro_changes(effect), tables.gyro_statements(effect.statements)
        blocks.append("\n".join(as_text(table, color=color) for table in (changes, said)))
    if results.eq_8 is not None:
        blocks.append(as_text(tables.overall(results.eq_8), color=color))
    if results.excluded:
        blocks.append(_list("Left out:", [one.message for one in results.excluded]))
    if results.misses:
        heading = paint(f"{len(results.misses)} missed:", RED, color)
        blocks.append(_list(heading, results.misses))
    elif results.tables:
        blocks.append(paint("All tolerances hold.", GREEN, color))
    return "\n\n".join(blocks)


def render_rigs(tests: Sequence[RigTest]) -> str:
    """Return the findings of ground tests, each value beside the truth."""
    return "\n\n".join(as_text(tables.rig(test)) for test in tests)


def render_errata(found: Sequence[Erratum]) -> str:
    """Return the errata, numbered, each with its calculation."""
    return as_text(tables.errata(found))


def render_trims(flights: Sequence[Vehicle]) -> str:
    """Return level flights, a line for each speed, and the one of least power."""
    least = min(flights, key=lambda flight: flight.power)
    text = (
        f"Least power: {least.power:.1f} W at {least.trim.speed:g} m/s. Controls are those of "
        "swashplate and tail, unitised; a and b are the disc's tilt back and to the right of the "
        "mast."
    )
    return f"{as_text(tables.trims(flights))}\n\n{filled(text)}"


def render_check(found: VehicleCheck) -> str:
    """Return how many problems a vehicle has, remarks, and its figures in the hover."""
    count = len(found.problems)
    said = f"{count} problem{'s' if count > 1 else ''}." if count else "All is well."
    lines = [f"{found.name}: {said}"]
    if found.remarks:
        lines.append(_list("To know:", [str(remark) for remark in found.remarks]))
    own = found.figures
    if own is None:
        return "\n".join(lines)
    pair = f"{NO_BREAK}+-{NO_BREAK}"
    poles = (f"{one.real:.3g}" + f"{pair}{one.imag:.3g}j" * (one.imag > 0.0) for one in own.poles)
    rows = {
        "mass": f"{own.mass:.4g} kg",
        "disc loading": f"{own.disc_loading:.3g} N/m^2",
        "tip speed": f"{own.tip_speed:.4g} m/s",
        "solidity": f"{own.solidity:.3g}",
        "blade loading CT/sigma": f"{own.blade_loading:.3g}",
        "Lock number": f"{own.lock_number:.3g}, of the blades",
        "hover collective": f"{math.degrees(own.collective):.3g} deg of blade pitch",
        "hover power": f"{own.power:.4g} W of main and tail rotor",
        "figure of merit": f"{own.figure_of_merit:.3g}",
        "poles": f"{', '.join(poles)} rad/s",
    }
    for axis, left in found.margins.items():
        rows[f"{axis} margins"] = (
            f"{left.gain_db:.1f} dB, {left.phase_deg:.0f} deg, crossover {left.crossover:.3g} rad/s"
        )
    return "\n".join([*lines, "", *(filled(text, f"{name:<24}") for name, text in rows.items())])


def render_derivatives(linear: Linearization, derivatives: Mapping[str, float]) -> str:
    """Return a hover, its derivatives and its eigenvalues."""
    trim = linear.trim
    controls = (f"{name} {formatted(getattr(trim, name), '.4f')}" for name in IN1)
    lines = [
        f"Hover: phi {formatted(trim.phi, '.5f')} rad, theta {formatted(trim.theta, '.5f')} rad",
        f"  controls {', '.join(controls)}",
        "",
        "Derivatives of the base helicopter (SI, per unit of servo position)",
        *(f"  {name:<6} {formatted(x, '.6g'):>12}" for name, x in derivatives.items()),
        "",
        f"Eigenvalues of {linear.system.name}, rad/s",
    ]
    for pole in sorted(linear.system.poles(), key=lambda pole: (abs(pole), pole.imag)):
        if abs(pole) > _ZERO_POLE and pole.imag >= 0.0:
            pair = f" +- {pole.imag:.5g}j" if pole.imag > _ZERO_POLE else ""
            lines.append(f"  {pole.real:.5g}{pair}")
    if linear.delays:
        delays = ", ".join(f"{name} {delay:.4g} s" for name, delay in linear.delays.items())
        lines += ["", "Delays before the inputs act, not in the matrices", f"  {delays}"]
    return "\n".join(lines)


def law_text(law: Law, period: float) -> str:
    """Return what a law sees, commands and keeps, its poles at its ticks, and what is tuned.

    Args:
        law: of any kind.
        period: s, of its ticks.

    Raises:
        InputError: it can't tick so.
    """
    known: Any = law.linear(period)
    linear = known.sampled
    lines = [
        f"{law.kind}: {', '.join(linear.inputs)} -> {', '.join(linear.outputs)}",
        f"{len(linear.a)} states, each {1e3 * period:g} ms",
    ]
    upper = [complex(one) for one in np.linalg.eigvals(linear.a) if one.imag >= 0.0]
    poles = [_pole(one, period) for one in sorted(upper, key=lambda one: -abs(one))]
    lines += [filled(f"poles, rad/s: {', '.join(poles)}")] if poles else []
    tuned = law.parameters()
    width = max(map(len, tuned), default=0)
    lines += ["", *(f"{name:<{width}}  {value:.6g}" for name, value in tuned.items())]
    return "\n".join(lines).rstrip()


def _pole(z: complex, period: float) -> str:
    if abs(z) < 1e-9:
        return "a tick's delay"
    s = np.log(z) / period
    if abs(s) < _ZERO_POLE:
        return "0"
    turning = f" +- {s.imag:.3g}j" if abs(s.imag) > _ZERO_POLE else ""
    return f"{s.real:.3g}{turning}"


def _list(heading: str, sentences: Sequence[str]) -> str:
    return "\n".join([heading, *(filled(text, "- ") for text in sentences)])
