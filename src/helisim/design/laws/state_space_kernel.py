"""The state-space law, compiled: matrices in its settings, called at each tick."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.pilot import wrap_to_pi
from helisim.physics.servo import mix, unmix

_COMMANDS = 4
_PLATE = 21


@known
class Layout(NamedTuple):
    """Where the numbers stand in the settings before the matrices: counts, trim, limits, plate."""

    states: int
    inputs: int
    trim: int
    limit: int
    plate: int
    rest: int


LAYOUT = Layout(0, 1, 2, 2 + _COMMANDS, 2 + 2 * _COMMANDS, 2 + 2 * _COMMANDS + _PLATE)
_HEADING = 6
"""Place of psi in `Seen`."""


def state_space_settings(
    matrices: Sequence[NDArray[np.float64]],
    places: Sequence[int],
    steady: Sequence[float],
    trim: Sequence[float],
    limits: Sequence[float],
    plate: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the settings of the compiled law, (n_settings,).

    Args:
        matrices: a, b, c, d, windup and start.
        places: of the inputs in `Seen`, (n_in,).
        steady: the inputs in the trim, (n_in,).
        trim: col, lon, lat, ped.
        limits: of these four.
        plate: numbers of the swashplate, (21,).
    """
    counts = [len(matrices[0]), len(places)]
    return np.concatenate(
        [counts, trim, limits, plate, places, steady, *(one.ravel() for one in matrices)],
        dtype=np.float64,
    )


@kernel()
def sensed(seen, settings, k):
    """Return the k-th input, from the trim's."""
    count = int(settings[LAYOUT.inputs])
    place = int(settings[LAYOUT.rest + k])
    off = seen[place] - settings[LAYOUT.rest + count + k]
    return wrap_to_pi(off) if place == _HEADING else off


@kernel()
def row_times(settings, first, count, values):
    """Return the sum of a matrix's row, which begins somewhere in the settings, times values."""
    total = 0.0
    for k in range(count):
        total += settings[first + k] * values[k]
    return total


@register_jitable(error_model="numpy")  # no `kernel`: it keeps arrays of its own
def state_space_law(seen, state, settings):
    """Return the commands of the front, left, right and tail servo."""
    n, count = int(settings[LAYOUT.states]), int(settings[LAYOUT.inputs])
    inputs, before = np.empty(count), np.empty(n)
    for k in range(count):
        inputs[k] = sensed(seen, settings, k)
    for k in range(n):
        before[k] = state[k]
    a = LAYOUT.rest + 2 * count
    b = a + n * n
    c = b + n * count
    d = c + 4 * n
    windup = d + 4 * count
    given, over = np.empty(4), np.empty(4)
    for k in range(4):
        command = settings[LAYOUT.trim + k]
        command += row_times(settings, c + k * n, n, before)
        command += row_times(settings, d + k * count, count, inputs)
        limit = settings[LAYOUT.limit + k]
        given[k] = min(limit, max(-limit, command))
        over[k] = given[k] - command
    for k in range(n):
        moved = row_times(settings, a + k * n, n, before)
        moved += row_times(settings, b + k * count, count, inputs)
        state[k] = moved + row_times(settings, windup + 4 * k, 4, over)
    front, left, right = mix(settings, given[0], given[1], given[2], LAYOUT.plate)
    return front, left, right, given[3]


@register_jitable(error_model="numpy")
def start_state(seen, state, settings):
    """Begin with the state that commands what stands, as far as the law has states for it."""
    n, count = int(settings[LAYOUT.states]), int(settings[LAYOUT.inputs])
    inputs, missing = np.empty(count), np.empty(4)
    for k in range(count):
        inputs[k] = sensed(seen, settings, k)
    d = LAYOUT.rest + 2 * count + n * n + n * count + 4 * n
    start = d + 4 * count + 4 * n
    col, lon, lat = unmix(settings, seen.front, seen.left, seen.right, LAYOUT.plate)
    missing[0], missing[1], missing[2], missing[3] = col, lon, lat, seen.tail
    for k in range(4):
        missing[k] -= settings[LAYOUT.trim + k]
        missing[k] -= row_times(settings, d + k * count, count, inputs)
    for k in range(n):
        state[k] = row_times(settings, start + 4 * k, 4, missing)


COMPILED = KnownLaw(state_space_law, start_state)
