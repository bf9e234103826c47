"""Rotorflight's rate controller, mode 3, compiled: one loop of it at each tick.

A mixer's 1 is 12 degrees of blade pitch, of the tail 24; rates are in deg/s, about axes forward,
left and up, as the firmware has them. Source: rotorflight-firmware 4.6, flight/pid.c, mixer.c.
"""

import math
from collections import namedtuple
from itertools import accumulate
from typing import Any

from helisim.design.laws.attitude_kernel import PLATE_NUMBERS, bounded
from helisim.physics.gyro import mix, rotate, unmix
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw

MOST_NOTCHES = 6
BIQUAD = 5  # of a notch: b0, b1, b2, a1, a2; a filter has three, b0, b1, a1
POINTS = 16  # of a curve over collective, 0 to 15 degrees
SMOOTHING = 3  # filters of a stick, one behind the other
HELD = 5.0  # loops for which an axis counts as saturated
_CURVE_END = 0.8  # of a mixer's 1, 12 degrees, where a curve has 15
_STOP_BAND = 10.0  # deg/s of error between the two stop gains of yaw


def laid_out(kind: str, names: str) -> tuple[Any, int]:
    """Return addresses by name, and the one behind; "smooth:3" takes three, one after another."""
    fields = [one.partition(":")[::2] for one in names.split()]
    ends = [0, *accumulate(int(width or 1) for _, width in fields)]
    return known(namedtuple(kind, [name for name, _ in fields]))(*ends[:-1]), ends[-1]


GENERAL, ROLL = laid_out(
    "General",
    "period cosine sine ring cross cross_filter:3 sign precomp_collective precomp_cyclic "
    f"precomp_filter:3 charge:{POINTS} fade:{POINTS} fade_limit:{POINTS} notches "
    f"notch:{BIQUAD * MOST_NOTCHES} plate:{PLATE_NUMBERS}",
)
"""Addresses of the whole law's numbers in its settings."""
AXIS, BLOCK = laid_out(
    "Axis",
    "state scale centre rate expo p i d f b o falling rising relax limit decay decay_limit "
    f"curve:{POINTS} offset_limit most smooth:3 response:3 lowpass:3 gyro:3 derivative:3 "
    "boost:3 relax_filter:3",
)
"""Addresses of an axis's numbers in its block; of collective, those of its stick alone."""
STATE, OF_AXIS = laid_out(
    "States",
    f"smooth:{SMOOTHING} response error offset saturated lowpass gyro derivative boost relax "
    f"notch:{2 * MOST_NOTCHES}",
)
"""Places of an axis's states behind its first."""
PITCH, YAW, COLLECTIVE = (ROLL + k * BLOCK for k in (1, 2, 3))
SETTINGS = COLLECTIVE + BLOCK
DEFLECTED, TILTED, CROSS, PRECOMP, FIRST = range(5)
"""States of the whole law: the mixer's collective and cyclic, two filters; then the axes'."""
COUNT = FIRST + 3 * OF_AXIS + STATE.error  # collective has its stick's filters alone


@kernel()
def filtered(state, settings, at, first, value):
    """Return a value through a filter of first order, whose state moves on."""
    out = settings[first] * value + state[at]
    state[at] = settings[first + 1] * value - settings[first + 2] * out
    return out


@kernel()
def settle(state, settings, at, first, value, out):
    """Begin a filter with what it has long had and given."""
    state[at] = out - settings[first] * value


@kernel()
def notched(state, settings, at, value):
    """Return a rate through the notches, whose states, two each, move on."""
    for k in range(int(settings[GENERAL.notches])):
        here, first = at + STATE.notch + 2 * k, GENERAL.notch + BIQUAD * k
        out = settings[first] * value + state[here]
        state[here] = settings[first + 1] * value - settings[first + 3] * out + state[here + 1]
        state[here + 1] = settings[first + 2] * value - settings[first + 4] * out
        value = out
    return value


