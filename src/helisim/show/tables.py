"""The tables that helisim shows, each made once: for terminal, page and recording."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from helisim.base.errors import IdentificationError
from helisim.base.units import RAD_PER_DEG
from helisim.handling.criteria import Criterion, Limit, LoadRejection, Rating
from helisim.handling.figures import margins as margins_of
from helisim.handling.figures import rejection
from helisim.handling.loop import Loop, NoResponse, axis_of
from helisim.ident import USABLE_COHERENCE, Fit, FittedParameter, FrequencyResponse, Mode, Modes
from helisim.ident.verification import VerificationFigures
from helisim.records.record import IN1, FlightRecord
from helisim.show.table import (
    NO_BREAK,
    PERCENT,
    Cell,
    Table,
    columns,
    common_form,
    interval_form,
    number,
    words,
)
from helisim.study.paper import published

if TYPE_CHECKING:
    from helisim.design.design import DesignResult
    from helisim.design.proof import ComparedCriterion, ComparedFigure, Proof
    from helisim.handling.measured.margins import MeasuredMargins
    from helisim.sim import FlightPlan
    from helisim.sim.rigs import RigTest
    from helisim.study.comparison import ComparisonTable, GivenValue, ParameterRow
    from helisim.study.errata import Erratum
    from helisim.study.paper import Change, GyroEffect, OverallCheck, Statement
    from helisim.vehicle import Linearization, Vehicle

Flown = Mapping[tuple[Criterion, str], float]
"""(criterion, figure) -> as measured in flight."""

_UNCERTAINTY = ".2g"
"""Two digits of an uncertainty, as is usual."""
_FIGURE = ".3g"
_FLOWN = {
    "R_mr": "main_rotor.radius",
    "R_tr": "tail_rotor.radius",
    "c_mr": "main_rotor.chord",
    "rho": "air.density",
    "Omega_mr": "main_rotor.speed",
    "Omega_tr": "tail_rotor.speed",
}
"""Table 1 -> the parameter of the vehicle that flew."""
_SHORT = {"drb": "DRB", "drp": "DRP", "growth": "growth of poles"}


def _named(name: str, unit: str) -> tuple[Cell, Cell]:
    return words(name, "name"), words(unit, "unit")


def comparison(table: ComparisonTable) -> Table:
    """Return a model's parameters beside paper and truth, with support and agreement of each."""
    low, high = table.band_rad_s
    notes = [("given", "; ".join(map(_given, table.given)) or "nothing")]
    if table.truth != "truth" and table.truth_meaning:
        notes.append(("equivalent", table.truth_meaning))
    return Table(
        table.name,
        columns(
            f"parameter<|unit<|paper|{table.truth}|identified|CR %|insens. %*|paper CR %*"
            "|support<|agreement<"
        ),
        tuple(_compared(table.name, row) for row in table.parameters),
        lead=f"from {table.input}, {low:.3g} to {high:.3g} rad/s, average cost {table.cost:.3g}",
        notes=tuple(notes),
    )


def _given(one: GivenValue) -> str:
    """Return a given value with its standard error and source, unbroken."""
    error = "" if one.standard_error is None else f" +- {one.standard_error:{_UNCERTAINTY}}"
    unit = "" if one.unit in ("", "1") else f" {one.unit}"
    value = f"{one.name} {one.value:.4g}{error}{unit}".replace(" ", NO_BREAK)
    return f"{value} ({one.source})"


