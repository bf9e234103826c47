"""The attitude command law, compiled: explicit model following, called at each tick.

    u = mix((s m'' + d m') + F (k (m - y) + k' (m' - y')) + integral of k_i (m - y))

where m is the command model's attitude and y what is sensed; F are filters. Numbers and states
stand one after the other in arrays; the layouts here say where.
"""

from typing import NamedTuple

from helisim.physics.gyro import mix, rotate, unmix, winds_up
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.pilot import wrap_to_pi

MOST_FILTERS = 4
"""Of one axis."""
_COEFFICIENTS = 5


@known
class General(NamedTuple):
    """Where the numbers of the whole law stand in its settings."""

    period: int
    wait: int
    line: int
    phi: int
    theta: int
    cosine: int
    sine: int
    plate: int


@known
class Attitude(NamedTuple):
    """Where the numbers of lat, lon or ped stand in their block."""

    state: int
    stick: int
    most: int
    model_aa: int
    model_ab: int
    model_ba: int
    model_bb: int
    model_a: int
    model_b: int
    ff_acceleration: int
    ff_rate: int
    k_angle: int
    k_rate: int
    k_integral: int
    k_angle_cross: int
    k_rate_cross: int
    limit: int
    wait: int
    filters: int
    first_filter: int


@known
class Heave(NamedTuple):
    """Where the numbers of col stand in their block."""

    state: int
    stick: int
    k_velocity: int
    washout: int
    share: int
    limit: int
    to_ped: int


_PLATE = 21
_BLOCK = len(Attitude._fields) - 1 + _COEFFICIENTS * MOST_FILTERS
GENERAL = General(*range(len(General._fields)))
ATTITUDE = Attitude(*range(len(Attitude._fields)))
HEAVE = Heave(*range(len(Heave._fields)))
LON = GENERAL.plate + _PLATE
LAT = LON + _BLOCK
PED = LAT + _BLOCK
COL = PED + _BLOCK
SETTINGS = COL + len(HEAVE)
"""How many settings the law has."""
MODEL, INTEGRAL, LINE = 0, 2, 3
"""Where in an axis's states the model's angle and rate, the integral and what waits begin."""
HEAVE_STATES = 3
"""Of col: its trim, the slow part of the specific force, and the velocity."""


@kernel()
def axis_states(wait, filters):
    """Return how many states an attitude's axis has."""
    return LINE + 2 * wait + 2 * filters


@kernel()
def model_next(state, settings, block, wanted):
    """Return the command model's angle and rate at the next tick."""
    at = int(settings[block + ATTITUDE.state])
    angle, rate = state[at + MODEL], state[at + MODEL + 1]
    return (
        settings[block + ATTITUDE.model_aa] * angle
        + settings[block + ATTITUDE.model_ab] * rate
        + settings[block + ATTITUDE.model_a] * wanted,
        settings[block + ATTITUDE.model_ba] * angle
        + settings[block + ATTITUDE.model_bb] * rate
        + settings[block + ATTITUDE.model_b] * wanted,
    )


@kernel()
def move_model(state, settings, block, angle, rate):
    """Move the command model on to the next tick, and what waits to be compared with."""
    at = int(settings[block + ATTITUDE.state])
    wait = int(settings[block + ATTITUDE.wait])
    line = at + LINE
    for k in range(2 * wait - 2):
        state[line + k] = state[line + k + 2]
    if wait > 0:
        state[line + 2 * wait - 2] = state[at + MODEL]
        state[line + 2 * wait - 1] = state[at + MODEL + 1]
    state[at + MODEL], state[at + MODEL + 1] = angle, rate


@kernel()
def errors(state, settings, block, angle, rate):
    """Return by how much the model, late as it is, is ahead of what is sensed: angle and rate."""
    at = int(settings[block + ATTITUDE.state])
    if settings[block + ATTITUDE.wait] > 0.0:
        at += LINE
    return wrap_to_pi(state[at] - angle), state[at + 1] - rate