@kernel()
def looked_up(settings, curve, collective):
    """Return a curve's value, linear between its points, at the mixer's collective."""
    place = _CURVE_END * abs(collective) * (POINTS - 1)
    k = int(min(place, POINTS - 2.0))
    before = settings[curve + k]
    return max(0.0, before + (place - k) * (settings[curve + k + 1] - before))


@kernel()
def asked(state, settings, block, stick):
    """Return what a stick, unitised, asks for: deg/s, or of collective the mixer's."""
    at = int(settings[block + AXIS.state])
    moved = bounded(2.0 * stick, 1.0)
    for k in range(SMOOTHING):
        moved = filtered(state, settings, at + STATE.smooth + k, block + AXIS.smooth, moved)
    moved = filtered(state, settings, at + STATE.response, block + AXIS.response, moved)
    expo = settings[block + AXIS.expo]
    return settings[block + AXIS.rate] * (moved * (1.0 - expo) + moved**3 * expo)


@kernel()
def sensed(state, settings, block, rate):
    """Return a rate, deg/s, behind the gyro's filters."""
    at = int(settings[block + AXIS.state])
    return filtered(
        state,
        settings,
        at + STATE.lowpass,
        block + AXIS.lowpass,
        notched(state, settings, at, rate),
    )


@kernel()
def summed(state, settings, block, off, wanted, collective):
    """Return the terms I and O of an axis; off: error, deg/s."""
    at, period = int(settings[block + AXIS.state]), settings[GENERAL.period]
    slow = filtered(state, settings, at + STATE.relax, block + AXIS.relax_filter, wanted)
    off *= max(0.0, 1.0 - settings[block + AXIS.relax] * abs(wanted - slow))
    error, offset = state[at + STATE.error], state[at + STATE.offset]
    full = state[at + STATE.saturated] > 0.5  # rounded, it counts loops
    if not (full and error * off > 0.0):
        error = bounded(error + period * off, settings[block + AXIS.limit])
    decay = settings[block + AXIS.decay] * looked_up(settings, block + AXIS.curve, collective)
    faded = bounded(decay * error, settings[block + AXIS.decay_limit])
    state[at + STATE.error] = error - period * faded
    if not (full and offset * off * collective > 0.0):
        charged = math.copysign(looked_up(settings, GENERAL.charge, collective), collective)
        most = settings[block + AXIS.offset_limit]
        offset = bounded(offset + period * off * charged, most)
    fade = looked_up(settings, GENERAL.fade, collective) * offset
    fade = bounded(fade, looked_up(settings, GENERAL.fade_limit, collective))
    state[at + STATE.offset] = offset - period * fade
    return settings[block + AXIS.i] * error, settings[block + AXIS.o] * offset * collective


@kernel()
def terms(state, settings, block, wanted, rate, collective):
    """Return the terms P, I, D, F, B, O of an axis; wanted and rate: deg/s."""
    at = int(settings[block + AXIS.state])
    rate = filtered(state, settings, at + STATE.gyro, block + AXIS.gyro, rate)
    off = wanted - rate
    share = min(1.0, max(0.0, 0.5 + 0.5 * off / _STOP_BAND))
    falling, rising = settings[block + AXIS.falling], settings[block + AXIS.rising]
    p = settings[block + AXIS.p] * off * (falling + share * (rising - falling))
    i, o = summed(state, settings, block, off, wanted, collective)
    d = filtered(state, settings, at + STATE.derivative, block + AXIS.derivative, -rate)
    b = filtered(state, settings, at + STATE.boost, block + AXIS.boost, wanted)
    d, b = settings[block + AXIS.d] * d, settings[block + AXIS.b] * b
    return p, i, d, settings[block + AXIS.f] * wanted, b, o