def _compared(table: str, row: ParameterRow) -> tuple[Cell, ...]:
    place = f"tables.{table}.{row.name}"
    values = {"paper": row.paper, "truth": row.truth, "identified": row.identified}
    form = common_form(values.values())
    bounds = ("cr_percent", "insensitivity_percent")
    printed = published("jr700").get(table).get(row.name)
    is_its = printed is not None and printed.value == row.paper  # of no other vehicle
    bound = printed.cr_percent if printed is not None and is_its else None
    style = {"agrees": " ok", "differs": " off"}.get(row.agreement, "")
    return (
        *_named(row.name, row.unit),
        *(number(x, form, unit=row.unit, key=f"{place}.{at}") for at, x in values.items()),
        *(number(getattr(row, at), PERCENT, unit="%", key=f"{place}.{at}") for at in bounds),
        number(bound, PERCENT, unit="%", key=f"paper.{table}.{row.name}.cr_percent"),
        words(row.support or "-", key=f"{place}.support"),
        words(row.agreement, f"verdict{style}", key=f"{place}.agreement"),
    )


def verification(found: Mapping[str, VerificationFigures]) -> Table:
    """Return how well each output of the models was predicted on flights that no fit has seen."""
    rows = []
    for model, figures in found.items():
        for one in figures.outputs:
            place = f"verification.{model}.{one.name}"
            rows.append(
                (
                    words(model, "name"),
                    *_named(one.name, one.unit),
                    number(one.j_rms, _FIGURE, unit=one.unit, key=f"{place}.j_rms"),
                    number(one.tic, _FIGURE, key=f"{place}.tic"),
                )
            )
    notes = [(model, str(one.approach)) for model, one in found.items() if one.approach]
    return Table(
        "Verified on flights that no fit has seen",
        columns("model<|output<|unit<|J_rms|TIC"),
        tuple(rows),
        notes=tuple(notes),
    )


def gyro_changes(found: GyroEffect) -> Table:
    """Return the roll-pitch parameters before and after the gyro, the paper's and ours."""
    return Table(
        "Before and after the gyro: roll-pitch from IN1 and from IN2",
        columns(
            "parameter<|unit<|paper IN1|IN2=paper IN2|ratio=paper ratio|found IN1|IN2=found IN2"
            "|ratio=found ratio"
        ),
        tuple(_changed(one) for one in found.changes),
    )


def _changed(one: Change) -> tuple[Cell, ...]:
    names = ("paper_before", "paper_after", "paper_ratio", "before", "after", "ratio")
    forms = {
        "before": common_form((one.paper_before, one.before)),
        "after": common_form((one.paper_after, one.after)),
        "ratio": ".3f",
    }
    return (
        *_named(one.name, one.unit),
        *(
            number(
                getattr(one, name),
                forms[name.removeprefix("paper_")],
                unit="ratio" if "ratio" in name else one.unit,
                key=f"before_after.{one.name}.{name}",
            )
            for name in names
        ),
    )


def gyro_statements(found: Sequence[Statement]) -> Table:
    """Return the paper's statements on the gyro's effect, beside the facts."""
    rows = [(f'"{one.said}"', one.paper, one.identified) for one in found]
    return _sentences("said<=the paper says|paper<=its table|found<=identified", rows, cards="-")


def errata(found: Sequence[Erratum]) -> Table:
    """Return the known errors of the paper, each with its calculation."""
    rows = [
        (f"{one.title} ({one.where})", one.printed, one.calculation, one.computed, one.conclusion)
        for one in found
    ]
    return _sentences("<=error|printed<|calculated<|so<=result|<=conclusion", rows, cards="1.")


def _sentences(heads: str, rows: Iterable[tuple[str, ...]], *, cards: Literal["-", "1."]) -> Table:
    """Return a table of sentences, the first of each row naming it."""
    return Table(
        "",
        columns(heads),
        tuple(
            (words(first, "name long"), *(words(one, "long") for one in rest))
            for first, *rest in rows
        ),
        cards=cards,
    )


