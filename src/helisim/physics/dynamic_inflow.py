"""The tip-path plane in an inflow that has states: each drives the other.

Aerodynamic moments on the hub, those that precess the disc, slope the inflow; its slopes take lift
from the blades where more air goes down. In hover that divides the blades' hold on the disc by
1 + a sigma / (16 lambda) once the slopes have come; quasi-steady flapping has it so at once
(`flapping.lock_reduction`), here the blades have all of their own Lock number.
"""

import math

from helisim.physics import inflow
from helisim.physics.flapping import (
    advance_ratios,
    disc,
    flapping_rates,
    swashplate_tilt,
    tilt_by_flight,
)
from helisim.physics.flow import main_rotor_in
from helisim.physics.kernel import kernel
from helisim.physics.layout import STATE
from helisim.physics.params import PARAM
from helisim.physics.pitt_peters import inflow_rates, wake
from helisim.physics.shaft import to_shaft


@kernel()
def keep_tilt_and_inflow_rates(view, past, step):
    """Keep the derivatives of tilt and inflow, their mean over a step (s), or now at 0.

    The mean is the midpoint's: implicit for the tilt, from a first guess for the inflow.

    Args:
        view: of the vehicle.
        past: the `Flow` past it.
        step: s.
    """
    act, par = view.act, view.par
    held = disc(par, past.speed)
    mean, right, aft = act[STATE.inflow_0], act[STATE.inflow_s], act[STATE.inflow_c]
    main, asked = past.main, swashplate_tilt(view)
    ahead, side = advance_ratios(past.hub, main)
    a_rate = b_rate = mean_rate = right_rate = aft_rate = 0.0
    for _ in range(2):
        mean_now = mean + 0.5 * step * mean_rate
        right_now, aft_now = right + 0.5 * step * right_rate, aft + 0.5 * step * aft_rate
        if step > 0.0:
            main = main_rotor_in(view, past.hub, past.speed, past.nearness, mean_now, 0.0)
        across, down_aft = right_now / main.tip_speed, aft_now / main.tip_speed
        a_flight, b_flight = tilt_by_flight(par, main, held, ahead, side, across, down_aft)
        a_rate, b_rate = flapping_rates(
            act[STATE.flap_a],
            act[STATE.flap_b],
            past.hub,
            to_shaft(par, past.air),
            asked[0] + a_flight,
            asked[1] + b_flight,
            held,
            step,
        )
        a, b = act[STATE.flap_a] + 0.5 * step * a_rate, act[STATE.flap_b] + 0.5 * step * b_rate
        roll, pitch = hub_moments(par, past, held, a, b, a_rate, b_rate)
        mean_rate, right_rate, aft_rate = wake_rates(
            par, past, main, mean_now, right_now, aft_now, roll, pitch
        )
        if step == 0.0:
            break
    act[STATE.flap_a_rate], act[STATE.flap_b_rate] = a_rate, b_rate
    act[STATE.inflow_0_rate] = mean_rate
    act[STATE.inflow_s_rate], act[STATE.inflow_c_rate] = right_rate, aft_rate


@kernel()
def hub_moments(par, past, held, a, b, a_rate, b_rate):
    """Return the aerodynamic roll and pitch moment over rho pi R^3, m^2/s^2.

    What precesses the disc, its springs and stops apart, comes from the air: a sigma / 16 of the
    square of the tip speed for a radian of cyclic pitch.

    Args:
        par: parameters.
        past: the `Flow` past the vehicle.
        held: the `Disc`.
        a: rearward tilt, rad.
        b: right tilt, rad.
        a_rate: its derivative, rad/s.
        b_rate: likewise.
    """
    motion, air = past.hub, to_shaft(par, past.air)
    by_air_a = a_rate + held.free * (motion.q + air.q) + held.stops * a
    by_air_b = b_rate + held.free * (motion.p + air.p) + held.stops * b
    by_air_a -= held.spring_aa * a + held.spring_ab * b
    by_air_b -= held.spring_ba * a - held.spring_aa * b
    turn = par[PARAM.main_speed] * past.speed * par[PARAM.main_radius] ** 2
    each = par[PARAM.main_lift_slope] * par[PARAM.main_solidity] / 16.0 * turn / held.share
    return each * by_air_a, -each * by_air_b


@kernel()
def wake_rates(par, past, main, mean, right, aft, roll, pitch):
    """Return the derivatives of the inflow's three states, m/s^2.

    Args:
        par: parameters.
        past: the `Flow` past the vehicle.
        main: what the main rotor does.
        mean: induced velocity, m/s.
        right: by how much it is more at the right tip, m/s.
        aft: by how much it is more at the rear tip, m/s.
        roll: of `hub_moments`.
        pitch: likewise.
    """
    radius, tip = par[PARAM.main_radius], main.tip_speed
    # skewed by the airspeed of the centre of gravity, as the disc's flapping is
    skewed = past.hub.u / tip, past.hub.v / tip
    behind = wake(main.induced, main.climb, main.advance, skewed[0], skewed[1])
    share, _ = inflow.ground_share(past.nearness, main.induced, main.advance)
    thrust = share * main.thrust / (par[PARAM.air_density] * math.pi * radius**2)
    return inflow_rates(mean, right, aft, thrust, roll, pitch, behind, tip, radius)