@kernel()
def turn_errors(state, settings, rate):
    """Turn the cyclic errors and offsets with the yaw rate, deg/s to the left."""
    angle = math.radians(rate) * settings[GENERAL.period]
    cosine, sine = math.cos(angle), math.sin(angle)
    roll, pitch = int(settings[ROLL + AXIS.state]), int(settings[PITCH + AXIS.state])
    for k in (STATE.error, STATE.offset):
        x, y = state[roll + k], state[pitch + k]
        state[roll + k], state[pitch + k] = cosine * x + sine * y, cosine * y - sine * x


@kernel()
def precompensation(state, settings):
    """Return what yaw's feedforward has of the last loop's collective and cyclic, not filtered."""
    deflected = abs(state[DEFLECTED]) * settings[GENERAL.precomp_collective]
    return (deflected + state[TILTED] * settings[GENERAL.precomp_cyclic]) ** 2


@kernel()
def loop(seen, state, settings):
    """Return setpoints of roll, pitch, yaw and collective, gyro, and terms of the three axes."""
    p, q, r = math.degrees(seen.p), -math.degrees(seen.q), -math.degrees(seen.r)
    roll, pitch = asked(state, settings, ROLL, seen.LAT), asked(state, settings, PITCH, -seen.LON)
    yaw, col = asked(state, settings, YAW, -seen.PED), asked(state, settings, COLLECTIVE, seen.COL)
    p, q = sensed(state, settings, ROLL, p), sensed(state, settings, PITCH, q)
    r = sensed(state, settings, YAW, r)
    turn_errors(state, settings, r)
    before = state[DEFLECTED]
    of_roll = terms(state, settings, ROLL, roll, p, before)
    of_pitch = terms(state, settings, PITCH, pitch, q, before)
    of_yaw = terms(state, settings, YAW, yaw, r, before)
    return (roll, pitch, yaw, col), (p, q, r), of_roll, of_pitch, of_yaw


@kernel()
def limited(state, settings, block, value):
    """Return a mixer's input within its limits; whether it is beyond them is kept."""
    at = int(settings[block + AXIS.state]) + STATE.saturated
    most = settings[block + AXIS.most]
    state[at] = HELD if abs(value) > most else max(0.0, state[at] - 1.0)
    return bounded(value, most)


@kernel()
def mixed(state, settings, wanted, of_roll, of_pitch, of_yaw):
    """Return the mixer's inputs roll, pitch, yaw and collective, and what precompensation adds."""
    crossed = filtered(state, settings, CROSS, GENERAL.cross_filter, wanted[1])
    ahead = filtered(
        state, settings, PRECOMP, GENERAL.precomp_filter, precompensation(state, settings)
    )
    ahead *= settings[GENERAL.sign]
    p, i, d, f, b, o = of_roll
    roll = limited(state, settings, ROLL, p + i + d + f + b + o + settings[GENERAL.cross] * crossed)
    p, i, d, f, b, o = of_pitch
    pitch = limited(state, settings, PITCH, p + i + d + f + b + o)
    p, i, d, f, b, o = of_yaw
    yaw = limited(state, settings, YAW, p + i + d + f + b + o + ahead)
    col = bounded(settings[COLLECTIVE + AXIS.centre] + wanted[3], settings[COLLECTIVE + AXIS.most])
    beyond = math.sqrt(roll**2 + pitch**2) * settings[GENERAL.ring]
    if beyond > 1.0:
        roll, pitch = roll / beyond, pitch / beyond
        state[int(settings[ROLL + AXIS.state]) + STATE.saturated] = HELD
        state[int(settings[PITCH + AXIS.state]) + STATE.saturated] = HELD
    roll, pitch = rotate(settings[GENERAL.cosine], settings[GENERAL.sine], roll, pitch)
    state[DEFLECTED], state[TILTED] = col, math.sqrt(roll**2 + pitch**2)
    return roll, pitch, yaw, col, ahead


