"""The flow of the air past a vehicle, and what its rotors do in it."""

from typing import NamedTuple

from helisim.physics import air, ground
from helisim.physics.body import Velocities
from helisim.physics.flapping import cyclic_tilt
from helisim.physics.kernel import kernel
from helisim.physics.layout import STATE
from helisim.physics.main_rotor import MainRotor, main_rotor
from helisim.physics.memory import from_element, speed_ratio
from helisim.physics.params import PARAM
from helisim.physics.servo import unmix
from helisim.physics.shaft import to_shaft
from helisim.physics.tail_rotor import TailRotor, tail_rotor
from helisim.physics.timing import position_ahead
from helisim.physics.wake import Wash, wash


class Flow(NamedTuple):
    """The flow past a vehicle, and what its rotors do in it.

    Attributes:
        motion: velocities of the body through the air.
        hub: the same in shaft axes.
        speed: rotor speed over the nominal one.
        main: what the main rotor does.
        tail: what the tail rotor does.
        wash: the main rotor's wake at fuselage and tail.
        air: velocities of the air itself.
        nearness: (R / 4d)^2 of the ground.
    """

    motion: Velocities
    hub: Velocities
    speed: float
    main: MainRotor
    tail: TailRotor
    wash: Wash
    air: Velocities
    nearness: float


@kernel()
def flow(view, ahead):
    """Return the `Flow` past a vehicle; the blades' pitch is that of a time `ahead` (s)."""
    moving = air.motion(view)
    motion = air.relative_motion(view, moving)
    nearness, mean = ground.nearness(view), view.act[STATE.inflow_0]
    return flow_in(view, motion, moving, speed_ratio(view), nearness, mean, ahead)


@kernel()
def flow_in(view, motion, moving, speed, nearness, mean, ahead):
    """Return the `Flow` past a vehicle in an induced velocity.

    Args:
        view: of the vehicle.
        motion: `Velocities` of the body through the air.
        moving: those of the air itself.
        speed: rotor speed over the nominal one.
        nearness: (R / 4d)^2 of the ground.
        mean: induced velocity of dynamic inflow, m/s; without one it is found.
        ahead: s, at which the blades' pitch is taken.
    """
    hub = to_shaft(view.par, motion)
    main = main_rotor_in(view, hub, speed, nearness, mean, ahead)
    pedal = position_ahead(view, STATE.tail_position, ahead)
    wake = wash(view.par, hub, main, speed, nearness)
    tail = tail_rotor(view.par, motion, speed, pedal, wake.tail)
    return Flow(motion, hub, speed, main, tail, wake, moving, nearness)


@kernel()
def main_rotor_in(view, hub, speed, nearness, mean, ahead):
    """Return what a vehicle's main rotor does in velocities in shaft axes, else as `flow_in`."""
    collective, lon, lat = unmix(
        from_element(view.par, PARAM.mix_front_col),
        position_ahead(view, STATE.front_position, ahead),
        position_ahead(view, STATE.left_position, ahead),
        position_ahead(view, STATE.right_position, ahead),
    )
    tips = view.act[STATE.flap_a], view.act[STATE.flap_b]
    swashplate = cyclic_tilt(view.par, lon, lat)
    return main_rotor(view.par, hub, speed, collective, tips, swashplate, nearness, mean)


@kernel()
def flow_later(view, past, mean, ahead):
    """Return the `Flow` as it is with another induced velocity, m/s, the pitch `ahead` (s)."""
    return flow_in(view, past.motion, past.air, past.speed, past.nearness, mean, ahead)
