"""Tip-path-plane dynamics: longitudinal tilt a (rearwards) and lateral tilt b (right).

Wu and Chen, eq. (8) of section 3.2, rows three and four, as what a rigid blade's flapping makes of
a disc (`helisim.vehicle.swashplate` has the equation and where it comes from), so that it follows
density and rotor speed; with the flapping of forward flight added.

With s = 1 for blades that turn clockwise seen from above and -1 for others, a disc that tilts
towards the airspeed's lee by A and towards the advancing side by B has, in the air's velocity
mu_x ahead and mu_y to the right (over the tip speed), a = (A mu_x - s B mu_y) / mu and
b = -(A mu_y + s B mu_x) / mu.

Where the inflow has states, each drives the other. Aerodynamic moments on the hub, those that
precess the disc, slope the inflow; its slopes take lift from the blades where more air goes down.
In hover that divides the blades' hold on the disc by 1 + a sigma / (16 lambda) once the slopes have
come; quasi-steady flapping has it so at once (`helisim.vehicle.swashplate.lock_reduction`), here
the blades have all of their own Lock number.
"""

import math
from collections import namedtuple

from helisim.physics.flow import main_rotor_in
from helisim.physics.gyro import unmix
from helisim.physics.inflow import ground_share, inflow_rates, soft_limit, wake
from helisim.physics.kernel import from_element, kernel
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import to_shaft
from helisim.physics.rotor import cyclic_tilt

_FASTEST = 0.6
"""Advance ratio up to which flapping grows: at 1.41 the equations' hold on the disc is gone."""
_CORE = 0.7
"""Part of that limit up to which they hold as they are."""
_HELD = 0.3
"""Rotor speed over the nominal one below which droop stops begin to hold the blades."""
_LIMP = 1e-6
"""Least nu^2 - 1, by which blades without springs stay finite at rest."""
_LEAST_FLOW = 0.005
"""Speed over the tip speed below which neither drift nor flow through the disc skews the wake."""


Disc = namedtuple("Disc", "share air spring_aa spring_ab spring_ba stops free stiffness lock")
"""The stiffness of a tip-path plane at a rotor speed.

share: eps, a sixteenth of the Lock number, signed by the sense of rotation; air: 1/s, the air's
hold; spring_aa: 1/s, that of the springs, and the next two; spring_ab: 1/s; spring_ba: 1/s;
stops: 1/s, of the droop stops; free: how far the shaft turns without its blades, 1 at full
speed and 0 at rest; stiffness: nu^2 - 1; lock: the blades' own Lock number.
"""


@kernel()
def disc(par, speed):
    """Return what holds the tip-path plane, a `Disc`.

    Springs shift the precession of a disc by Omega (nu - 1), which near the nominal speed is the
    first order's Omega (nu^2 - 1) / 2; slower, where they are stiff beside the centrifugal force,
    they shift it to the frequency of the blade at rest, and take the blades along with the shaft.

    speed: of the rotor over the nominal one, 0 or more.
    """
    share = par[PARAM.air_density] * par[PARAM.flap_hold] / 16.0
    own = par[PARAM.flap_reduction] * share
    if par[PARAM.main_dynamic_inflow] != 0.0:
        share = own  # what reduces it has states then
    full = share * par[PARAM.main_speed]
    soft = par[PARAM.flap_stiffness] + _LIMP
    stiff = (1.0 + math.sqrt(1.0 + soft)) / (speed + math.sqrt(speed**2 + soft))
    stop = max(0.0, 1.0 - (speed / _HELD) ** 2) ** 2
    return Disc(
        par[PARAM.main_direction] * share,
        full * speed,
        stiff * par[PARAM.spring_aa],
        stiff * par[PARAM.spring_ab],
        stiff * par[PARAM.spring_ba],
        stop * full,
        stiff * speed * (1.0 - stop),
        par[PARAM.flap_stiffness] / max(speed, 0.1) ** 2,
        16.0 * own,
    )


