"""The tables that helisim shows on terminals and pages."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import degrees, isfinite, isnan
from typing import TYPE_CHECKING

import numpy as np

from helisim.base.errors import IdentificationError
from helisim.base.units import RAD_PER_DEG
from helisim.handling.criteria import LoadRejection, Rating
from helisim.handling.criterion import Criterion
from helisim.handling.loop import axis_of
from helisim.handling.measured.interval import UNITS, Interval
from helisim.ident import USABLE_COHERENCE, Fit, FrequencyResponse, Mode
from helisim.ident.verification import VerificationFigures
from helisim.records.record import IN1, FlightRecord
from helisim.show.table import (
    NO_BREAK,
    PERCENT,
    Table,
    common_form,
    interval_form,
    number,
    numbers,
    table,
)
from helisim.study.paper import published

if TYPE_CHECKING:
    from helisim.design.design import DesignResult
    from helisim.design.proof import ComparedCriterion, Proof
    from helisim.handling.measured.margins import MeasuredMargins
    from helisim.look.vibration import Vibration
    from helisim.sim.rigs import RigTest
    from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
    from helisim.study.errata import Erratum
    from helisim.study.log_tune import AxisTuning, Changed
    from helisim.study.paper import Change, GyroEffect, OverallCheck
    from helisim.vehicle import Vehicle


_EQUIVALENT = (
    "this structure fitted to the exact response of the model that flew, which has more states: "
    "what flights without noise would give"
)
_UNCERTAINTY = ".2g"
_FIGURE = ".3g"
_FLOWN = {  # Table 1 -> the vehicle's parameter
    "m": "airframe.mass",
    "R_mr": "main_rotor.radius",
    "R_tr": "tail_rotor.radius",
    "c_mr": "main_rotor.chord",
    "rho": "air.density",
    "Omega_mr": "main_rotor.speed",
    "Omega_tr": "tail_rotor.speed",
}
_SHORT = {
    "drb": "DRB",
    "drp": "DRP",
    "growth": "growth of poles",
    "ratio": "coupling",
    "position": "servo position",
    "rate": "servo rate",
}


def comparison(shown: ComparisonTable) -> Table:
    """Return a model's parameters beside paper and truth, with support and agreement."""
    low, high = shown.band_rad_s
    notes = [("given", "; ".join(map(_given, shown.given)) or "nothing")]
    if shown.truth != "truth":
        notes.append(("equivalent", _EQUIVALENT))
    return table(
        shown.name,
        "parameter<|unit<|paper"
        + "*" * all(row.paper is None for row in shown.parameters)
        + f"|{shown.truth}|identified|s.e.?|CR %|insens. %*|paper CR %*|support<|agreement<",
        (_compared(shown.name, row) for row in shown.parameters),
        f"from {shown.input}, {low:.3g} to {high:.3g} rad/s, average cost {shown.cost:.3g}",
        notes,
    )


def _given(one: GivenValue) -> str:
    error = "" if one.standard_error is None else f" +- {one.standard_error:{_UNCERTAINTY}}"
    unit = "" if one.unit in ("", "1") else f" {one.unit}"
    return f"{one.name} {one.value:.4g}{error}{unit}".replace(" ", NO_BREAK) + f" ({one.source})"


def _compared(name: str, row: ParameterRow) -> tuple[str, ...]:
    values = (row.paper, row.truth, row.identified)
    printed = published("jr700").get(name).get(row.name)
    is_its = printed is not None and printed.value == row.paper  # of no other vehicle
    of_paper = printed.cr_percent if printed and is_its else None
    return (
        *(row.name, row.unit, *numbers(values, common_form(values))),
        number(row.standard_error, _UNCERTAINTY),
        *numbers((row.cr_percent, row.insensitivity_percent, of_paper), PERCENT),
        *(row.support or "-", row.agreement),
    )


def verification(found: Mapping[str, VerificationFigures]) -> Table:
    """Return how well each output of the models was predicted on unseen flights."""
    return table(
        "Verified on flights that no fit has seen",
        "model<|output<|unit<|J_rms|TIC",
        (
            (model, one.name, one.unit, *numbers((one.j_rms, one.tic), _FIGURE))
            for model, figures in found.items()
            for one in figures.outputs
        ),
        notes=[(model, str(one.approach)) for model, one in found.items() if one.approach],
    )


def gyro_changes(found: GyroEffect) -> Table:
    """Return the roll-pitch parameters before and after the gyro, printed and identified."""
    return table(
        "Before and after the gyro: roll-pitch from IN1 and from IN2",
        "parameter<|unit<|paper IN1|paper IN2|ratio|found IN1|found IN2|ratio",
        map(_changed, found.changes),
    )


