"""Hybrid structures: heave and flapping with the inflow, which takes time, as states.

The induced velocity follows the blades' load within a revolution or so, so that a load comes at
once and 1 / C times as large as it stays: the lift deficiency C = 1 / (1 + a sigma / (16 lambda)),
which in hover is the same for thrust and for the hub's moments (Curtiss and Shupe, AHS Forum 1971;
Chen and Hindson, NASA TM 88327). With C = 1, or far below 1 / tau, these are the models without
inflow.
"""

from helisim.ident.model.structure import Parameter, Structure
from helisim.ident.model.transfer import delay_parameter

_LAG_BOUNDS = (1e-3, 1.0)
"""s: from far below a rotor turn to far above any inflow's lag."""
_DEFICIENCY = Parameter(
    "C", "1", 0.7, (0.05, 1.0), "lift deficiency: what stays of a load once the inflow has come"
)
_TURN = Parameter(
    "turn",
    "s",
    0.005,
    None,
    "1 over the rotor's speed; A_b and B_a are the couplings beside what the blades' flapping "
    "speed makes of it",
    fixed=True,
)
_TORQUE = Parameter(
    "torque",
    "1",
    0.0,
    None,
    "torque on the hub over its moment for a radian of tilt: torque leans with the disc; "
    "negative for blades that turn counter-clockwise",
    0.02,
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


def with_inflow(flapping: Structure, name: str) -> Structure:
    """Return a model of p, q and tilts a, b with the inflow's slopes that stand against each tilt.

    The rotor's torque leans with the disc, dp/dt = L_b (b - torque a) and its like. It turns the
    hub's moment by a degree or so, as much off the axis as the inflow's slopes do.

    Args:
        flapping: whose rows of a and b are tau_f (da/dt + q) = -a + A_b b + A_lat lat + A_lon lon
            and its like, and whose moments are L_b b and M_a a.
        name: of the new one.
    """
    kept = {one.name: one for one in flapping.parameters}
    delays = [kept.pop(name) for name in ("tau_lat", "tau_lon")]
    states = (*flapping.states, "nu_a", "nu_b")
    old = len(flapping.states)
    p, q, a, b = (flapping.states.index(name) for name in ("p", "q", "a", "b"))
    lost = "1 - C"
    mass = [[*row, "0", "0"] for row in flapping.M] + [["0"] * len(states) for _ in range(2)]
    rates = [[*row, "0", "0"] for row in flapping.F] + [["0"] * len(states) for _ in range(2)]
    # tau_f (a' + q) = X / C + A_b b with the moment X = -(a - a_asked) - turn (b' + p) - nu_a,
    # tau_1 nu_a' = -C nu_a + (1 - C) (X + nu_a); likewise b, where turn has the other sign
    for tilt, other, slope, roll, sign in ((a, b, old, p, ""), (b, a, old + 1, q, "-")):
        mass[tilt][other] = f"{sign}turn/C"
        mass[slope][other], mass[slope][slope] = f"{sign}({lost})*turn", "tau_1"
        minus = "" if sign else "-"
        rates[tilt][tilt], rates[tilt][slope] = "-1/C", "-1/C"
        rates[tilt][roll] = f"{minus}turn/C"
        rates[slope][roll] = f"{minus}({lost})*turn"
        rates[slope][tilt], rates[slope][slope] = f"-({lost})", "-1"
    rates[p][a], rates[q][b] = "-torque*L_b", "torque*M_a"
    asked = [list(row) for row in flapping.G]
    slopes = [[f"({lost})*({cell})" for cell in asked[tilt]] for tilt in (a, b)]
    for tilt in (a, b):
        asked[tilt] = [f"({cell})/C" for cell in asked[tilt]]
    return Structure(
        name=name,
        meaning=f"{flapping.meaning}, and the inflow's slopes as states (fix turn at 1 over the "
        "rotor's speed, negative for blades that turn counter-clockwise)",
        parameters=(
            *kept.values(),
            Parameter("tau_1", "s", 0.03, _LAG_BOUNDS, "time constant of the inflow's slopes"),
            _DEFICIENCY,
            _TURN,
            _TORQUE,
            *delays,
        ),
        states=states,
        inputs=flapping.inputs,
        outputs=flapping.outputs,
        M=tuple(map(tuple, mass)),
        F=tuple(map(tuple, rates)),
        G=tuple(map(tuple, asked + slopes)),
        H0=tuple((*row, "0", "0") for row in flapping.H0),
        H1=tuple((*row, "0", "0") for row in flapping.H1),
        input_delays=flapping.input_delays,
        constants=flapping.constants,
    )
