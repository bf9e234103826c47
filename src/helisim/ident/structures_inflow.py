"""Hybrid structures: heave and flapping with the inflow, which takes time, as states.

The induced velocity follows the blades' load within a revolution or so, so that a load comes at
once and 1 / C times as large as it stays: the lift deficiency C = 1 / (1 + a sigma / (16 lambda)),
which in hover is the same for thrust and for the hub's moments (Curtiss and Shupe, AHS Forum 1971;
Chen and Hindson, NASA TM 88327). With C = 1, or far below 1 / tau, these are the models without
inflow.
"""

from helisim.ident.structure import Parameter, Structure
from helisim.ident.transfer import delay_parameter

_LAG_BOUNDS = (1e-3, 1.0)
"""s: from far below a rotor turn to far above any inflow's lag."""
_DEFICIENCY = Parameter(
    "C", "1", 0.7, (0.05, 1.0), "lift deficiency: what stays of a load once the inflow has come"
)

heave_inflow = Structure(
    name="heave_inflow",
    meaning="vertical velocity and acceleration over collective, with the mean inflow as a state",
    parameters=(
        Parameter("Z_w", "1/s", -1.0, (-50.0, -1e-3), "heave damping once the inflow has come"),
        Parameter("Z_col", "m/s^2", -10.0, None, "vertical acceleration by collective, likewise"),
        Parameter("tau_0", "s", 0.1, _LAG_BOUNDS, "time constant of the mean inflow"),
        _DEFICIENCY,
        delay_parameter("tau_col", "delay of collective"),
    ),
    # nu is induced velocity; half of the damping stays with it, for it falls where one climbs
    states=("w", "nu"),
    inputs=("col",),
    outputs=("w", "az"),
    M=(("1", "0"), ("0", "tau_0")),
    F=(("2*Z_w/C", "-2*Z_w/C"), ("1 - C/2", "-1")),
    G=(("Z_col/C",), ("(1 - C)*Z_col/(2*Z_w)",)),
    H0=(("1", "0"), ("0", "0")),
    H1=(("0", "0"), ("1", "0")),
    input_delays={"col": "tau_col"},
)


def with_inflow(flapping: Structure) -> Structure:
    """Return the roll-pitch model with the inflow's slopes that stand against each tilt."""
    kept = {one.name: one for one in flapping.parameters}
    delays = [kept.pop(name) for name in ("tau_lat", "tau_lon")]
    return Structure(
        name="rollpitch_inflow",
        meaning="roll and pitch rate over cyclic: rigid fuselage, first-order flapping and the "
        "inflow's slopes as states (fix turn at 1 over the rotor's speed, negative for blades "
        "that turn counter-clockwise)",
        parameters=(
            *kept.values(),
            Parameter("tau_1", "s", 0.03, _LAG_BOUNDS, "time constant of the inflow's slopes"),
            _DEFICIENCY,
            Parameter(
                "turn",
                "s",
                0.005,
                None,
                "a radian of the rotor's turn; A_b and B_a are the "
                "couplings beside what the blades' flapping speed makes of it",
                fixed=True,
            ),
            *delays,
        ),
        states=(*flapping.states, "nu_a", "nu_b"),
        inputs=flapping.inputs,
        outputs=flapping.outputs,
        M=(
            ("1", "0", "0", "0", "0", "0"),
            ("0", "1", "0", "0", "0", "0"),
            ("0", "0", "tau_f", "turn/C", "0", "0"),
            ("0", "0", "-turn/C", "tau_f", "0", "0"),
            ("0", "0", "0", "(1 - C)*turn", "tau_1", "0"),
            ("0", "0", "-(1 - C)*turn", "0", "0", "tau_1"),
        ),
        F=(
            ("0", "0", "0", "L_b", "0", "0"),
            ("0", "0", "M_a", "0", "0", "0"),
            ("-turn/C", "-tau_f", "-1/C", "A_b", "-1/C", "0"),
            ("-tau_f", "turn/C", "B_a", "-1/C", "0", "-1/C"),
            ("-(1 - C)*turn", "0", "-(1 - C)", "0", "-1", "0"),
            ("0", "(1 - C)*turn", "0", "-(1 - C)", "0", "-1"),
        ),
        G=(
            ("0", "0"),
            ("0", "0"),
            ("A_lat/C", "A_lon/C"),
            ("B_lat/C", "B_lon/C"),
            ("(1 - C)*A_lat", "(1 - C)*A_lon"),
            ("(1 - C)*B_lat", "(1 - C)*B_lon"),
        ),
        input_delays=flapping.input_delays,
    )
