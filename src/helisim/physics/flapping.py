"""Tip-path-plane dynamics: longitudinal tilt a (rearwards) and lateral tilt b (right), rad.

Wu and Chen, eq. (8) of section 3.2, rows three and four, for a rigid blade at any density and rotor
speed (see `helisim.vehicle.swashplate`), with the flapping of forward flight. With s = 1 for blades
that turn clockwise seen from above, else -1, tilts A to the airspeed's lee and B to the advancing
side, and airspeed mu_x ahead and mu_y to the right (over the tip speed):

    a = (A mu_x - s B mu_y) / mu,    b = -(A mu_y + s B mu_x) / mu.

With dynamic inflow the blades have all of their Lock number, else it is reduced by 1 + a sigma /
(16 lambda). Arguments: `main`, a `MainRotor`; `held`, a `Disc`; `past`, a `Flow`; `ahead`, `right`,
of `advance_ratios`; `across`, `aft`, excess downflow at the right and rear tip, over the tip speed;
`pitch`, collective at 3/4 radius, rad; `twist`, tip's pitch minus the root's, rad.
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

_FASTEST = 0.6  # advance ratio up to which flapping grows; at 1.41 the hold is gone
_CORE = 0.7  # part of it up to which the equations hold
_HELD = 0.3  # rotor speed over nominal, below which droop stops hold the blades
_LIMP = 1e-6  # least nu^2 - 1, finite at rest


Disc = namedtuple("Disc", "share air spring_aa spring_ab spring_ba stops free stiffness lock")
"""Stiffness of a tip-path plane; stiffness: nu^2 - 1; share: Lock number / 16, signed by direction.

Springs, air, stops: 1/s; free: 1 at full speed, 0 at rest; lock: Lock number.
"""


@kernel()
def disc(par, speed):
    """Return the `Disc` at a rotor speed, over the nominal one, 0 or more."""
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
    """Return the mean da/dt, db/dt over a step, s, rad/s; targets: tilts without moments, rad."""
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
    """Return the tilt away from the airspeed over the advance ratio, rad, against no feathering.

    a1 = 2 mu (4/3 theta - lambda) / (1 - mu^2 / 2) of hinged blades (Bramwell, Helicopter Dynamics,
    ch. 3; Leishman, Principles of Helicopter Aerodynamics, ch. 4).
    """
    return 2.0 * (4.0 / 3.0 * pitch - inflow) / (1.0 - 0.5 * advance**2)


@kernel()
def coning(pitch, twist, inflow, advance, lock, stiffness):
    """Return the blades' coning, rad, without weight (Bramwell, ch. 3); stiffness: nu^2 - 1."""
    square = advance**2
    moment = pitch * (1.0 + square) + twist * (0.05 - square / 12.0) - 4.0 / 3.0 * inflow
    return lock / 8.0 * moment / (1.0 + stiffness)


@kernel()
def advance_ratios(motion, main):
    """Return the airspeed ahead and right over the tip speed, as far as flapping grows."""
    ahead, right = motion.u / main.tip_speed, motion.v / main.tip_speed
    fast = math.sqrt(ahead**2 + right**2)
    advance = soft_limit(fast, _FASTEST, _CORE)
    if fast > advance:
        ahead, right = ahead * advance / fast, right * advance / fast
    return ahead, right


@kernel()
def tilt_by_airspeed(par, main, held, ahead, right):
    """Return the tilts a and b (rad) that airspeed asks for of coned blades in even inflow."""
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
    """Return the tilts a and b (rad) of uneven inflow; direction: s of the module's equations."""
    square = 0.5 * (ahead**2 + right**2)
    part, both = 1.0 / (1.0 + square), 1.0 / (1.0 - square**2)
    along = both * (across * ahead + aft * right)
    return direction * (part * across + ahead * along), -direction * (part * aft + right * along)


@kernel()
def tilt_by_flight(par, main, held, ahead, right, across, aft):
    """Return the tilts a and b (rad) that flight asks for, against the plane of no feathering."""
    a, b = tilt_by_airspeed(par, main, held, ahead, right)
    a_slope, b_slope = tilt_by_slopes(across, aft, ahead, right, par[PARAM.main_direction])
    return a + a_slope, b + b_slope


@kernel()
def skewed_slopes(par, main, ahead, right):
    """Return the quasi-steady excess of downflow at the right and rear tip, over the tip speed.

    Dynamic inflow comes to rest there if the hub has no moment: the mean times tan(chi / 2) times
    `main_rotor.inflow_skew`, 15 pi / 32 by Pitt and Peters. It is linear in mu at the hover.
    """
    behind = wake(main.induced, main.climb, main.advance, ahead, right)
    slope = par[PARAM.inflow_skew] * par[PARAM.flap_back] * main.induced
    return -slope * behind.skew_y, slope * behind.skew_x


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
def keep_rates(view, past, step):
    """Write the derivatives of tilt and inflow, their mean over a step (s), or now at 0."""
    act, par, main = view.act, view.par, past.main
    is_dynamic = par[PARAM.main_dynamic_inflow] != 0.0
    held, asked = disc(par, past.speed), swashplate_tilt(view)
    mean, right, aft = act[STATE.inflow_0], act[STATE.inflow_s], act[STATE.inflow_c]
    ahead, side = advance_ratios(past.hub, main)
    across, down_aft = skewed_slopes(par, main, ahead, side)
    a_rate = b_rate = mean_rate = right_rate = aft_rate = 0.0
    for _ in range(2):
        mean_now = mean + 0.5 * step * mean_rate
        right_now, aft_now = right + 0.5 * step * right_rate, aft + 0.5 * step * aft_rate
        if is_dynamic:
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
        if is_dynamic:
            a, b = act[STATE.flap_a] + 0.5 * step * a_rate, act[STATE.flap_b] + 0.5 * step * b_rate
            roll, pitch = hub_moments(par, past, held, a, b, a_rate, b_rate)
            mean_rate, right_rate, aft_rate = wake_rates(
                par, past, main, mean_now, right_now, aft_now, roll, pitch
            )
        if step == 0.0 or not is_dynamic:
            break
    act[STATE.flap_a_rate], act[STATE.flap_b_rate] = a_rate, b_rate
    act[STATE.inflow_0_rate] = mean_rate
    act[STATE.inflow_s_rate], act[STATE.inflow_c_rate] = right_rate, aft_rate


@kernel()
def hub_moments(par, past, held, a, b, a_rate, b_rate):
    """Return the air's roll and pitch moment over rho pi R^3, m^2/s^2; a_rate, b_rate: rad/s."""
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
    """Return the derivatives of the inflow's states, m/s^2; arguments as of `inflow_rates`."""
    radius, tip = par[PARAM.main_radius], main.tip_speed
    # skewed by the airspeed of the centre of gravity, as the disc's flapping is
    skewed = past.hub.u / tip, past.hub.v / tip
    behind = wake(main.induced, main.climb, main.advance, skewed[0], skewed[1])
    share, _ = ground_share(past.nearness, main.induced, main.advance)
    thrust = share * main.thrust / (par[PARAM.air_density] * math.pi * radius**2)
    skew = par[PARAM.inflow_skew]
    return inflow_rates(mean, right, aft, thrust, roll, pitch, behind, tip, radius, skew)
