"""What is wrong in the paper, each with its calculation from the paper's own numbers.

Every figure of an `Erratum` is computed here, at run time, from the transcribed tables and,
for the tail rotor, from the force laws. Only what the paper says in words is quoted.
"""

from helisim.paper.errata import airframe, rollpitch, yaw
from helisim.paper.errata.erratum import Erratum

__all__ = ["Erratum", "errata"]


def errata() -> tuple[Erratum, ...]:
    """Return all that is known to be wrong in the paper, in the order of its sections."""
    return (
        airframe.tail_speed(),
        airframe.fuselage_length(),
        airframe.no_units(),
        yaw.numbered_twice(),
        yaw.eq_4(),
        yaw.eq_5_input(),
        yaw.delay_in_the_loop(),
        yaw.too_many_gains(),
        yaw.k_p_source(),
        yaw.exponents(),
        yaw.eq_8_rounding(),
        yaw.yaw_costs(),
        rollpitch.cost_very_well(),
        rollpitch.tau_f_rise(),
        rollpitch.gyro_ratio(),
        rollpitch.rise(
            "L_b and M_a", ("L_b", "M_a"), "L_b and M_a are increased in a certain degree"
        ),
        rollpitch.rise(
            "A_lat and B_lon", ("A_lat", "B_lon"), "the increasing trend is also fitted"
        ),
        rollpitch.all_rise(),
        rollpitch.inertia_ratio(),
        rollpitch.leading_delay(),
        rollpitch.bounds_kept(),
        rollpitch.tie(),
    )
