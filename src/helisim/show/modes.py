"""Poles and zeros of an identified model as a table."""

from helisim.base.errors import IdentificationError
from helisim.ident import Fit, Mode, Modes
from helisim.ident.fitting.modes import mode_notes
from helisim.show.table import Cell, Column, Table, number, words

_ERROR = ".2g"
"""How a standard error is written."""


def table(found: Modes) -> Table:
    """Return poles, then the zeros of each response, slowest first, with standard errors."""
    rows = [_row("pole", f"modes.poles.{k}", one) for k, one in enumerate(found.poles)]
    rows += [
        _row(f"zero {name}", f"modes.zeros.{name}.{k}", one)
        for name, some in found.zeros.items()
        for k, one in enumerate(some)
    ]
    return Table(
        "Modes",
        (
            Column("mode", left=True),
            *(Column("real", unit="1/s"), Column("imaginary", unit="rad/s", page_only=True)),
            *(Column("frequency", unit="rad/s"), Column("error", unit="rad/s")),
            *(Column("damping"), Column("error", label="error of damping")),
            *(Column("time", unit="s", label="time constant"), Column("error", unit="s")),
            Column("", left=True),
        ),
        tuple(rows),
        notes=(("error", "standard error, from the parameters' covariance"),),
    )


def of_fit(fit: Fit) -> Table:
    """Return the modes of a fit, without rows where it has none."""
    try:
        return table(fit.modes)
    except IdentificationError:  # M is singular
        return table(Modes((), {}, {}))


def _row(name: str, key: str, one: Mode) -> tuple[Cell, ...]:
    damped = one.oscillates
    return (
        words(name, "name"),
        number(one.real, unit="1/s"),
        number(one.imag if damped else None, unit="rad/s"),
        number(one.frequency, unit="rad/s", key=f"{key}.frequency_rad_s"),
        number(one.frequency_error, _ERROR, unit="rad/s error"),
        number(one.damping if damped else None, ".3f"),
        number(one.damping_error if damped else None, _ERROR),
        number(one.time, unit="s"),
        number(one.time_error, _ERROR, unit="s error"),
        words("; ".join(mode_notes(name, one)), "long"),
    )