@kernel()
def flapping_rates(a, b, motion, air, a_target, b_target, held, step):
    """Return the mean da/dt and db/dt over a step, or now at 0, rad/s.

    The mean is that of the implicit midpoint, which no short time constant makes unstable.

    a: rearward tilt, rad; b: right tilt, rad; air: those of the air itself; a_target: rearward tilt
    at which the air's moments on the blades vanish, rad; b_target: right tilt likewise, rad; held:
    the `Disc`; step: s.
    """
    share = held.share
    whole = 1.0 / (1.0 + share**2)
    by_air_a = held.air * a_target + held.free * share * air.p
    by_air_b = held.air * b_target - held.free * share * air.q
    aa, ab = held.spring_aa - held.air, held.spring_ab
    ba, bb = held.spring_ba, -held.spring_aa - held.air
    aa, ba = whole * (aa - share * ba) - held.stops, whole * (ba + share * aa)
    ab, bb = whole * (ab - share * bb), whole * (bb + share * ab) - held.stops
    # the blades' inertia knows no air: rates of the body in space
    a_rate = whole * (by_air_a - share * by_air_b) - held.free * (motion.q + air.q)
    b_rate = whole * (by_air_b + share * by_air_a) - held.free * (motion.p + air.p)
    a_rate, b_rate = a_rate + aa * a + ab * b, b_rate + ba * a + bb * b
    if step == 0.0:
        return a_rate, b_rate
    half = 0.5 * step
    aa, ab, ba, bb = 1.0 - half * aa, -half * ab, -half * ba, 1.0 - half * bb
    whole = 1.0 / (aa * bb - ab * ba)
    return whole * (bb * a_rate - ab * b_rate), whole * (aa * b_rate - ba * a_rate)


@kernel()
def flap_back(pitch, inflow, advance):
    """Return the tilt away from the airspeed over the advance ratio, rad.

    a1 = 2 mu (4/3 theta - lambda) / (1 - mu^2 / 2) of hinged blades, against the plane in which
    they see no cyclic pitch (Bramwell, Helicopter Dynamics, ch. 3; Leishman, Principles of
    Helicopter Aerodynamics, ch. 4); of twisted blades with the pitch at three quarters of the
    radius.

    pitch: collective pitch of the blades, rad; inflow: through that plane; advance: advance ratio.
    """
    return 2.0 * (4.0 / 3.0 * pitch - inflow) / (1.0 - 0.5 * advance**2)


@kernel()
def coning(pitch, twist, inflow, advance, lock, stiffness):
    """Return the coning of the blades, rad, without their weight (Bramwell, ch. 3).

    pitch: collective pitch of the blades at three quarters of the radius, rad; twist: tip's pitch
    minus the root's, rad; inflow: through the plane of no feathering; advance: advance ratio; lock:
    Lock number; stiffness: nu^2 - 1 of the blades' springs.
    """
    square = advance**2
    moment = pitch * (1.0 + square) + twist * (0.05 - square / 12.0) - 4.0 / 3.0 * inflow
    return lock / 8.0 * moment / (1.0 + stiffness)


@kernel()
def inflow_slope(induced, inflow, advance):
    """Return by how much more air goes down at the lee tip, over the advance ratio.

    sin^2(chi) of the mean, where chi is the wake's skew (Howlett, UH-60A Black Hawk engineering
    simulation program, NASA CR 166309, 1981; Leishman, ch. 3, compares it with others). Of the
    usual forms it alone has no slope at the hover: there the others, linear in the speed, have the
    wake skewed at once by a drift that has only begun.

    induced: induced velocity, over the tip speed; inflow: velocity through the disc; advance:
    advance ratio.
    """
    square, least = advance**2, _LEAST_FLOW**2
    return induced * square / math.sqrt(square + least) / (square + inflow**2 + least)


@kernel()
def advance_ratios(motion, main):
    """Return the airspeed ahead and to the right over the tip speed, as far as flapping grows.

    That of the centre of gravity: the hub's own, from turning, would add 0.7 % to tau_f q.

    main: what the main rotor does.
    """
    ahead, right = motion.u / main.tip_speed, motion.v / main.tip_speed
    fast = math.sqrt(ahead**2 + right**2)
    advance = soft_limit(fast, _FASTEST, _CORE)
    if fast > advance:
        ahead, right = ahead * advance / fast, right * advance / fast
    return ahead, right


@kernel()
def tilt_by_airspeed(par, main, held, ahead, right):
    """Return the tilts a and b (rad) that airspeed asks for of coned blades in even inflow.

    main: what the main rotor does; held: the `Disc`; ahead: of `advance_ratios`; right: likewise.
    """
    advance = math.sqrt(ahead**2 + right**2)
    lee = flap_back(main.pitch, main.inflow, advance)
    twist = par[PARAM.main_twist]
    cone = coning(main.pitch, twist, main.inflow, advance, held.lock, held.stiffness)
    cone = soft_limit(cone, par[PARAM.flap_stop], _CORE)
    aside = 4.0 / 3.0 * cone / (1.0 + 0.5 * advance**2) * par[PARAM.main_direction]
    much = par[PARAM.flap_back]
    return much * (lee * ahead - aside * right), -much * (lee * right + aside * ahead)