def _changed(one: Change) -> tuple[str, ...]:
    printed = (one.paper_before, one.paper_after, one.paper_ratio)
    ours = (one.before, one.after, one.ratio)
    forms = (*map(common_form, zip(printed[:2], ours)), ".3f")
    return (one.name, one.unit, *map(number, (*printed, *ours), forms * 2))


def errata(found: Sequence[Erratum]) -> Table:
    """Return the known errors of the paper, each with its calculation."""
    return table(
        "Errata",
        "error<|printed<|calculated<|result<|conclusion<",
        (
            (
                f"{one.title} ({one.where})",
                one.printed,
                one.calculation,
                one.computed,
                one.conclusion,
            )
            for one in found
        ),
    )


def overall(found: OverallCheck) -> Table:
    """Return eq. (8) as printed, from the parts, and identified directly."""
    low, high = found.band_rad_s

    def texts(*values: float) -> tuple[str, ...]:
        return numbers(values, common_form(values, digits=5))

    note = (
        f"Largest differences from {low:.3g} to {high:.3g} rad/s: {found.gain_db:+.2f} dB "
        f"at {found.gain_at_rad_s:.3g} rad/s, {found.phase_deg:+.1f} degrees at "
        f"{found.phase_at_rad_s:.3g} rad/s."
    )
    return table(
        "Eq. (8) by eq. (5) from base, gyro and ground tests, beside the one identified",
        "coefficient<|unit<|paper|from parts|direct|difference %",
        (
            (
                *(one.name, one.unit, *texts(one.paper, one.parts, one.direct)),
                number(one.difference_percent, "+.2f"),
            )
            for one in found.coefficients
        ),
        notes=[("", note)],
    )


def rig(test: RigTest) -> Table:
    """Return the findings of a ground test beside the truth."""
    return table(
        test.rig,
        "found<|unit<|value|truth|error|std error|how<*",
        (
            (
                *(one.name, one.unit, *numbers((one.value, one.truth), ".5g")),
                *(*numbers((one.error, one.standard_error), _UNCERTAINTY), one.how),
            )
            for one in test.findings
        ),
    )


def airframe(record: FlightRecord | None) -> Table:
    """Return Table 1 beside the parameters of a record's vehicle."""
    flown = record.provenance.get("parameters", {}) if record is not None else {}
    return table(
        "Table 1",
        "parameter<|unit<|paper|flown|source<",
        (
            (
                *(one.name, one.unit),
                *numbers((one.value, flown.get(_FLOWN.get(one.name, ""))), ".6g"),
                one.source,
            )
            for one in published("jr700")["airframe"]
        ),
    )


def fitted(fit: Fit) -> Table:
    """Return the parameters of a fit with their bounds and support."""
    return table(
        fit.structure.name,
        "parameter<|unit<|value|std. error|CR %|insens. %|support<",
        (
            (
                *(one.name, one.unit, number(one.value)),
                number(one.standard_error or None, _UNCERTAINTY),
                number(None if one.fixed else one.cr_percent, PERCENT),
                number(None if one.fixed else one.insensitivity_percent, PERCENT),
                fit.support(one.name),
            )
            for one in fit.parameters.values()
        ),
    )


def responses(fit: Fit) -> Table:
    """Return band, cost and quality of each response of a fit."""
    rows, left = [], fit.residual
    for name in fit.costs:
        low, high = fit.bands[name]
        pair = fit.data.index(*name.split("/", 1))
        used = (fit.data.frequency >= low) & (fit.data.frequency <= high)
        used &= fit.data.usable()[pair]
        rows.append(
            (
                *(name, number(low, _FIGURE), number(high, _FIGURE)),
                number(fit.costs[name], _FIGURE),
                number(float(fit.data.coherence[pair][used].mean()), ".3f"),
                number(100.0 * float(fit.data.random_error[pair][used].mean()), _UNCERTAINTY),
                number(left.magnitude[name] if left else None, _UNCERTAINTY),
                number(left.phase[name] if left else None, _UNCERTAINTY),
            )
        )
    return table(
        "Responses",
        "response<|from [rad/s]|to [rad/s]|J|coherence|random error [%]|left [dB]|left [deg]",
        rows,
        notes=[("left", "what the model leaves beyond noise, rms")] if left else [],
    )


def usable_bands(frf: FrequencyResponse) -> Table:
    """Return where each response is usable, with its means there."""
    rows = []
    for name in frf.pairs:
        at = frf.index(*name.split("/", 1))
        where = frf.usable()[at]
        said = (f"nowhere: coherence below {USABLE_COHERENCE}", "-", "-")
        if where.any():
            first, last = frf.frequency[where][[0, -1]]
            coherence, error = frf.coherence[at][where].mean(), frf.random_error[at][where].mean()
            means = (number(coherence, ".3f"), number(100.0 * error, PERCENT))
            said = (f"{first:.3g} to {last:.3g}", *means)
        rows.append((name, *said))
    return table("", "response<|usable band [rad/s]|coherence|random error [%]", rows)


