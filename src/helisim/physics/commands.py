"""Does somebody set the servos while the gyro flies them? What he sets would be lost in silence.

At each of its ticks the gyro overwrites the servos' controls. What it finds there then is what it
wrote at its tick before, or somebody else's. It is nobody's command where a flight starts, where it
is zero, or where it was found before: who gives a whole row of controls at each step, as
`mujoco.rollout` takes it, has to put something there.
"""

import math

from helisim.physics.examination import OVERRULED
from helisim.physics.fields import POSITION_COUNT
from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, FIRST_LAW_STATE, STATE
from helisim.physics.memory import double, doubles_at, fence, integer, longs_at
from helisim.physics.notes import OVERWRITTEN, note, slot
from helisim.physics.params import NO_LAW, PARAM
from helisim.physics.timing import tick_number

_DATA, _ROTOR, _TICK, _STATES, _WROTE, _FOUND, _AGE, _CHECK = 0, 1, 2, 3, 4, 8, 12, 13
"""Where in a slot, in numbers: address of mjData, the rotor, the gyro's last tick, a sum of the
laws' states, the four servos' controls as they were written there, and as they were found; how
often mjData had been evaluated, as another's flight may have ended at this address; and a sum of
these, as two threads may have met in one slot."""


@kernel()
def notice_others(view):
    """Note it if somebody else set the servos since the gyro wrote them. Before it does so."""
    kept, number = _slot(view), _tick(view)
    starts = number == 0.0 and view.act[STATE.law_tick] == 0.0
    sound = _is_sound(view)
    follows = sound and kept[_TICK] == number - 1.0 and kept[_STATES] == _sum(view)
    other = -1
    for k in range(3, -1, -1):
        found = view.controls[CONTROL.servo_front + k]
        own = sound and found == kept[_WROTE + k]
        strange = follows and not own and found != kept[_FOUND + k]
        if starts:
            strange = not own and found != view.act[STATE.front_position + 2 * k]
        law = PARAM.tail_law if k == 3 else PARAM.swash_law
        if strange and found != 0.0 and not math.isnan(found) and view.par[law] != NO_LAW:
            other = k
    if other >= 0:
        fence()  # what was read must have been this vehicle's all the while
        if sound == _is_sound(view):
            _note(view, other, view.controls[CONTROL.servo_front + other])
    for k in range(4):
        kept[_FOUND + k] = view.controls[CONTROL.servo_front + k]


@kernel()
def remember(view):
    """Keep what the gyro wrote to the servos."""
    kept = _slot(view)
    longs_at(_place(view))[_DATA] = view.d
    kept[_ROTOR], kept[_TICK], kept[_STATES] = view.rotor, _tick(view), _sum(view)
    for k in range(4):
        kept[_WROTE + k] = view.controls[CONTROL.servo_front + k]
    kept[_AGE] = _age(view)
    kept[_CHECK] = _check(kept)


@kernel(forceinline=False)
def _note(view, servo, found):
    m, offsets = view.m, view.offsets
    actuator = view.rotor - CONTROL.rotor + CONTROL.servo_front + servo
    note(OVERWRITTEN, OVERRULED, m, offsets, offsets.name_actuatoradr, actuator, found, 0.0)


@kernel()
def _place(view):
    return slot(view.d + view.rotor)


@kernel()
def _slot(view):
    return doubles_at(_place(view))


@kernel()
def _tick(view):
    return tick_number(view.par, double(view.d, view.offsets.time)) + 0.0


@kernel()
def _is_sound(view):
    """Return whether what is kept in the slot is this vehicle's, from an evaluation before."""
    kept = _slot(view)
    if kept[_AGE] >= _age(view):
        return False
    same = longs_at(_place(view))[_DATA] == view.d and kept[_ROTOR] == view.rotor
    return same and kept[_CHECK] == _check(kept)


@kernel()
def _age(view):
    """Return how often this mjData was evaluated: 0 when it is made or reset."""
    return integer(view.d, view.offsets.timer + POSITION_COUNT) + 0.0


@kernel()
def _check(kept):
    total = 0.0
    for k in range(_ROTOR, _CHECK):
        total += (k + 0.5) * kept[k]
    return total


@kernel()
def _sum(view):
    """Return a sum of states that are kept from tick to tick: another flight's is another."""
    act = view.act
    total = act[STATE.law_tick]
    for k in range(8):
        total += (k + 1.0) * act[FIRST_LAW_STATE + k]
    return total
