"""Tip-path-plane dynamics: longitudinal tilt a (rearwards) and lateral tilt b (right).

Wu and Chen, eq. (8) of section 3.2, rows three and four; with the flap-back of forward speed added.
"""

from helisim.physics.kernel import kernel


@kernel()
def flap_back(pitch, inflow, advance):
    """Return the tilt away from the airspeed, rad, by the advance ratio in that direction.

    The classical a1 = 2 mu (4/3 theta - lambda) of a rotor with free flapping (Bramwell,
    Helicopter Dynamics, ch. 3, for small mu). The airspeed is
    that of the centre of gravity: the hub's own, from turning, would add 0.7 % to tau_f q.
    """
    return 2.0 * advance * (4.0 / 3.0 * pitch - inflow)


@kernel()
def cyclic_of_turning_air(p, q, speed):
    """Return the tilts a and b (rad) that turning air calls for.

    Air that turns gives the blades a cyclic pitch of its rate over the rotor's, which the tilt
    follows a quarter of a revolution later (Bramwell, Helicopter Dynamics, ch. 3): for blades
    that turn clockwise a roll of the air tilts the disc rearwards, a pitch tilts it left.

    Args:
        p: the air's roll rate, rad/s.
        q: its pitch rate, rad/s.
        speed: of the rotor, rad/s.
    """
    return p / speed, -q / speed


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