def overall(found: OverallCheck) -> Table:
    """Return eq. (8) as printed, from the parts, and identified directly."""
    low, high = found.band_rad_s
    rows = []
    for one in found.coefficients:
        place = f"eq_8.{one.name}"
        values = {"paper": one.paper, "parts": one.parts, "direct": one.direct}
        form = common_form(values.values(), digits=5)
        share, key = one.difference_percent, f"{place}.difference_percent"
        rows.append(
            (
                *_named(one.name, one.unit),
                *(number(x, form, unit=one.unit, key=f"{place}.{at}") for at, x in values.items()),
                number(share, "+.2f", unit="%", key=key),
            )
        )
    note = (
        f"Largest differences from {low:.3g} to {high:.3g} rad/s: {found.gain_db:+.2f} dB "
        f"at {found.gain_at_rad_s:.3g} rad/s, {found.phase_deg:+.1f} degrees at "
        f"{found.phase_at_rad_s:.3g} rad/s."
    )
    return Table(
        "Eq. (8) by eq. (5) from base, gyro and ground tests, beside the one identified",
        columns("coefficient<|unit<|paper|from parts|direct|difference %"),
        tuple(rows),
        notes=(("", note),),
    )


def rig(test: RigTest) -> Table:
    """Return the findings of one ground test, each value beside the truth."""
    rows = []
    for one in test.findings:
        place, unit, share = f"ground.{test.rig}.{one.name}", one.unit, None
        if one.error is not None and one.truth is not None and abs(one.truth) > abs(one.error):
            share = 100.0 * one.error / one.truth  # an error beyond the truth is no percentage
        forms = {
            "value": ".5g",
            "truth": ".5g",
            "error": _UNCERTAINTY,
            "standard_error": _UNCERTAINTY,
        }
        rows.append(
            (
                *_named(one.name, unit),
                *(
                    number(getattr(one, at), form, unit=unit, key=f"{place}.{at}")
                    for at, form in forms.items()
                ),
                number(share, ".2f", unit="%"),
                words(one.how, "long"),
            )
        )
    return Table(
        test.rig,
        columns("found<|unit<|value|truth|error|std error|error %|how<*"),
        tuple(rows),
        notes=tuple(("", f"{note[:1].upper()}{note[1:]}.") for note in test.notes),
    )


def airframe(record: FlightRecord | None) -> Table:
    """Return Table 1 with the values of the vehicle of a record."""
    flown = record.provenance.get("parameters", {}) if record is not None else {}
    rows = tuple(
        (
            *_named(one.name, one.unit),
            number(one.value, ".6g", unit=one.unit, key=f"paper.airframe.{one.name}"),
            number(flown.get(_FLOWN.get(one.name, "")), ".6g", unit=one.unit),
            words(one.source, "long"),
        )
        for one in published("jr700")["airframe"]
    )
    return Table("Table 1", columns("parameter<|unit<|paper|flown|source<"), rows)


def fitted(fit: Fit, parameters: Sequence[FittedParameter] | None = None) -> Table:
    """Return the parameters of a fit with their bounds and support, or the same in other units."""
    rows = tuple(
        (
            *_named(one.name, one.unit),
            number(one.value, unit=one.unit, key=f"parameters.{one.name}.value"),
            number(None if one.fixed else one.cr_percent, PERCENT, unit="%"),
            number(None if one.fixed else one.insensitivity_percent, PERCENT, unit="%"),
            words(fit.support(one.name), "long"),
        )
        for one in parameters or fit.parameters.values()
    )
    heads = columns("parameter<|unit<|value|CR %|insens. %|support<")
    return Table(fit.structure.name, heads, rows)