@kernel()
def servos(settings, roll, pitch, yaw, col):
    """Return the commands of the front, left, right and tail servo for the mixer's inputs."""
    col -= settings[COLLECTIVE + AXIS.centre]
    front, left, right = mix(
        settings,
        settings[COLLECTIVE + AXIS.scale] * col,
        -settings[PITCH + AXIS.scale] * pitch,
        settings[ROLL + AXIS.scale] * roll,
        GENERAL.plate,
    )
    tail = settings[YAW + AXIS.scale] * (-yaw - settings[YAW + AXIS.centre])
    return front, left, right, tail


@kernel()
def rotorflight_law(seen, state, settings):
    """Return the commands of the front, left, right and tail servo."""
    wanted, _, of_roll, of_pitch, of_yaw = loop(seen, state, settings)
    roll, pitch, yaw, col, _ = mixed(state, settings, wanted, of_roll, of_pitch, of_yaw)
    return servos(settings, roll, pitch, yaw, col)


@kernel()
def begin(state, settings, block, stick, rate, mixer):
    """Begin an axis with its filters at a stick and a rate, deg/s, its I at a mixer's input."""
    at, moved = int(settings[block + AXIS.state]), bounded(2.0 * stick, 1.0)
    for k in range(SMOOTHING):
        settle(state, settings, at + STATE.smooth + k, block + AXIS.smooth, moved, moved)
    settle(state, settings, at + STATE.response, block + AXIS.response, moved, moved)
    if block == COLLECTIVE:
        return
    expo = settings[block + AXIS.expo]
    wanted = settings[block + AXIS.rate] * (moved * (1.0 - expo) + moved**3 * expo)
    settle(state, settings, at + STATE.lowpass, block + AXIS.lowpass, rate, rate)
    settle(state, settings, at + STATE.gyro, block + AXIS.gyro, rate, rate)
    settle(state, settings, at + STATE.derivative, block + AXIS.derivative, -rate, 0.0)
    settle(state, settings, at + STATE.boost, block + AXIS.boost, wanted, 0.0)
    settle(state, settings, at + STATE.relax, block + AXIS.relax_filter, wanted, wanted)
    for k in range(int(settings[GENERAL.notches])):
        here, first = at + STATE.notch + 2 * k, GENERAL.notch + BIQUAD * k
        state[here] = (1.0 - settings[first]) * rate
        state[here + 1] = (settings[first + 2] - settings[first + 4]) * rate
    state[at + STATE.error] = mixer / settings[block + AXIS.i]
    state[at + STATE.offset] = state[at + STATE.saturated] = 0.0


@kernel()
def rotorflight_start(seen, state, settings):
    """Begin with filters at the vehicle's motion, and I where the servos stand."""
    col, lon, lat = unmix(settings, seen.front, seen.left, seen.right, GENERAL.plate)
    col = settings[COLLECTIVE + AXIS.centre] + col / settings[COLLECTIVE + AXIS.scale]
    pitch, roll = -lon / settings[PITCH + AXIS.scale], lat / settings[ROLL + AXIS.scale]
    yaw = -seen.tail / settings[YAW + AXIS.scale] - settings[YAW + AXIS.centre]
    state[DEFLECTED], state[TILTED] = col, math.sqrt(roll**2 + pitch**2)
    roll, pitch = rotate(settings[GENERAL.cosine], -settings[GENERAL.sine], roll, pitch)
    ahead = precompensation(state, settings)
    settle(state, settings, PRECOMP, GENERAL.precomp_filter, ahead, ahead)
    yaw -= settings[GENERAL.sign] * ahead
    begin(state, settings, ROLL, seen.LAT, math.degrees(seen.p), roll)
    begin(state, settings, PITCH, -seen.LON, -math.degrees(seen.q), pitch)
    begin(state, settings, YAW, -seen.PED, -math.degrees(seen.r), yaw)
    begin(state, settings, COLLECTIVE, seen.COL, 0.0, 0.0)
    wanted = -2.0 * seen.LON * settings[PITCH + AXIS.rate]
    settle(state, settings, CROSS, GENERAL.cross_filter, wanted, 0.0)


COMPILED = KnownLaw(rotorflight_law, rotorflight_start)
