"""The attitude command law, compiled: explicit model following, called at each tick.

    u = mix((s m'' + d m') + F (k (m - y) + k' (m' - y')) + integral of k_i (m - y))

where m is the command model's attitude, y the sensed one, F filters.
"""

from collections import namedtuple

from helisim.physics.gyro import mix, rotate, unmix, winds_up
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.pilot import wrap_to_pi

MOST_FILTERS = 4  # most filters of one axis
COEFFICIENTS = 3  # numbers of a filter: b0, b1, a1
PLATE_NUMBERS = 21  # of a swashplate


General = namedtuple("General", "period phi theta cosine sine col_stick col_limit plate")
"""Addresses of the whole law's numbers in its settings."""
known(General)

Attitude = namedtuple(
    "Attitude",
    "stick state most model_aa model_ab model_ba model_bb model_a model_b ff_acceleration ff_rate "
    "k_angle k_rate k_integral k_angle_cross k_rate_cross limit filters first_filter",
)
"""Addresses of the numbers of lat, lon or ped in their block."""
known(Attitude)

GENERAL = General(*range(len(General._fields)))
ATTITUDE = Attitude(*range(len(Attitude._fields)))
BLOCK = ATTITUDE.first_filter + COEFFICIENTS * MOST_FILTERS
LON = GENERAL.plate + PLATE_NUMBERS
LAT = LON + BLOCK
PED = LAT + BLOCK
SETTINGS = PED + BLOCK  # number of settings
INTEGRAL, FILTERED = 2, 3
"""Place of the integral, and of the first filter, in an axis's states, behind the model's two."""
COL = 0  # state of the collective: its trim


@kernel()
def errors(state, settings, block, angle, rate):
    """Return the model less what is sensed: angle and rate."""
    at = int(settings[block + ATTITUDE.state])
    return wrap_to_pi(state[at] - angle), state[at + 1] - rate


@kernel()
def filtered(state, settings, block, signal):
    """Return a signal through an axis's filters, whose states move on."""
    at = int(settings[block + ATTITUDE.state]) + FILTERED
    first = block + ATTITUDE.first_filter
    for k in range(int(settings[block + ATTITUDE.filters])):
        here = first + COEFFICIENTS * k
        out = settings[here] * signal + state[at + k]
        state[at + k] = settings[here + 1] * signal - settings[here + 2] * out
        signal = out
    return signal


@kernel()
def bounded(value, most):
    """Return a number within plus and minus the most."""
    return min(most, max(-most, value))


@kernel()
def follow(state, settings, block, stick, centre, own, crossed):
    """Move an axis's command model on to the next tick, towards its stick about a centre.

    Return the command without its integral, not yet mixed, and the integral's rate; `own` and
    `crossed` are the errors of the axis and of the one that it is coupled to.
    """
    at, period = int(settings[block + ATTITUDE.state]), settings[GENERAL.period]
    most = settings[block + ATTITUDE.most]
    wanted = centre + bounded(settings[block + ATTITUDE.stick] * stick, most)
    angle = (
        settings[block + ATTITUDE.model_aa] * state[at]
        + settings[block + ATTITUDE.model_ab] * state[at + 1]
        + settings[block + ATTITUDE.model_a] * wanted
    )
    rate = (
        settings[block + ATTITUDE.model_ba] * state[at]
        + settings[block + ATTITUDE.model_bb] * state[at + 1]
        + settings[block + ATTITUDE.model_b] * wanted
    )
    ahead = settings[block + ATTITUDE.ff_acceleration] * (
        (rate - state[at + 1]) / period
    ) + settings[block + ATTITUDE.ff_rate] * (wrap_to_pi(angle - state[at]) / period)
    state[at], state[at + 1] = angle, rate
    back = (
        settings[block + ATTITUDE.k_angle] * own[0]
        + settings[block + ATTITUDE.k_rate] * own[1]
        + settings[block + ATTITUDE.k_angle_cross] * crossed[0]
        + settings[block + ATTITUDE.k_rate_cross] * crossed[1]
    )
    summed = settings[block + ATTITUDE.k_integral] * own[0]
    return ahead + filtered(state, settings, block, back), summed


@kernel()
def with_integral(state, settings, block, command, rate):
    """Return an axis's command with its integral, limited, and whether it would wind up."""
    period, limit = settings[GENERAL.period], settings[block + ATTITUDE.limit]
    at = int(settings[block + ATTITUDE.state]) + INTEGRAL
    command += state[at] + 0.5 * period * rate
    stops = winds_up(rate, command, limit)
    if not stops:
        state[at] += period * rate
    return bounded(command, limit), stops


@kernel()
def attitude_law(seen, state, settings):
    """Return the commands of the front, left, right and tail servo."""
    phi, theta = settings[GENERAL.phi], settings[GENERAL.theta]
    roll = errors(state, settings, LAT, seen.phi, seen.p)
    pitch = errors(state, settings, LON, seen.theta, seen.q)
    yaw = errors(state, settings, PED, seen.psi, seen.r)
    heading = int(settings[PED + ATTITUDE.state])
    held = state[heading]
    lat, lat_rate = follow(state, settings, LAT, seen.LAT, phi, roll, pitch)
    lon, lon_rate = follow(state, settings, LON, seen.LON, theta, pitch, roll)
    ped, ped_rate = follow(state, settings, PED, seen.PED, 0.0, yaw, (0.0, 0.0))
    cosine, sine = settings[GENERAL.cosine], settings[GENERAL.sine]
    lat, lon = rotate(cosine, sine, lat, lon)
    lat_rate, lon_rate = rotate(cosine, sine, lat_rate, lon_rate)
    lat, _ = with_integral(state, settings, LAT, lat, lat_rate)
    lon, _ = with_integral(state, settings, LON, lon, lon_rate)
    ped, stops = with_integral(state, settings, PED, ped, ped_rate)
    if stops:  # the heading that is held then turns along, or it would run away
        state[heading] = held + settings[GENERAL.period] * seen.r
    state[heading] = wrap_to_pi(state[heading])
    col = state[COL] + settings[GENERAL.col_stick] * seen.COL
    col = bounded(col, settings[GENERAL.col_limit])
    front, left, right = mix(settings, col, lon, lat, GENERAL.plate)
    return front, left, right, ped


@kernel()
def begin(state, settings, block, angle, rate, command):
    """Begin an axis with its model at an angle and a rate, its integral at a command."""
    at = int(settings[block + ATTITUDE.state])
    state[at], state[at + 1], state[at + INTEGRAL] = angle, rate, command


@kernel()
def attitude_start(seen, state, settings):
    """Begin with models at the vehicle's motion, integrals at its servos."""
    col, lon, lat = unmix(settings, seen.front, seen.left, seen.right, GENERAL.plate)
    begin(state, settings, LAT, seen.phi, seen.p, lat)
    begin(state, settings, LON, seen.theta, seen.q, lon)
    begin(state, settings, PED, seen.psi, seen.r, seen.tail)
    state[COL] = col - settings[GENERAL.col_stick] * seen.COL


COMPILED = KnownLaw(attitude_law, attitude_start)
