"""The rate command law, compiled: the gyro's own laws, that begin where the servos stand."""

from typing import NamedTuple

from helisim.physics.gyro import CYCLIC, YAW, gyro_law, rotate
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.layout import PARAM, SWASH_STATES
from helisim.physics.servo import unmix


@known
class Trimmed(NamedTuple):
    """Behind the gyro's settings: servos in the trim, and the integrals that command it."""

    front: float
    left: float
    right: float
    tail: float
    p_integral: float
    q_integral: float
    r_integral: float


TRIMMED = len(PARAM)
"""Where it stands in the settings."""
SETTINGS = TRIMMED + len(Trimmed._fields)
_AT = Trimmed(*range(TRIMMED, SETTINGS))


@kernel()
def rate_start(seen, state, settings):
    """Begin with integrals that command where the servos stand; in the trim, to the last bit."""
    trimmed = seen.front == settings[_AT.front] and seen.left == settings[_AT.left]
    trimmed = trimmed and seen.right == settings[_AT.right] and seen.tail == settings[_AT.tail]
    if trimmed:
        state[CYCLIC.p_integral] = settings[_AT.p_integral]
        state[CYCLIC.q_integral] = settings[_AT.q_integral]
        state[SWASH_STATES + YAW.r_integral] = settings[_AT.r_integral]
        return
    _, lon, lat = unmix(settings, seen.front, seen.left, seen.right, PARAM.mix_front_col)
    cosine, sine = settings[PARAM.gyro_phase_cosine], settings[PARAM.gyro_phase_sine]
    lat, lon = rotate(cosine, -sine, lat, lon)
    state[CYCLIC.p_integral] = lat / settings[PARAM.gyro_ki_lat]
    state[CYCLIC.q_integral] = lon / settings[PARAM.gyro_ki_lon]
    state[SWASH_STATES + YAW.r_integral] = seen.tail / settings[PARAM.gyro_k_i]


COMPILED = KnownLaw(gyro_law, rate_start)