@kernel()
def filtered(state, settings, block, signal):
    """Return a signal through an axis's filters, whose states move on."""
    at = int(settings[block + ATTITUDE.state])
    at += LINE + 2 * int(settings[block + ATTITUDE.wait])
    first = block + ATTITUDE.first_filter
    for _ in range(int(settings[block + ATTITUDE.filters])):
        out = settings[first] * signal + state[at]
        state[at] = settings[first + 1] * signal - settings[first + 3] * out + state[at + 1]
        state[at + 1] = settings[first + 2] * signal - settings[first + 4] * out
        signal = out
        at += 2
        first += _COEFFICIENTS
    return signal


@kernel()
def bounded(value, most):
    """Return a number within plus and minus the most."""
    return min(most, max(-most, value))


@kernel()
def asked(settings, block, stick, centre):
    """Return what a stick asks for: of an angle about its centre, rad; of ped a rate, rad/s."""
    return centre + bounded(
        settings[block + ATTITUDE.stick] * stick, settings[block + ATTITUDE.most]
    )


@kernel()
def follow(state, settings, block, reached, sensed, crossed):
    """Return an axis's command without its integral, before it is mixed, and the integral's rate.

    What goes ahead is of the model's mean rate and acceleration until the next tick, for the
    command is held so long.
    """
    at, period = int(settings[block + ATTITUDE.state]) + MODEL, settings[GENERAL.period]
    rate = wrap_to_pi(reached[0] - state[at]) / period
    acceleration = (reached[1] - state[at + 1]) / period
    angle_error, rate_error = errors(state, settings, block, sensed[0], sensed[1])
    back = settings[block + ATTITUDE.k_angle] * angle_error
    back += settings[block + ATTITUDE.k_rate] * rate_error
    back += settings[block + ATTITUDE.k_angle_cross] * crossed[0]
    back += settings[block + ATTITUDE.k_rate_cross] * crossed[1]
    ahead = settings[block + ATTITUDE.ff_acceleration] * acceleration
    ahead += settings[block + ATTITUDE.ff_rate] * rate
    summed = settings[block + ATTITUDE.k_integral] * angle_error
    return ahead + filtered(state, settings, block, back), summed


@kernel()
def with_integral(state, settings, block, command, rate):
    """Return an axis's command with its integral, within its limit, and whether it would wind up.

    Half a period of the integral's rate makes the rule trapezoidal.
    """
    period, limit = settings[GENERAL.period], settings[block + ATTITUDE.limit]
    at = int(settings[block + ATTITUDE.state]) + INTEGRAL
    command += state[at] + 0.5 * period * rate
    stops = winds_up(rate, command, limit)
    if not stops:
        state[at] += period * rate
    return bounded(command, limit), stops


@kernel()
def heave_command(state, settings, seen):
    """Return the collective: the stick's and what damps heave, by the specific force washed out."""
    at = int(settings[COL + HEAVE.state])
    velocity = state[at + 2]
    command = state[at] + settings[COL + HEAVE.stick] * seen.COL
    command += settings[COL + HEAVE.k_velocity] * velocity
    share = settings[COL + HEAVE.share]
    new = seen.az - state[at + 1]
    state[at + 2] += share * (settings[COL + HEAVE.washout] * new - velocity)
    state[at + 1] += share * new
    return bounded(command, settings[COL + HEAVE.limit])


@kernel()
def late(state, settings, col, lon, lat, ped):
    """Return the commands of some ticks ago, where the law computes for so long."""
    wait, line = int(settings[GENERAL.wait]), int(settings[GENERAL.line])
    if wait == 0:
        return col, lon, lat, ped
    old = state[line], state[line + 1], state[line + 2], state[line + 3]
    last = line + 4 * (wait - 1)
    for k in range(line, last):
        state[k] = state[k + 4]
    state[last], state[last + 1], state[last + 2], state[last + 3] = col, lon, lat, ped
    return old


