"""All of an autopilot's parameters for a vehicle: its settings, and gains from a model of it."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import Linear
from helisim.base.units import STANDARD_GRAVITY
from helisim.handling.arducopter import COMMANDS
from helisim.handling.loop import axis_of
from helisim.records.channels import IN1
from helisim.sitl.gains import FILTER_HZ, GYRO_HZ, INPUT_TIME, LOOP_RATE, Tuning, tune
from helisim.sitl.mixing import Controls, Mixer
from helisim.sitl.outputs import Outputs
from helisim.sitl.parameter_file import AutopilotParameters, Setting
from helisim.sitl.settings import Group, hover, rotor, simulated, swashplate, tail, unused
from helisim.vehicle import Vehicle, load

_WORDS = {"lat": "RLL", "lon": "PIT", "ped": "YAW"}
_QUICK = 10.0
"""rad/s, at which a collective lifts before the vehicle moves."""


def parameters_for(
    vehicle: Vehicle | str,
    model: Linear | None = None,
    *,
    of_autopilot: bool = False,
    late: float = 0.0,
    lift: float | None = None,
    gyro: bool = False,
    made_from: str = "",
) -> AutopilotParameters:
    """Return parameters with which ArduCopter-heli flies a vehicle, and what each follows from.

    Args:
        vehicle: or its name or folder: its servos, rotor and hover are what is set.
        model: from col, lon, lat, ped in the vehicle's unit to rates, attitudes and w, such as an
            identified one; the exact linearisation if None. What it doesn't know isn't tuned.
        of_autopilot: whether the model's commands are the autopilot's own, 1 all of it, held for
            its ticks: of its log.
        late: s, by which the autopilot's commands act later than the model's and its own ticks
            say: negative where half a tick of another computer is in the model.
        lift: acceleration that a unit of the model's col gives, m/s^2, where w doesn't tell.
        gyro: whether the vehicle's own gyro stays in the tail: the autopilot then asks it for a
            rate of yaw, and gains of yaw are the gyro's.
        made_from: what the model is, for the file.

    Raises:
        InputError: no axis can be tuned, or a servo needs a pulse that ArduPilot doesn't send.
    """
    vehicle = load(vehicle) if isinstance(vehicle, str) else vehicle
    outputs = Outputs.of(vehicle.parameters)
    plate, remarks = swashplate(vehicle, outputs)
    groups: dict[str, Group] = {
        "swashplate and collective": plate,
        "tail": tail(outputs, gyro=gyro),
        "rotor": rotor(vehicle, outputs),
        "hover": hover(vehicle),
    }
    groups["outputs that move nothing"] = unused(outputs)
    told = {one.name: one.value for group in groups.values() for one in group}
    controls = Controls(Mixer.of(told), outputs, vehicle.swashplate)
    scale = np.eye(4) if of_autopilot else controls.scale(told["H_COL_HOVER"])
    known = model or replace(vehicle.linearize(), delays={})
    lean = (vehicle.trim.phi, vehicle.trim.theta)
    axes = [axis for axis in COMMANDS if not (gyro and axis == "ped")]
    tuning = tune(known, scale, lean=lean, late=late, held=not of_autopilot, axes=axes)
    groups["loops, and the filters in them"] = _loops()
    if gyro:
        groups["yaw"] = _asked(vehicle)
    for axis in axes:
        if axis in tuning.gains:
            groups[f"{axis_of(axis).word}"] = _axis(tuning, axis)
        else:
            remarks.append(
                f"no gains of {axis_of(axis).word}: the model doesn't know it; ArduPilot's own stay"
            )
    lifts = scale[0, 0] * lift if lift else _lift(known, scale)
    if lifts:
        groups["height"] = _height(lifts)
    else:
        remarks.append("no gains of height: the model has no w over col; ArduPilot's own stay")
    source = made_from or "its exact linearisation in the hover"
    return AutopilotParameters(
        f"{vehicle.name} flown by ArduCopter-heli; gains from {source}; by helisim parm",
        {heading: some for heading, some in {**groups, **simulated()}.items() if some},
        (*remarks, *_LEFT),
    )


_LEFT = (
    "Not derived: position and navigation (PSC_POSXY, PSC_VELXY, WPNAV) stay as ArduPilot has "
    "them. No vibration is simulated: a real helicopter needs notches (INS_HNTCH) at its rotor's "
    "speed, and INS_GYRO_FILTER 20.",
)


def _loops() -> Group:
    return (
        Setting("SCHED_LOOP_RATE", LOOP_RATE, "Hz"),
        Setting("INS_GYRO_FILTER", GYRO_HZ, "Hz: twice the usual, as nothing vibrates"),
        Setting("ATC_RATE_FF_ENAB", 1.0, "attitudes that are asked for are shaped"),
        Setting("ATC_INPUT_TC", INPUT_TIME, "s, in which the sticks are followed"),
    )


def _axis(tuning: Tuning, axis: str) -> Group:
    gains, own = tuning.gains[axis], f"ATC_RAT_{_WORDS[axis]}_"
    margins, rejection = tuning.margins(axis), tuning.rejection(axis)
    unit = "rad/s of " + str(axis_of(axis).rate)
    limit = 1.0 if axis == "ped" else 0.5
    return (
        Setting(
            f"ATC_ANG_{_WORDS[axis]}_P",
            gains.angle,
            f"1/s. Predicted, cut at the command: gain margin {margins.least_gain:.1f} dB, phase "
            f"margin {math.degrees(margins.least_phase):.0f} deg, crossover "
            f"{margins.crossover:.1f} rad/s; disturbances of {axis_of(axis).angle} rejected up to "
            f"{rejection.bandwidth:.1f} rad/s, with a peak of {rejection.peak:.1f} dB",
        ),
        Setting(
            f"{own}FF",
            _rounded(gains.ff),
            f"the command that holds 1 {unit}: {tuning.holds[axis]:.4f} of full",
        ),
        Setting(
            f"{own}P",
            _rounded(gains.p),
            "with D and ATC_ANG: the least left of disturbances below 3 rad/s that keeps 8 dB, 50 "
            "deg and a peak of 4.5 dB",
        ),
        Setting(f"{own}D", _rounded(gains.d)),
        Setting(f"{own}I", _rounded(gains.i), "half a radian a second of FF + P"),
        Setting(f"{own}IMAX", limit, "of full command"),
        Setting(f"{own}ILMI", 0.0 if axis == "ped" else 0.1, "no leak below it"),
        Setting(f"{own}D_FF", 0.0),
        Setting(f"{own}FLTT", FILTER_HZ, "Hz"),
        Setting(f"{own}FLTE", 0.0),
        Setting(f"{own}FLTD", FILTER_HZ),
    )


def _asked(vehicle: Vehicle) -> Group:
    """Return the gains of yaw where a gyro of its own turns the vehicle as it is asked."""
    full = 0.5 * vehicle.parameters["gyro.k_delta"] / vehicle.parameters["gyro.k_a"]
    why = f"full yaw asks the gyro for {full:.3f} rad/s (gyro.k_delta / k_a, half a unit of pedals)"
    none = [Setting(f"ATC_RAT_YAW_{name}", 0.0) for name in ("P", "I", "D", "D_FF", "FLTE")]
    return (
        Setting("ATC_RAT_YAW_FF", _rounded(1.0 / full), why),
        *none,
        Setting("ATC_RAT_YAW_FLTT", FILTER_HZ, "Hz"),
    )


def _height(lift: float) -> Group:
    gain = STANDARD_GRAVITY / lift
    return (
        Setting(
            "PSC_ACCZ_P",
            _rounded(gain),
            f"all of the collective lifts {lift:.1f} m/s^2: 1 g of it, as ArduPilot's guide has it "
            "of the hover's throttle",
        ),
        Setting("PSC_ACCZ_I", _rounded(2.0 * gain), "twice that, likewise"),
    )


def _lift(model: Linear, scale: NDArray[np.float64]) -> float:
    """Return the acceleration that all of the collective gives, m/s^2, 0 if nothing tells it."""
    if "w" not in model.outputs or "col" not in model.inputs:
        return 0.0
    response = model.response(np.array([_QUICK]))
    own = response[model.outputs.index("w"), model.inputs.index("col"), 0]
    k = IN1.index("col")
    return float(abs(1j * _QUICK * own) * scale[k, k])


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
