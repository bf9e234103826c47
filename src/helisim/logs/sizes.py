"""Compares channels with what they can be at all: their size, their swing, gravity."""

import math

import numpy as np

from helisim.base.unit_names import PULSE
from helisim.base.units import RAD_PER_DEG, STANDARD_GRAVITY
from helisim.logs.declared import SAME, Channels, finding, unit_of
from helisim.logs.report import LogFinding
from helisim.records.channels import IN1, IN2

FASTEST = 40.0
"""rad/s: no gyro that flies measures more (2000 deg/s are 35)."""
_SLOWEST, _WIDE = 1.0, 2.0
"""rad/s and rad rms: what swings faster by more turns over and back each time, and is in deg/s."""
_LONG = 256
"""Samples that show a swing."""
_PITCH_MOST = 1.02 * math.pi / 2.0
ROLL_MOST = 1.02 * math.pi
"""rad: Euler's angles, with some rounding."""
_PULSES = (700.0, 2300.0)
"""us, between which a radio's pulses are."""
_UNITISED = 1.5
"""Above, a control without dimension is a percentage or a pulse."""
_FAST = tuple((name, FASTEST) for name in "pqr")


def out_of_size(channels: Channels) -> list[LogFinding]:
    """Return what the channels' own numbers say can't be as it is declared."""
    found = [*_controls(channels), *_limits(channels), *_gravity(channels)]
    beyond = {one.option for one in found}
    return found + [one for one in _swings(channels) if one.option not in beyond]


def _controls(channels: Channels) -> list[LogFinding]:
    """Return controls without dimension whose numbers are pulses or percentages."""
    found = []
    for name in (*IN1, *IN2):
        declared = channels.declared.get(name)
        if declared is None or declared.factor != 1.0:
            continue
        values = channels.columns[name]
        low, high = np.quantile(np.abs(values), (0.05, 0.95))
        middle = float(np.median(np.abs(values)))
        says = f"{name} goes from {np.min(values):.4g} to {np.max(values):.4g} without dimension"
        if _PULSES[0] <= low and high <= _PULSES[1]:
            option = declared.option(name, unit=f"{PULSE}:trim={middle:.0f}:range=800")
            text = f"{says}: a radio's pulses, us, whose trim and range are yours"
            found.append(finding("unit", text, option))
        elif high > _UNITISED:
            text = f"{says}: a percentage, or its range is another one"
            found.append(finding("unit", text, declared.option(name, unit="percent")))
    return found


def _limits(channels: Channels) -> list[LogFinding]:
    """Return angles and rates beyond what they can be in the unit that they are declared in."""
    found = []
    for name, most in (("theta", _PITCH_MOST), ("phi", ROLL_MOST), *_FAST):
        declared = channels.declared.get(name)
        if declared is None:
            continue
        largest = float(np.quantile(np.abs(channels.columns[name]), 0.999))
        smaller = RAD_PER_DEG * largest
        if largest <= most or smaller > most or declared.factor != 1.0:
            continue
        unit = "deg" if name in ("theta", "phi") else "deg/s"
        text = (
            f"{name} reaches {largest:.4g} {declared.unit}, and can reach {most:.3g}: "
            f"column {declared.column!r} is in {unit}"
        )
        found.append(finding("unit", text, declared.option(name, unit=unit)))
    return found


def _swings(channels: Channels) -> list[LogFinding]:
    """Return rates that would swing the vehicle through whole turns, to and fro."""
    found = []
    for name in "pqr":
        declared = channels.declared.get(name)
        if declared is None or declared.factor != 1.0 or channels.columns[name].size < _LONG:
            continue
        rate = channels.columns[name]
        omega = 2.0 * math.pi * np.fft.rfftfreq(rate.size, channels.step)
        angle = np.fft.rfft(rate - np.mean(rate))[omega > _SLOWEST] / omega[omega > _SLOWEST]
        swing = float(np.sqrt(2.0 * np.sum(np.abs(angle) ** 2)) / rate.size)
        if not math.isfinite(swing) or swing <= _WIDE or RAD_PER_DEG * swing > _WIDE:
            continue
        text = (
            f"{name} in {declared.unit} would swing the vehicle to and fro by {swing:.3g} rad rms, "
            f"faster than {_SLOWEST:g} rad/s: column {declared.column!r} is in deg/s"
        )
        found.append(finding("unit", text, declared.option(name, unit="deg/s")))
    return found


def _gravity(channels: Channels) -> list[LogFinding]:
    """Return what gravity says of the accelerometers: at rest and on average az is -9.81 m/s^2."""
    have = [name for name in ("ax", "ay", "az") if name in channels.declared]
    if "az" not in have:
        return []
    middle = {name: float(np.median(channels.columns[name])) for name in have}
    az, declared = middle["az"], channels.declared["az"]
    size = math.sqrt(sum(value**2 for value in middle.values()))
    other = max((name for name in have if name != "az"), key=lambda n: abs(middle[n]), default="")
    if other and abs(middle[other]) > 0.9 * size and _near(size, STANDARD_GRAVITY):
        text = (
            f"gravity, {middle[other]:.3g} m/s^2 on average, is on {other} and not on az "
            f"({az:.3g}): the accelerometers' axes are swapped"
        )
        swapped = channels.declared[other]
        flip = middle[other] > 0.0
        return [finding("axes", text, swapped.option("az", flip=flip))]
    if abs(az) < 0.5 * size or not 0.0 < abs(az) < math.inf:
        return []
    unit = (
        None
        if _near(abs(az), STANDARD_GRAVITY)
        else unit_of(declared, declared.factor * STANDARD_GRAVITY / abs(az))
    )
    flip = az > 0.0 and (unit is not None or _near(az, STANDARD_GRAVITY))
    if unit is None and not flip:
        return []
    text = (
        f"az is {az:.4g} m/s^2 on average, and gravity makes it -9.81 in axes that point down: "
        f"{'its sign is wrong' if flip else ''}{' and ' if flip and unit else ''}"
        f"{f'column {declared.column!r} is in {unit}' if unit else ''}"
    )
    return [finding("unit" if unit else "sign", text, declared.option("az", unit=unit, flip=flip))]


def _near(one: float, other: float) -> bool:
    return one > 0.0 and abs(math.log(one / other)) < 2.0 * SAME