def responses(fit: Fit) -> Table:
    """Return each response of a fit: its band, its cost, and how well it is known."""
    rows = []
    for name in fit.costs:
        low, high = fit.bands[name]
        pair = fit.data.index(*name.split("/", 1))
        used = (fit.data.frequency >= low) & (fit.data.frequency <= high)
        used &= fit.data.usable()[pair]
        left = fit.misfit
        error = 100.0 * float(fit.data.random_error[pair][used].mean())
        rows.append(
            (
                words(name, "name"),
                *(number(edge, _FIGURE, unit="rad/s") for edge in (low, high)),
                number(fit.costs[name], _FIGURE, key=f"costs.{name}"),
                number(float(fit.data.coherence[pair][used].mean()), ".3f"),
                number(error, _UNCERTAINTY, unit="%"),
                number(left.magnitude[name] if left else None, _UNCERTAINTY, unit="dB"),
                number(left.phase[name] if left else None, _UNCERTAINTY, unit="deg"),
            )
        )
    return Table(
        "Responses",
        columns(
            "response<|from [rad/s]|to [rad/s]|J|coherence|error [%]=mean random error|left [dB]"
            "|left [deg]=left, phase"
        ),
        tuple(rows),
        notes=(("left", "what the model leaves beyond noise, rms"),) if fit.misfit else (),
    )


def modes(found: Modes) -> Table:
    """Return poles, then the zeros of each response, slowest first, with standard errors."""
    rows = [_mode("pole", f"modes.poles.{k}", one) for k, one in enumerate(found.poles)]
    rows += [
        _mode(f"zero {name}", f"modes.zeros.{name}.{k}", one)
        for name, some in found.zeros.items()
        for k, one in enumerate(some)
    ]
    return Table(
        "Modes",
        columns(
            "mode<|real [1/s]|imaginary* [rad/s]|frequency [rad/s]|error [rad/s]|damping"
            "|error=error of damping|time [s]=time constant|error [s]|<"
        ),
        tuple(rows),
        notes=(("error", "standard error, from the parameters' covariance"),),
    )


def fit_modes(fit: Fit) -> Table:
    """Return the modes of a fit, without rows where it has none."""
    try:
        return modes(fit.modes)
    except IdentificationError:  # M is singular
        return modes(Modes((), {}, {}))


def _mode(name: str, key: str, one: Mode) -> tuple[Cell, ...]:
    damped = one.oscillates
    return (
        words(name, "name"),
        number(one.real, unit="1/s"),
        number(one.imag if damped else None, unit="rad/s"),
        number(one.frequency, unit="rad/s", key=f"{key}.frequency_rad_s"),
        number(one.frequency_error, _UNCERTAINTY, unit="rad/s error"),
        number(one.damping if damped else None, ".3f"),
        number(one.damping_error if damped else None, _UNCERTAINTY),
        number(one.time, unit="s"),
        number(one.time_error, _UNCERTAINTY, unit="s error"),
        words("; ".join(one.notes(name)), "long"),
    )


def linear_modes(shown: Linearization) -> Table:
    """Return the poles of a linear model, slowest first."""
    system: Any = shown.system
    poles = np.asarray(system.poles())
    if system.dt:
        poles = np.log(poles[np.abs(poles) > 0.0]) / system.dt
    rows = tuple(
        (
            number(float(pole.real), unit="1/s"),
            number(float(pole.imag), unit="rad/s"),
            number(float(abs(pole)), unit="rad/s"),
            number(float(-pole.real / abs(pole)) if abs(pole) else None, ".3f"),
        )
        for pole in sorted((p for p in poles if p.imag >= 0.0), key=abs)
    )
    heads = columns("real [1/s]|imaginary [rad/s]|frequency [rad/s]|damping ratio")
    return Table("Modes", heads, rows)


def trims(flights: Sequence[Vehicle]) -> Table:
    """Return level flights, a row for each speed; with the throttle where there is one."""
    angles = ("theta", "phi", "a", "b")
    driven = any(flight.trim.throttle for flight in flights)
    heads = ["speed [m/s]", "power [W]", *IN1, *(f"{name} [deg]" for name in angles)]
    rows = tuple(
        (
            number(flight.trim.speed, "g", unit="m/s"),
            number(flight.power, ".1f", unit="W"),
            *(number(getattr(flight.trim, name), ".4f") for name in IN1),
            *(number(degrees(getattr(flight.trim, name)), ".2f", unit="deg") for name in angles),
            *[number(flight.trim.throttle, ".3f")] * driven,
        )
        for flight in flights
    )
    return Table("", columns("|".join([*heads, *["throttle"] * driven])), rows)


