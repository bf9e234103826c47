"""Models of ordinary flights, from Blackbox logs: yaw, roll and pitch, and heave."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from helisim.base.errors import IdentificationError, InputError
from helisim.base.note import Note
from helisim.handling.loop import axis_of
from helisim.ident import Fit, FrequencyResponse, Structure, identify, in_series, structures
from helisim.look.systemid import InferredFit, estimate_fits, followed_band
from helisim.records.record import FlightRecord

BAND = (2.0, 45.0)  # rad/s; below it speed changes matter, above it ordinary flying moves little
# _ELSEWHERE: rms of the relative difference between a flight's responses and their mean along it,
# as sticks move most in some of it, where airspeed does little (scripts/proof/rotorflight_study.py)
# _WIDE: from its lowest frequency to its highest, of an on-axis response: less tells no delay
# _LATE: s, of any delay: a servo's pulses come at most 560 times a second, less is a controller's
# inverse
# _ODD: A_b + B_a, of the usual rotor, taken for it where a flight tells it no better
_ELSEWHERE, _WIDE, _LATE, _ODD = 0.015, 4.0, 0.0018, 0.15
# Structure, other inputs that move its outputs, lower edge of its band, rad/s. The collective moves
# the nose, and by precompensation the pedals. Gusts hide how a speed flaps the disc back: the JR700
# has 0.002 and -0.005 rad s/m, the Blade 360 0.004 and -0.008. Below yaw's band airspeed turns the
# nose into or off the wind, so that its response changes by 10 to 60 % along a flight.
_FITS = (
    (
        structures.rollpitch_round.with_fixed(
            {"A_u": 0.003, "A_v": 0.0}, {"A_u": 0.002, "A_v": 0.007}
        ),
        ("ped", "col"),
        BAND[0],
    ),
    (structures.yaw_alone, ("lat", "lon", "col"), 4.0),
    (structures.heave_imu, ("lat", "lon", "ped"), BAND[0]),
)
FLY = (
    "fly for two minutes or more at one head speed in calm air with quick stops and reversals of "
    "each stick by itself, climbs and pitch pumps, too, and log setpoint, mixer, PID, gyro, "
    "attitude and accelerometer at 250 Hz or more"
)


def models_of(
    records: Sequence[FlightRecord],
    remarks: list[str],
    behind: Mapping[str, Structure],
    motor_tail: bool,
    doubts: Sequence[Note] = (),
) -> tuple[list[Fit], dict[str, str]]:
    """Return models that flights tell, and why an axis has no gains; extend the remarks.

    `behind` are filters through which channels are logged, `doubts` those that hold for all models.
    Errors hold what flights differ by.
    """
    fits, wrong = list[Fit](), dict[str, str]()

    def moving(*names: str) -> tuple[str, ...]:
        return tuple(
            name
            for name in names
            if any(name in record and np.ptp(record[name]) > 0.0 for record in records)
        )

    for own, others, low in _FITS if records else ():
        if motor_tail and "ped" in own.inputs:
            remarks.append("yaw: a motor drives the tail, whose throttle has no model here")
            continue
        words = " and ".join(axis_of(one).word for one in own.inputs)
        needed = (*(one.upper() for one in own.inputs), *own.outputs)
        if len(moving(*needed)) < len(needed):
            remarks.append(
                f"no model of {words}: a setpoint of it, or what answers "
                f"({', '.join(own.outputs)}), is not logged or never moves, and feedback alone "
                f"shows the controller's inverse; {FLY}"
            )
            continue
        try:
            asked = InferredFit(
                own.name, own.inputs, own.outputs, moving(*others), ("none",), (low, BAND[1]), ""
            )
            estimate = _elsewhere(
                estimate_fits(records, [asked], "predictor")[0],
                max(one.sample_time for one in records),
                doubts,
            )
            own = in_series(own, outputs={k: x for k, x in behind.items() if k in own.outputs})
            band = followed_band(estimate, own, asked.band)
            fit = identify(estimate, own, band=band)
            if "odd_cross" in own.names and not fit.parameters["odd_cross"].standard_error < _ODD:
                tied = own.with_fixed({"odd_cross": 0.0}, {"odd_cross": _ODD})
                fit = identify(estimate, tied, band=band)
            if blind := [
                *(
                    name
                    for name, one in fit.parameters.items()
                    if math.isinf(one.standard_error)
                    or (one.definition.unit == "s" and not one.fixed and one.value < _LATE)
                ),
                *(
                    f"{pair} beyond {low:.3g} to {high:.3g} rad/s"
                    for pair, (low, high) in fit.bands.items()
                    if high < _WIDE * low and pair in map("/".join, zip(own.outputs, own.inputs))
                ),
            ]:
                raise IdentificationError(f"the flight does not show {', '.join(blind)}")
        except (IdentificationError, InputError) as error:
            remarks.append(f"no model of {words}: {error}; {FLY}")
            continue
        # lost frames are told by their numbers; whole counts lie on straight lines, too
        if any(reason.kind != "lost" for reason in fit.verdict.reasons):
            # figures of a doubtful model may be of motion as large as was flown, and not of all
            wrong |= dict.fromkeys(own.inputs, f"the model's {fit.verdict}; {FLY}")
        fits.append(fit)
        remarks += [_lift(fit) for name in own.inputs if name == "col"]
    return fits, wrong


def _elsewhere(found: FrequencyResponse, step: float, doubts: Sequence[Note]) -> FrequencyResponse:
    """Return a response whose errors hold by how much, and how late, flights differ.

    They differ by more below twice the lowest frequency, where airspeed has time to act. What
    feedback shows in records biases no prediction by what the law itself saw, and firmware names
    its columns: a soft rotor may move the other axis more. Its commands went out as they are
    logged, each `step`, s: what they last, the last gap, is half of one.
    """
    assert found.scatter is not None
    whole = np.pad(found.response, ((0, 0), (0, len(found.conditioning)), (0, 0)))
    half, gap = 0.5j * step * found.frequency * whole, np.asarray(found.scatter.gap)
    share = _ELSEWHERE * np.hypot(1.0, (2.0 * found.frequency[0] / found.frequency) ** 2)
    gaps = *gap[:-1], np.where(np.abs(gap[-1]) > np.abs(half), half, gap[-1])
    return replace(
        found,
        scatter=replace(found.scatter, gap=np.stack([*gaps, share * whole, 1j * share * whole])),
        evidence=(
            *(one for one in found.evidence if one.kind not in ("feedback", "columns")),
            *doubts,
        ),
    )


def _lift(fit: Fit) -> str:
    """Return what a heave model says, with 95 % intervals."""
    by, late, damping = (
        f"{scale * one.value:.3g} ({min(ends):.3g} to {max(ends):.3g})"
        for name, scale in (("Z_col", -math.radians(1.0)), ("tau_col", 1e3), ("Z_w", -1.0))
        for one in [fit.parameters[name]]
        for ends in [[scale * end for end in one.interval]]
    )
    return (
        f"heave: a degree more of collective lifts it by {by} m/s^2, {late} ms late, and climbing "
        f"brakes it by {damping} of its speed a second; {fit.verdict}; no gain holds heave"
    )