def fit_modes(fit: Fit) -> Table:
    """Return poles and zeros of a fit, slowest first, with standard errors."""
    rows: list[tuple[str, ...]] = []
    try:
        found = fit.modes
        rows = [_mode("pole", one) for one in found.poles]
        rows += [_mode(f"zero {name}", one) for name, some in found.zeros.items() for one in some]
    except IdentificationError:  # M is singular
        pass
    return table(
        "Modes",
        "mode<|real [1/s]|imaginary* [rad/s]|frequency [rad/s]|error [rad/s]|damping"
        "|error|time [s]|error [s]|<",
        rows,
        notes=[("error", "standard error, from the parameters' covariance")],
    )


def _mode(name: str, one: Mode) -> tuple[str, ...]:
    damped = one.oscillates
    return (
        *(name, number(one.real), number(one.imag if damped else None)),
        *(number(one.frequency), number(one.frequency_error, _UNCERTAINTY)),
        number(one.damping if damped else None, ".3f"),
        number(one.damping_error if damped else None, _UNCERTAINTY),
        *(number(one.time), number(one.time_error, _UNCERTAINTY)),
        "; ".join(one.notes(name)),
    )


def trims(flights: Sequence[Vehicle]) -> Table:
    """Return level flights by speed, with throttle where there is one."""
    angles = ("theta", "phi", "a", "b")
    driven = any(flight.trim.throttle for flight in flights)
    heads = ["speed [m/s]", "power [W]", *IN1, *(f"{name} [deg]" for name in angles)]
    rows = (
        (
            *(number(flight.trim.speed, "g"), number(flight.power, ".1f")),
            *(number(getattr(flight.trim, name), ".4f") for name in IN1),
            *(number(degrees(getattr(flight.trim, name)), ".2f") for name in angles),
            *[number(flight.trim.throttle, ".3f")] * driven,
        )
        for flight in flights
    )
    return table("", "|".join([*heads, *["throttle"] * driven]), rows)


def channels(record: FlightRecord) -> Table:
    """Return a record's channels with statistics."""
    return table(
        "Channels",
        "channel<|unit<|kind<|mean|std|smallest|largest|meaning<",
        (
            (
                *(one.name, one.unit, one.kind),
                *(number(float(of(values)), _FIGURE) for of in (np.mean, np.std, np.min, np.max)),
                one.meaning,
            )
            for one, values in zip(record.channels, record.values.T)
        ),
    )


def measured_margins(found: MeasuredMargins) -> Table:
    """Return figures of a measured loop with intervals, in degrees, dB and SI."""
    return table(
        "Measured",
        "axis<|cut at<|figure<|value|95 % from|to|unit<",
        (
            (*(one.axis, one.at, one.name.replace("_", " ")), *_three(one.interval), one.unit)
            for one in found.figures
        ),
    )


def _three(found: Interval, usual: str = ".4g") -> tuple[str, ...]:
    """Return an interval's value and ends."""
    return numbers(
        (found.value, found.low, found.high), interval_form(found.high - found.low, usual)
    )


def tuning(shown: AxisTuning) -> Table:
    """Return an axis's figures today and with new gains, with their intervals of 95 %."""
    rows = [
        (
            _called(name).replace("_", " "),
            *(_within(found.get(name)) for found in (shown.today, shown.tuned)),
            UNITS.get(name, "rad/s"),
        )
        for name in shown.today
    ]
    title, source = axis_of(shown.axis).word.capitalize(), "as flown" if shown.flown else "by model"
    said = (
        f"the gyro's noise moves the command {shown.noise:.3g} times as much as today, and in "
        f"gusts the attitude errs {shown.gusts:.3g} times as much"
    )
    return table(
        title,
        f"figure<|today, {source}|with new gains|unit<",
        rows,
        notes=[("", said)] if shown.tuned else [],
    )


def _within(found: Interval | None) -> str:
    if found is None or not isfinite(found.value):
        return "-"
    if not isfinite(found.high - found.low):
        return f"about {found.value:.2g}" if isnan(found.low) else "-"
    value, low, high = _three(found, ".3g")
    return value if found.low == found.high else f"{value} ({low}-{high})"


_WHEN = " deg today", " with notches"