def versions(found: Mapping[str, str]) -> Table:
    """Return the versions of the programs that computed the numbers."""
    rows = tuple((words(name, "name"), words(text)) for name, text in found.items())
    return Table("Versions", columns("program<|version<"), rows)


def channels(record: FlightRecord) -> Table:
    """Return the channels of a record with the statistics of each."""
    rows = tuple(
        (
            words(one.name, "name"),
            words(one.unit, "unit"),
            words(one.kind, "unit"),
            *(
                number(float(of(values)), _FIGURE, unit=one.unit)
                for of in (np.mean, np.std, np.min, np.max)
            ),
            words(one.meaning, "long text"),
        )
        for one, values in zip(record.channels, record.values.T)
    )
    heads = columns("channel<|unit<|kind<|mean|std|smallest|largest|meaning<")
    return Table("Channels", heads, rows)


def pairs(found: FrequencyResponse) -> Table:
    """Return each pair of a response with its usable band and how well it is known there."""
    rows = []
    for o, output in enumerate(found.outputs):
        for i, input_ in enumerate(found.inputs):
            good = found.usable()[o, i]
            band = found.frequency[good]
            low, high = (float(band[0]), float(band[-1])) if band.size else (None, None)
            coherence, error = (
                float(np.median(values[o, i][good])) if band.size else None
                for values in (found.coherence, found.random_error)
            )
            rows.append(
                (
                    words(f"{output}/{input_}", "name"),
                    number(low, _FIGURE, unit="rad/s"),
                    number(high, _FIGURE, unit="rad/s"),
                    number(float(np.mean(good)) * 100.0, ".0f", unit="%"),
                    number(coherence, ".3f"),
                    number(None if error is None else 100.0 * error, _UNCERTAINTY, unit="% of"),
                )
            )
    return Table(
        f"Where the coherence is {USABLE_COHERENCE:g} or more",
        columns(
            "response<|from [rad/s]|to [rad/s]|usable [%]|coherence=median coherence"
            "|error [%]=median random error"
        ),
        tuple(rows),
    )


def plan(shown: FlightPlan) -> Table:
    """Return the parts of a flight plan, each with the settings that aren't its defaults."""
    rows = tuple((words(name, "name"), words(text, "long text")) for name, text in shown.in_words())
    return Table("Flight plan", columns("part<|settings<"), rows)


def vehicle(shown: Vehicle) -> Table:
    """Return the steady flight that a vehicle is in: attitude, controls, power."""
    trim = shown.trim
    facts: list[tuple[str, str, float, str]] = [
        ("mass", "kg", float(np.sum(shown.model.body_mass)), ".4g"),
        ("shaft power", "W", shown.power, ".4g"),
        ("speed", "m/s", trim.speed, ".4g"),
        ("height", "m", trim.height, ".4g"),
        *((name, "deg", degrees(getattr(trim, name)), ".3f") for name in ("phi", "theta")),
        *((name, "1", getattr(trim, name), ".4f") for name in ("col", "lon", "lat", "ped")),
        *((f"tilt {name}", "deg", degrees(getattr(trim, name)), ".3f") for name in ("a", "b")),
        ("time step", "s", float(shown.model.opt.timestep), ".4g"),
    ]
    rows = tuple(
        (*_named(name, unit), number(value, form, unit=unit)) for name, unit, value, form in facts
    )
    return Table("In trim", columns("quantity<|unit<|value"), rows)


def parameters(shown: Vehicle) -> Table:
    """Return every parameter of a vehicle with its source."""
    entries = [shown.parameters.entry(name) for name in shown.parameters]
    rows = tuple(
        (*_named(one.name, one.unit), number(one.value, ".6g"), words(one.source, "long text"))
        for one in entries
    )
    return Table("Parameters", columns("parameter<|unit<|value|source<"), rows)


