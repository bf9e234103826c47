"""Printed texts of commands: tables and sentences in 80 columns."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from helisim.records.record import IN1
from helisim.show import tables
from helisim.show.table import Table, as_text, filled, number
from helisim.sim.rigs import RigTest
from helisim.study.check import VehicleCheck
from helisim.study.comparison import ComparisonTable
from helisim.study.errata import Erratum
from helisim.study.results import Results
from helisim.vehicle import Linearization, Vehicle

_ERRATUM = (
    ("printed:", "printed"),
    ("calculated:", "calculation"),
    ("so:", "computed"),
    ("", "conclusion"),
)
_UNITS = {
    "mass": " kg",
    "disc_loading": " N/m^2",
    "tip_speed": " m/s",
    "collective": " rad of blade pitch",
    "power": " W of main and tail rotor",
}
_ZERO_POLE = 1e-6  # rad/s, below which poles are integrals, such as position and heading


def render_comparison(table: ComparisonTable, *, verbose: bool = False) -> str:
    """Return one model's table; if `verbose` with its notes."""
    shown = tables.comparison(table)
    return as_text(shown if verbose else replace(shown, notes=()))


def render_results(results: Results, *, verbose: bool = False, printed: bool = False) -> str:
    """Return tables unless `printed`, what was left out and missed; if `verbose` all else found."""
    blocks = [render_comparison(one, verbose=verbose) for one in results.tables if not printed]
    others: dict[Callable[[Any], Table], Any] = {
        tables.verification: results.verification,
        tables.gyro_changes: results.gyro_effect,
        tables.overall: results.eq_8,
    }
    blocks += [as_text(tabled(one)) for tabled, one in others.items() if one and verbose]
    if results.excluded:
        blocks.append(_list("Left out:", [one.message for one in results.excluded]))
    if results.misses:
        blocks.append(_list(f"{len(results.misses)} missed:", results.misses))
    elif results.tables:
        blocks.append("All tolerances hold.")
    return "\n\n".join(blocks)


def render_rigs(tests: Sequence[RigTest]) -> str:
    """Return findings of ground tests beside the truth."""
    return "\n\n".join(as_text(tables.rig(test)) for test in tests)


def render_errata(found: Sequence[Erratum]) -> str:
    """Return numbered errata with their calculations."""
    return "\n\n".join(
        "\n".join(
            [
                filled(f"{one.title} ({one.where})", f"{k}. "),
                *(filled(getattr(one, name), f"   {label:<12}") for label, name in _ERRATUM),
            ]
        )
        for k, one in enumerate(found, 1)
    )


def render_trims(flights: Sequence[Vehicle]) -> str:
    """Return level flights by speed, and the one of least power."""
    least = min(flights, key=lambda flight: flight.power)
    return f"{as_text(tables.trims(flights))}\n\n" + filled(
        f"Least power: {least.power:.1f} W at {least.trim.speed:g} m/s. Controls are those of "
        "swashplate and tail, unitised; a and b are the disc's tilt back and to the right of the "
        "mast."
    )


def render_check(found: VehicleCheck) -> str:
    """Return a vehicle's problems in number, and its figures in the hover."""
    count = len(found.problems)
    said = f"{count} problem{'s' if count > 1 else ''}." if count else "All is well."
    rows = {
        name.replace("_", " ").replace("lock n", "Lock n"): f"{value:.4g}{_UNITS.get(name, '')}"
        for name, value in found.figures.items()
    }
    for axis, left in found.margins.items():
        rows[f"{axis} margins"] = (
            f"{left.gain_db:.1f} dB, {left.phase_deg:.0f} deg, crossover {left.crossover:.3g} rad/s"
        )
    lines = [filled(text, f"{name:<24}") for name, text in rows.items()]
    return "\n".join([f"{found.name}: {said}", *([""] if lines else []), *lines])


def render_derivatives(linear: Linearization, derivatives: Mapping[str, float]) -> str:
    """Return a hover, its derivatives and its eigenvalues."""
    trim = linear.trim
    controls = (f"{name} {number(getattr(trim, name), '.4f')}" for name in IN1)
    lines = [
        f"Hover: phi {number(trim.phi, '.5f')} rad, theta {number(trim.theta, '.5f')} rad",
        f"  controls {', '.join(controls)}",
        "",
        "Derivatives of the base helicopter (SI, per unit of servo position)",
        *(f"  {name:<6} {number(x, '.6g'):>12}" for name, x in derivatives.items()),
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


def _list(heading: str, sentences: Sequence[str]) -> str:
    return "\n".join([heading, *(filled(text, "- ") for text in sentences)])