def vibration(shown: Vibration, crossovers: Mapping[str, float]) -> Table:
    """Return the tones of a log's gyros, and what notches leave of them.

    Notes say the filters' lag at crossovers, rad/s by what crosses, and what is proposed.
    """
    rows = [
        (
            *(number(one.frequency, ".1f"), one.name or "-", one.axis, number(one.above, ".0f")),
            *numbers((degrees(size) for size in (one.logged, one.now)), ".2g"),
            number(None if one.left is None else degrees(one.left), ".2g"),
            number(100.0 * one.felt, ".2g"),
        )
        for one in shown.peaks
    ]
    lags = [
        f"lag of the gyro's filters in {word} at {at:.3g} rad/s: "
        + ", ".join(f"{lag:.1f}{when}" for lag, when in zip(shown.lag(at), _WHEN))
        for word, at in crossovers.items()
    ]
    found = {
        f"gyros by {shown.source}, {{:.4g}} Hz": shown.rate,
        "main rotor {:.4g} Hz": shown.rotor,
        "tail {:.3g} times": shown.tail,
    }
    if shown.source and shown.filters[1:]:
        proposed = ", ".join(f"{name} {value:g}" for name, value in shown.settings.items())
        lags.append(f"proposed: {proposed or 'no notch, as no tone of a rotor moves the servos'}")
    return table(
        "Vibration",
        "Hz|tone<|of<|over floor [dB]|logged [deg/s]|today|with notches|of servos [%]",
        rows,
        ", ".join(text.format(value) for text, value in found.items() if isfinite(value)),
        [("", one) for one in (*lags, *shown.remarks)],
    )


def changes(shown: Sequence[Changed]) -> Table:
    """Return the parameters of an autopilot that change."""
    rows = ((one.name, *numbers((one.before, one.after), ".4g")) for one in shown)
    notes = {
        re.sub("(?<=_)(RLL|PIT|YAW)(?=_)|^(roll|pitch|yaw)(?=_)", "*", one.name): one.why
        for one in shown
    }
    return table("New gains", "parameter<|today|new", rows, notes=notes.items())


def design(result: DesignResult) -> Table:
    """Return every figure with a border, and by its criterion's level whether it is worse."""
    rows = []
    for one in result.judged:
        criterion, was, level = one.spec.criterion, one.before, str(one.nominal.level)
        if was is not None and one.nominal.level > was.level:
            level += f" (was {was.level})"
        for name, limit in criterion.limits.items():
            unit, ratings = criterion.units.get(name, ""), (was, one.nominal, one.worst)
            rows.append(
                (
                    *(criterion.word, _called(name, criterion), _for_people(limit.level1, unit)),
                    *(_for_people(each and each.figures.get(name), unit) for each in ratings),
                    *("deg" if unit == "rad" else unit, level, number(100.0 * one.share, _FIGURE)),
                )
            )
    return table(
        "Design",
        "axis<|figure<|Level 1|before|designed|worst|unit<|level<|Level 1 %*",
        rows,
        f"Level 1 in {100.0 * result.share:.3g} % of {result.samples} sampled models, design "
        f"margin {result.margin:.2g}",
    )


def proof(shown: Proof, before: Mapping[int, Rating | None] | None = None) -> Table:
    """Return figures flown or with a border, angles in degrees; `before` by row of the table."""
    at = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in shown.stops.items())
    return table(
        "Asked, predicted, exact, flown",
        "axis<|criterion<*|figure<|unit<|Level 1|before*|predicted|exact|flown|95 %|level*",
        (
            _proved(one, name, (before or {}).get(k))
            for k, one in enumerate(shown.table)
            for name in one.figures
            if name in one.spec.criterion.limits or name in one.intervals
        ),
        notes=[("at its stops in rough air", at or "nothing")],
    )


def _proved(one: ComparedCriterion, name: str, before: Rating | None) -> tuple[str, ...]:
    criterion, flown, form, half = one.spec.criterion, one.intervals.get(name), _FIGURE, "-"
    unit = criterion.units[name]
    if flown is not None:
        width = (flown.high - flown.low) / _scale(unit)
        form, half = interval_form(width), f"\u00b1 {0.5 * width:.2g}"
    limit = criterion.limits[name].level1 if name in criterion.limits else None
    was = None if before is None else before.figures.get(name)
    known = [
        value if value is not None and isfinite(value) else None
        for value in (limit, was, *one.figures[name].values())
    ]
    rated = one.flown or one.exact
    return (
        *(criterion.word, criterion.name.replace("_", " "), _called(name, criterion)),
        "deg" if unit == "rad" else unit,
        *(_for_people(value, unit) for value in known[:2]),
        *(_for_people(value, unit, form) for value in known[2:]),
        *(half, "-" if rated is None else f"Level {rated.level}"),
    )


def _called(figure: str, criterion: Criterion | None = None) -> str:
    return (
        f"turned by {axis_of(criterion.by).word} load"
        if figure == "turned" and isinstance(criterion, LoadRejection)
        else _SHORT.get(figure, figure.replace("_", " "))
    )


def _for_people(value: float | None, unit: str, form: str = _FIGURE) -> str:
    return number(None if value is None else value / _scale(unit), form)


def _scale(unit: str) -> float:
    return RAD_PER_DEG if unit == "rad" else 1.0