def loop_margins(loop: Loop) -> Table:
    """Return margins at the actuators and disturbance rejection of each axis that a loop closes."""
    rows = []
    for axis in loop.axes:
        try:
            curve, rejected = loop.broken(axis), rejection(loop.disturbance(axis))
        except NoResponse:
            continue
        if np.any(np.abs(curve.response) > 1e-9):
            cut = margins_of(curve)
            rows.append(
                (
                    words(axis_of(axis).word, "name"),
                    number(cut.crossover, ".2f"),
                    number(degrees(cut.least_phase), ".1f"),
                    number(cut.least_gain, ".2f"),
                    number(rejected.bandwidth, ".2f"),
                    number(rejected.peak, ".2f"),
                )
            )
    heads = "axis<|crossover [rad/s]|phase margin [deg]|gain margin [dB]|DRB [rad/s]|DRP [dB]"
    return Table("Loops", columns(heads), tuple(rows))


def measured_margins(found: MeasuredMargins) -> Table:
    """Return the figures of a measured loop with their intervals, in degrees, dB and SI."""
    rows = []
    for one in found.figures:
        form = interval_form(one.interval.high - one.interval.low, ".4g")
        values = (one.interval.value, one.interval.low, one.interval.high)
        rows.append(
            (
                *map(words, (one.axis, one.at, one.name.replace("_", " "))),
                *(number(value, form) for value in values),
                words(one.unit),
            )
        )
    heads = "axis<|cut at<|figure<|value|95 % from|to|unit<"
    return Table("Measured", columns(heads), tuple(rows))


def design(result: DesignResult, flown: Flown | None = None) -> Table:
    """Return every figure that has a border, of all specifications but those to check.

    Args:
        result: of the design.
        flown: as measured in flight, if it flew.
    """
    rows = []
    for one in result.judged:
        criterion = one.spec.criterion
        if one.spec.kind not in ("hard", "soft"):
            continue
        for name, limit in criterion.limits.items():
            unit = criterion.units.get(name, "")
            ratings = (one.before, one.nominal, one.worst)
            values = [limit.level1 if isinstance(limit, Limit) else None]
            values += [None if each is None else each.figures.get(name) for each in ratings]
            values += [] if flown is None else [flown.get((criterion, name))]
            figure = _SHORT.get(name, name.replace("_", " "))
            if isinstance(criterion, LoadRejection):
                figure = f"turned by {axis_of(criterion.by).word} load"
            rows.append(
                (
                    *map(words, (criterion.word, criterion.name.replace("_", " "), figure)),
                    *(_for_people(value, unit) for value in values),
                    words(_degrees(unit)),
                    number(100.0 * one.share, _FIGURE),
                )
            )
    in_flight = "" if flown is None else "|flown"
    return Table(
        "Design",
        columns(
            f"axis<|criterion<*|figure<|asked|before|designed|worst{in_flight}|unit<|Level 1 %*"
        ),
        tuple(rows),
        lead=f"Level 1 in {100.0 * result.share:.3g} % of {result.drawn} models drawn, design "
        f"margin {result.margin:.2g}",
    )


def proof(shown: Proof) -> Table:
    """Return every figure that was flown, or has a border; angles in degrees."""
    rows = []
    for one in shown.table:
        for figure in one.figures:
            if figure.name in one.spec.criterion.limits or figure.flown is not None:
                name = _SHORT.get(figure.name, figure.name.replace("_", " "))
                rows.append(
                    (
                        words(axis_of(one.spec.criterion.axis).word),
                        words(one.spec.criterion.name.replace("_", " ")),
                        words(name),
                        *_proved(figure),
                        words(_degrees(figure.unit)),
                    )
                )
    stops = shown.flights.stops
    at = ", ".join(f"{name} {100.0 * share:.2g} %" for name, share in stops.share.items())
    largest = ", ".join(f"{name} {one:.2f}" for name, one in stops.largest.items())
    return Table(
        "Proof in flight",
        columns(
            "axis<|criterion<*|figure<|asked|predicted|exact|in that air|flown|95 % from|to|unit<"
        ),
        tuple(rows),
        notes=(
            ("at its stops in rough air", at or "nothing"),
            ("largest commands there, of 0.5", largest),
        ),
    )


