"""Tip-path-plane dynamics: longitudinal tilt a (rearwards) and lateral tilt b (right).

Wu and Chen, eq. (8) of section 3.2, rows three and four; with the flap-back of forward speed added.
"""

from helisim.physics.kernel import kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.main_rotor import turning
from helisim.physics.memory import from_element
from helisim.physics.servo import unmix


@kernel()
def cyclic_tilt(par, lon, lat):
    """Return the tilt that the swashplate alone calls for, rearward and right, rad.

    It is that of the plane in which the blades don't feather, on which free blades settle in still
    air.

    Args:
        par: parameters.
        lon: longitudinal cyclic, unitised.
        lat: lateral cyclic, unitised.
    """
    a = par[PARAM.a_lat] * lat + par[PARAM.a_lon] * lon
    return a, par[PARAM.b_lat] * lat + par[PARAM.b_lon] * lon


@kernel()
def flap_back(pitch, inflow, advance):
    """Return the tilt away from the airspeed, rad, by the advance ratio in that direction.

    The classical a1 = 2 mu (4/3 theta - lambda) of a rotor with free flapping (Bramwell,
    Helicopter Dynamics, ch. 3, for small mu). The airspeed is
    that of the centre of gravity: the hub's own, from turning, would add 0.7 % to tau_f q.

    Args:
        pitch: collective pitch of the blades, rad.
        inflow: inflow ratio.
        advance: advance ratio.
    """
    return 2.0 * advance * (4.0 / 3.0 * pitch - inflow)


@kernel()
def cyclic_of_turning_air(p, q, speed, direction):
    """Return the tilts a and b (rad) that turning air calls for.

    Air that turns gives the blades a cyclic pitch of its rate over the rotor's, which the tilt
    follows a quarter of a revolution later (Bramwell, Helicopter Dynamics, ch. 3): for blades
    that turn clockwise a roll of the air tilts the disc rearwards, a pitch tilts it left; for
    others forwards and right.

    Args:
        p: the air's roll rate, rad/s.
        q: its pitch rate, rad/s.
        speed: of the rotor, rad/s.
        direction: 1 for blades that turn clockwise seen from above, -1 for others.
    """
    return direction * p / speed, -direction * q / speed


@kernel()
def flapping_rates(a, b, p, q, a_target, b_target, tau_f, a_b, b_a):
    """Return da/dt and db/dt, rad/s.

    Args:
        a: rearward tilt, rad.
        b: right tilt, rad.
        p: roll rate, rad/s.
        q: pitch rate, rad/s.
        a_target: rearward tilt that cyclic and airspeed call for, rad.
        b_target: right tilt that cyclic and airspeed call for, rad.
        tau_f: rotor time constant, s.
        a_b: coupling of b into a.
        b_a: coupling of a into b.
    """
    a_rate = (-a + a_b * b + a_target) / tau_f - q
    b_rate = (-b + b_a * a + b_target) / tau_f - p
    return a_rate, b_rate


@kernel()
def tilt_rates(view, flow, step):
    """Return the mean da/dt and db/dt of the tip-path plane over a time step (s), or now at 0.

    Args:
        view: of the vehicle.
        flow: the `Flow` past it.
        step: s.
    """
    par, act = view.par, view.act
    motion, main, air = flow.motion, flow.main, flow.air
    _, lon, lat = unmix(
        from_element(par, PARAM.mix_front_col),
        act[STATE.front_position],
        act[STATE.left_position],
        act[STATE.right_position],
    )
    a_target, b_target = cyclic_tilt(par, lon, lat)
    speed, share = turning(flow.speed)
    ahead, right = motion.u / main.tip_speed, motion.v / main.tip_speed
    a_target += share * par[PARAM.flap_back] * flap_back(main.pitch, main.inflow, ahead)
    b_target -= share * par[PARAM.flap_back] * flap_back(main.pitch, main.inflow, right)
    a_turn, b_turn = cyclic_of_turning_air(
        air.p, air.q, speed * par[PARAM.main_speed], par[PARAM.main_direction]
    )
    a_target, b_target = a_target + share * a_turn, b_target + share * b_turn
    p, q = motion.p + air.p, motion.q + air.q  # the blades' inertia knows no air
    a, b = act[STATE.flap_a], act[STATE.flap_b]
    tau_f, a_b, b_a = par[PARAM.tau_f], par[PARAM.a_b], par[PARAM.b_a]
    a_rate, b_rate = 0.0, 0.0
    for _ in range(2):
        a_rate, b_rate = flapping_rates(
            a + 0.5 * step * a_rate,
            b + 0.5 * step * b_rate,
            p,
            q,
            a_target,
            b_target,
            tau_f,
            a_b,
            b_a,
        )
    return a_rate, b_rate