@kernel()
def attitude_law(seen, state, settings):
    """Return the commands of the front, left, right and tail servo."""
    phi, theta = settings[GENERAL.phi], settings[GENERAL.theta]
    roll = model_next(state, settings, LAT, asked(settings, LAT, seen.LAT, phi))
    pitch = model_next(state, settings, LON, asked(settings, LON, seen.LON, theta))
    turn = model_next(state, settings, PED, asked(settings, PED, seen.PED, 0.0))
    roll_errors = errors(state, settings, LAT, seen.phi, seen.p)
    pitch_errors = errors(state, settings, LON, seen.theta, seen.q)
    lat, lat_rate = follow(state, settings, LAT, roll, (seen.phi, seen.p), pitch_errors)
    lon, lon_rate = follow(state, settings, LON, pitch, (seen.theta, seen.q), roll_errors)
    ped, ped_rate = follow(state, settings, PED, turn, (seen.psi, seen.r), (0.0, 0.0))
    cosine, sine = settings[GENERAL.cosine], settings[GENERAL.sine]
    lat, lon = rotate(cosine, sine, lat, lon)
    lat_rate, lon_rate = rotate(cosine, sine, lat_rate, lon_rate)
    lat, _ = with_integral(state, settings, LAT, lat, lat_rate)
    lon, _ = with_integral(state, settings, LON, lon, lon_rate)
    ped += settings[COL + HEAVE.to_ped] * seen.COL
    ped, stops = with_integral(state, settings, PED, ped, ped_rate)
    move_model(state, settings, LAT, roll[0], roll[1])
    move_model(state, settings, LON, pitch[0], pitch[1])
    heading = turn[0]
    if stops:  # the heading that is held then turns along, or it would run away
        heading = state[int(settings[PED + ATTITUDE.state]) + MODEL]
        heading += settings[GENERAL.period] * seen.r
    move_model(state, settings, PED, wrap_to_pi(heading), turn[1])
    col = heave_command(state, settings, seen)
    col, lon, lat, ped = late(state, settings, col, lon, lat, ped)
    front, left, right = mix(settings, col, lon, lat, GENERAL.plate)
    return front, left, right, ped


@kernel()
def attitude_start(seen, state, settings):
    """Begin where the vehicle is: the models with its motion, the integrals with its servos."""
    begin(state, settings, LAT, seen.phi, seen.p)
    begin(state, settings, LON, seen.theta, seen.q)
    begin(state, settings, PED, seen.psi, seen.r)
    col, lon, lat = unmix(settings, seen.front, seen.left, seen.right, GENERAL.plate)
    state[int(settings[LAT + ATTITUDE.state]) + INTEGRAL] = lat
    state[int(settings[LON + ATTITUDE.state]) + INTEGRAL] = lon
    ped = seen.tail - settings[COL + HEAVE.to_ped] * seen.COL
    state[int(settings[PED + ATTITUDE.state]) + INTEGRAL] = ped
    at = int(settings[COL + HEAVE.state])
    state[at] = col - settings[COL + HEAVE.stick] * seen.COL
    state[at + 1] = seen.az
    line = int(settings[GENERAL.line])
    for k in range(int(settings[GENERAL.wait])):
        first = line + 4 * k
        state[first], state[first + 1] = col, lon
        state[first + 2], state[first + 3] = lat, seen.tail


@kernel()
def begin(state, settings, block, angle, rate):
    """Set an axis's model, and what of it waits, to a motion."""
    at = int(settings[block + ATTITUDE.state])
    state[at + MODEL], state[at + MODEL + 1] = angle, rate
    for k in range(int(settings[block + ATTITUDE.wait])):
        state[at + LINE + 2 * k] = angle
        state[at + LINE + 2 * k + 1] = rate


COMPILED = KnownLaw(attitude_law, attitude_start)