def _proved(figure: ComparedFigure) -> list[Cell]:
    flown, form, measured = figure.flown, _FIGURE, (None, None, None)
    if flown is not None:
        form = interval_form((flown.high - flown.low) / _scale(figure.unit))
        measured = (flown.value, flown.low, flown.high)
    values = (figure.predicted, figure.exact, figure.met, *measured)
    known = [None if one is None or not isfinite(one) else one for one in values]
    return [
        _for_people(_level1(figure), figure.unit),
        *(_for_people(one, figure.unit, form) for one in known),
    ]


def proof_levels(shown: Proof, before: Mapping[int, Rating | None]) -> Table:
    """Return every figure with a border of every specification, four times over, and crossovers.

    Args:
        shown: of the law.
        before: ratings of the law before, by the number of the row of the proof's table.
    """
    rows = []
    for k, one in enumerate(shown.table):
        listed = [f for f in one.figures if f.limit is not None or f.name == "crossover"]
        rows += [
            _levelled(one, figure, before.get(k), first=place == 0)
            for place, figure in enumerate(listed)
        ]
    return Table(
        "Asked, predicted, exact, flown",
        columns(
            "criterion<|unit<|Level 1|before|predicted|exact|flown|95 %"
            "|level<=level flown, or exact"
        ),
        tuple(rows),
    )


def _levelled(
    one: ComparedCriterion, figure: ComparedFigure, before: Rating | None, *, first: bool
) -> tuple[Cell, ...]:
    criterion, unit, flown = one.spec.criterion, figure.unit, figure.flown
    called = ", ".join(name.replace("_", " ") for name in (criterion.name, figure.name))
    was = None if before is None else before.figures.get(figure.name)
    half = None if flown is None else 0.5 * (flown.high - flown.low) / _scale(unit)
    rated = one.flown or one.exact
    told = first and one.spec.kind != "objective"  # borders that only weigh it against others
    level = "" if rated is None or not told else f"Level {rated.level}"
    style = {"Level 1": "verdict ok", "": "verdict"}.get(level, "verdict off")
    measured = None if flown is None else flown.value
    return (
        words(f"{criterion.word}: {called}", "name"),
        words(_degrees(unit), "unit"),
        *(
            number(None if value is None else value / _scale(unit), _FIGURE)
            for value in (_level1(figure), was, figure.predicted, figure.exact, measured)
        ),
        words("-") if half is None else words(f"\u00b1 {half:.2g}"),
        words(level, style),
    )


def gust(shown: Proof) -> Table:
    """Return how far the gust turned the vehicle, before and with the law."""
    rows = tuple(
        (
            words("before" if name == "before" else "with the law"),
            words(angle),
            number(one.peak / RAD_PER_DEG, _FIGURE),
            number(one.rms / RAD_PER_DEG, _FIGURE),
        )
        for name, angles in shown.gust_deviations.items()
        for angle, one in angles.items()
    )
    return Table("Gust", columns("controller<|angle<|peak [deg]|rms [deg]"), rows)


def _level1(figure: ComparedFigure) -> float | None:
    return figure.limit.level1 if isinstance(figure.limit, Limit) else None


def _for_people(value: float | None, unit: str, form: str = _FIGURE) -> Cell:
    return words("-") if value is None else number(value / _scale(unit), form)


def _scale(unit: str) -> float:
    return RAD_PER_DEG if unit == "rad" else 1.0


def _degrees(unit: str) -> str:
    return "deg" if unit == "rad" else unit