@kernel()
def tilt_by_slopes(across, aft, ahead, right, direction):
    """Return the tilts a and b (rad) that an uneven inflow asks for.

    More air down at a blade's one side takes lift there, and the disc sinks a quarter of a turn
    later; in forward flight its hold lengthwise is 1 - mu^2 / 2, and across 1 + mu^2 / 2.

    across: by how much more goes down at the right tip, over the tip speed; aft: by how much more
    at the rear tip; ahead: of `advance_ratios`; right: likewise; direction: 1 for blades that turn
    clockwise seen from above, -1 for others.
    """
    square = 0.5 * (ahead**2 + right**2)
    part, both = 1.0 / (1.0 + square), 1.0 / (1.0 - square**2)
    along = both * (across * ahead + aft * right)
    return direction * (part * across + ahead * along), -direction * (part * aft + right * along)


@kernel()
def tilt_by_flight(par, main, held, ahead, right, across, aft):
    """Return the tilts a and b (rad) that flight asks for, against that of no feathering.

    main: what the main rotor does; held: the `Disc`; ahead: of `advance_ratios`; right: likewise;
    across: by how much more air goes down at the right tip, over the tip speed; aft: by how much
    more at the rear tip.
    """
    a, b = tilt_by_airspeed(par, main, held, ahead, right)
    a_slope, b_slope = tilt_by_slopes(across, aft, ahead, right, par[PARAM.main_direction])
    return a + a_slope, b + b_slope


@kernel()
def skewed_slopes(par, main, ahead, right):
    """Return by how much more quasi-steady air goes down at the right and the rear tip.

    main: what the main rotor does; ahead: of `advance_ratios`; right: likewise.
    """
    slope = inflow_slope(main.induced, main.inflow, math.sqrt(ahead**2 + right**2))
    slope *= par[PARAM.flap_back]
    return -slope * right, slope * ahead


@kernel()
def swashplate_tilt(view):
    """Return the tilt that the swashplate alone calls for now, rearward and right, rad."""
    _, lon, lat = unmix(
        from_element(view.par, PARAM.mix_front_col),
        view.act[STATE.front_position],
        view.act[STATE.left_position],
        view.act[STATE.right_position],
    )
    return cyclic_tilt(view.par, lon, lat)


@kernel()
def tilt_rates(view, flow, step):
    """Return the mean da/dt and db/dt of the tip-path plane over a time step (s), or now at 0.

    The inflow is quasi-steady, its slope that of a skewed wake.

    flow: the `Flow` past it; step: s.
    """
    par, act, main = view.par, view.act, flow.main
    held = disc(par, flow.speed)
    ahead, right = advance_ratios(flow.hub, main)
    across, aft = skewed_slopes(par, main, ahead, right)
    a_asked, b_asked = swashplate_tilt(view)
    a_flight, b_flight = tilt_by_flight(par, main, held, ahead, right, across, aft)
    return flapping_rates(
        act[STATE.flap_a],
        act[STATE.flap_b],
        flow.hub,
        to_shaft(par, flow.air),
        a_asked + a_flight,
        b_asked + b_flight,
        held,
        step,
    )


@kernel()
def keep_tilt_and_inflow_rates(view, past, step):
    """Keep the derivatives of tilt and inflow, their mean over a step (s), or now at 0.

    The mean is the midpoint's: implicit for the tilt, from a first guess for the inflow.

    past: the `Flow` past it; step: s.
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

    past: the `Flow` past the vehicle; held: the `Disc`; a: rearward tilt, rad; b: right tilt, rad;
    a_rate: its derivative, rad/s; b_rate: likewise.
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

    past: the `Flow` past the vehicle; main: what the main rotor does; mean: induced velocity, m/s;
    right: by how much it is more at the right tip, m/s; aft: by how much it is more at the rear
    tip, m/s; roll: of `hub_moments`; pitch: likewise.
    """
    radius, tip = par[PARAM.main_radius], main.tip_speed
    # skewed by the airspeed of the centre of gravity, as the disc's flapping is
    skewed = past.hub.u / tip, past.hub.v / tip
    behind = wake(main.induced, main.climb, main.advance, skewed[0], skewed[1])
    share, _ = ground_share(past.nearness, main.induced, main.advance)
    thrust = share * main.thrust / (par[PARAM.air_density] * math.pi * radius**2)
    return inflow_rates(mean, right, aft, thrust, roll, pitch, behind, tip, radius)
