"""The built-in structures; transfer functions of any order beside them.

Starts are orders of magnitude for a small helicopter, not results: a fit searches from
several scattered points and solves the input gains from the data first.
"""

from helisim.base.errors import UnknownNameError
from helisim.base.units import STANDARD_GRAVITY
from helisim.ident.model.factored import factored
from helisim.ident.model.structure import Parameter, Structure
from helisim.ident.model.structures_inflow import heave_inflow, with_inflow
from helisim.ident.model.structures_speeds import with_speeds
from helisim.ident.model.transfer import (
    delay_parameter,
    first_order_delay,
    second_order_delay,
    transfer_function,
)

__all__ = [
    "BUILT_IN",
    "factored",
    "first_order_delay",
    "heave",
    "heave_imu",
    "heave_inflow",
    "hover",
    "hover_imu",
    "hover_inflow",
    "named",
    "rollpitch",
    "rollpitch_inflow",
    "rollpitch_speeds",
    "rollpitch_tied",
    "second_order_delay",
    "transfer_function",
    "yaw_base",
    "yaw_gyro",
    "yaw_overall",
    "yaw_sway",
]

_ROTOR_LAG_BOUNDS = (1e-3, 1.0)
"""s: from far below a rotor turn to far above any rotor's lag."""


def named(name: str) -> Structure:
    """Return a built-in structure. Raises UnknownNameError."""
    try:
        return BUILT_IN[name]
    except KeyError:
        raise UnknownNameError("structure", name, BUILT_IN) from None


heave = Structure(
    name="heave",
    meaning="vertical velocity over collective",
    parameters=(
        Parameter("Z_w", "1/s", -1.0, None, "heave damping"),
        Parameter("Z_col", "m/s^2", -10.0, None, "vertical acceleration by collective"),
        delay_parameter("tau_col", "delay from collective to vertical velocity"),
    ),
    states=("w",),
    inputs=("col",),
    outputs=("w",),
    F=(("Z_w",),),
    G=(("Z_col",),),
    input_delays={"col": "tau_col"},
)

heave_imu = Structure(
    name="heave_imu",
    meaning="vertical acceleration over collective: as heave, with an accelerometer",
    parameters=heave.parameters,
    states=heave.states,
    inputs=heave.inputs,
    outputs=("az",),
    F=heave.F,
    G=heave.G,
    H0=(("0",),),
    H1=(("1",),),
    input_delays=heave.input_delays,
)

yaw_base = Structure(
    name="yaw_base",
    meaning="yaw rate over pedal, sideslip apart",
    parameters=(
        Parameter("N_r", "1/s", -1.0, None, "yaw damping"),
        Parameter("N_ped", "1/s^2", 10.0, None, "yaw acceleration by pedal"),
        delay_parameter("tau_r_base", "delay from pedal to yaw rate"),
    ),
    states=("r",),
    inputs=("ped",),
    outputs=("r",),
    F=(("N_r",),),
    G=(("N_ped",),),
    input_delays={"ped": "tau_r_base"},
)

_sway = {
    "N_r": Parameter("N_r", "1/s", -1.0, None, "yaw damping"),
    "N_ped": Parameter("N_ped", "1/s^2", 10.0, None, "yaw acceleration by pedal"),
    "l_tail": Parameter("l_tail", "m", 1.0, None, "tail rotor behind the centre", fixed=True),
    "c_tail": Parameter("c_tail", "m", 0.1, None, "I_zz / (m l_tail)"),
    "Y_v": Parameter("Y_v", "1/s", 0.0, None, "side damping without the tail's", 0.1),
    "P_v": Parameter("P_v", "rad/m", 0.0, None, "quasi-steady roll rate by side velocity", 0.02),
    "tau_r_base": delay_parameter("tau_r_base", "delay from pedal to yaw rate"),
    "tau_v": delay_parameter("tau_v", "delay from pedal to side velocity"),
}


yaw_sway = Structure(
    name="yaw_sway",
    meaning="yaw rate and side velocity over pedal, where all yaw damping is the tail's "
    "(fix l_tail at the tail rotor's arm)",
    parameters=tuple(_sway.values()),
    states=("r", "v", "phi"),
    inputs=("ped",),
    outputs=("r", "v"),
    # One force T at the arm l_tail: I_zz r' = -l T, m v' = T + ..., so v' = -c_tail r' + ...
    M=(("1", "0", "0"), ("c_tail", "1", "0"), ("0", "0", "1")),
    F=(("N_r", "-N_r / l_tail", "0"), ("0", "Y_v", "g"), ("0", "P_v", "0")),
    G=(("N_ped",), ("0",), ("0",)),
    output_delays={"r": "tau_r_base", "v": "tau_v"},
    constants={"g": STANDARD_GRAVITY},
)

_led = ("-k_a*(lead + lead_filter)/lead_filter", "k_a*lead/lead_filter")
"""What the yaw gyro makes of the rate and of its lead's state: -k_a r, led."""

yaw_gyro = Structure(
    name="yaw_gyro",
    meaning="tail servo command over pedal stick: a PI yaw gyro with a lead on the rate, around "
    "base helicopter and servo (fix N_ped and tau_r_base from the base model, the rest from "
    "ground tests; signals alone give the four gains up to one common factor, so fix k_I)",
    parameters=(
        Parameter("N_ped", "1/s^2", 10.0, None, "yaw acceleration by pedal", fixed=True),
        Parameter(
            "tau_r_base", "s", 0.05, None, "delay from pedal to recorded yaw rate", fixed=True
        ),
        Parameter(
            "tau_r",
            "s",
            0.04,
            None,
            "by how much the yaw rate is recorded late; the rest "
            "of tau_r_base is the servo's, inside the loop",
            fixed=True,
        ),
        Parameter("lead", "s", 0.01, None, "the gyro's lead on the rate", fixed=True),
        Parameter("lead_filter", "s", 0.003, None, "lag that makes the lead proper", fixed=True),
        Parameter("k_I", "1/s", 10.0, None, "integral gain", fixed=True),
        Parameter("k_p", "1", 1.0, None, "proportional gain"),
        Parameter("k_delta", "1", 1.0, None, "commanded rate by stick, in the gyro's unit"),
        Parameter("k_a", "s/rad", 0.1, None, "gyro's unit by yaw rate"),
        delay_parameter("tau_PED", "delay from pedal stick to gyro"),
        Parameter(
            "N_r_slip",
            "1/s",
            -1.0,
            None,
            "yaw damping while the tail's thrust slips "
            "the helicopter sideways: N_r (1 + I_zz / (m l^2)) for a tail at the arm l",
        ),
    ),
    # rate, the integral of its error, servo (two equal lags: no overshoot), the lead's filter
    states=("r", "error", "behind", "servo", "slow"),
    inputs=("PED",),
    outputs=("ped",),
    M=(
        ("1", "0", "0", "0", "0"),
        ("0", "1", "0", "0", "0"),
        ("0", "0", "(tau_r_base - tau_r)/2", "0", "0"),
        ("0", "0", "0", "(tau_r_base - tau_r)/2", "0"),
        ("0", "0", "0", "0", "lead_filter"),
    ),
    F=(
        ("N_r_slip", "0", "0", "N_ped", "0"),
        (_led[0], "0", "0", "0", _led[1]),
        (f"k_p*({_led[0]})", "k_I", "-1", "0", f"k_p*{_led[1]}"),
        ("0", "0", "1", "-1", "0"),
        ("1", "0", "0", "0", "-1"),
    ),
    G=(("0",), ("k_delta",), ("k_p*k_delta",), ("0",), ("0",)),
    H0=((f"k_p*({_led[0]})", "k_I", "0", "0", f"k_p*{_led[1]}"),),
    D=(("k_p*k_delta",),),
    input_delays={"PED": "tau_PED"},
)

yaw_overall = transfer_function(
    zeros=1,
    poles=2,
    input="PED",
    output="r",
    delay="tau_r_all",
    name="yaw_overall",
    frequency=10.0,
)

rollpitch = Structure(
    name="rollpitch",
    meaning="roll and pitch rate over cyclic: rigid fuselage and first-order flapping",
    parameters=(
        Parameter("tau_f", "s", 0.1, _ROTOR_LAG_BOUNDS, "rotor time constant"),
        Parameter("L_b", "1/s^2", 100.0, None, "roll acceleration by lateral flapping"),
        Parameter("M_a", "1/s^2", 100.0, None, "pitch acceleration by longitudinal flapping"),
        Parameter("A_b", "1", 0.0, None, "longitudinal flapping by lateral flapping", 0.3),
        Parameter("B_a", "1", 0.0, None, "lateral flapping by longitudinal flapping", 0.3),
        Parameter("A_lat", "rad", 0.0, None, "longitudinal flapping by lateral cyclic", 0.1),
        Parameter("A_lon", "rad", 0.1, None, "longitudinal flapping by longitudinal cyclic"),
        Parameter("B_lat", "rad", 0.1, None, "lateral flapping by lateral cyclic"),
        Parameter("B_lon", "rad", 0.0, None, "lateral flapping by longitudinal cyclic", 0.1),
        delay_parameter("tau_lat", "delay of lateral cyclic"),
        delay_parameter("tau_lon", "delay of longitudinal cyclic"),
    ),
    states=("p", "q", "a", "b"),
    inputs=("lat", "lon"),
    outputs=("p", "q"),
    M=(
        ("1", "0", "0", "0"),
        ("0", "1", "0", "0"),
        ("0", "0", "tau_f", "0"),
        ("0", "0", "0", "tau_f"),
    ),
    F=(
        ("0", "0", "0", "L_b"),
        ("0", "0", "M_a", "0"),
        ("0", "-tau_f", "-1", "A_b"),
        ("-tau_f", "0", "B_a", "-1"),
    ),
    G=(("0", "0"), ("0", "0"), ("A_lat", "A_lon"), ("B_lat", "B_lon")),
    input_delays={"lat": "tau_lat", "lon": "tau_lon"},
)

rollpitch_tied = Structure(
    name="rollpitch_tied",
    meaning="as rollpitch, with A_b = -B_a",
    parameters=tuple(x for x in rollpitch.parameters if x.name != "A_b"),
    states=rollpitch.states,
    inputs=rollpitch.inputs,
    outputs=rollpitch.outputs,
    M=rollpitch.M,
    F=(
        ("0", "0", "0", "L_b"),
        ("0", "0", "M_a", "0"),
        ("0", "-tau_f", "-1", "-B_a"),
        ("-tau_f", "0", "B_a", "-1"),
    ),
    G=rollpitch.G,
    input_delays=rollpitch.input_delays,
)

rollpitch_inflow = with_inflow(rollpitch, "rollpitch_inflow")

rollpitch_speeds = with_speeds(rollpitch, "rollpitch_speeds")

_HOVER_STATES = ("u", "v", "p", "q", "phi", "theta", "a", "b")

_hover_parameters = (
    Parameter("X_u", "1/s", -0.1, None, "forward damping"),
    Parameter("X_a", "m/s^2", -10.0, None, "forward acceleration by longitudinal flapping: -g"),
    Parameter("Y_v", "1/s", -0.1, None, "side damping"),
    Parameter("Y_b", "m/s^2", 10.0, None, "side acceleration by lateral flapping: g"),
    Parameter("L_u", "rad/(s m)", 0.0, None, "roll acceleration by forward velocity", 0.5),
    Parameter("L_v", "rad/(s m)", 0.0, None, "roll acceleration by side velocity", 0.5),
    Parameter("L_b", "1/s^2", 100.0, None, "roll acceleration by lateral flapping"),
    Parameter("M_u", "rad/(s m)", 0.0, None, "pitch acceleration by forward velocity", 0.5),
    Parameter("M_v", "rad/(s m)", 0.0, None, "pitch acceleration by side velocity", 0.5),
    *rollpitch.parameters[2:3],
    *rollpitch.parameters[:1],
    *rollpitch.parameters[3:],
)
"""Mettler, Tischler and Kanade's hover model of the Yamaha R-50 (J. AHS 47, 2002) without its
stabiliser bar, heave and yaw."""


def _hover(name: str, outputs: tuple[str, ...], meaning: str) -> Structure:
    rows = {
        "u": {"u": "X_u", "theta": "-g", "a": "X_a"},
        "v": {"v": "Y_v", "phi": "g", "b": "Y_b"},
        "p": {"u": "L_u", "v": "L_v", "b": "L_b"},
        "q": {"u": "M_u", "v": "M_v", "a": "M_a"},
        "phi": {"p": "1"},
        "theta": {"q": "1"},
        "a": {"q": "-tau_f", "a": "-1", "b": "A_b"},
        "b": {"p": "-tau_f", "a": "B_a", "b": "-1"},
    }
    felt = {"ax": {"theta": "g"}, "ay": {"phi": "-g"}}
    return Structure.from_dict(
        {
            "name": name,
            "meaning": meaning,
            "parameters": {
                one.name: {
                    "unit": one.unit,
                    "start": one.start,
                    "bounds": one.bounds,
                    "meaning": one.meaning,
                    "scale": one.scale,
                }
                for one in _hover_parameters
            },
            "constants": {"g": STANDARD_GRAVITY},
            "states": _HOVER_STATES,
            "inputs": ("lat", "lon"),
            "outputs": outputs,
            "M": {"a": {"a": "tau_f"}, "b": {"b": "tau_f"}},
            "F": rows,
            "G": {"a": {"lat": "A_lat", "lon": "A_lon"}, "b": {"lat": "B_lat", "lon": "B_lon"}},
            "H0": {y: felt.get(y, {y: "1"}) for y in outputs},
            "H1": {y: {"u" if y == "ax" else "v": "1"} for y in outputs if y in felt},
            "input_delays": {"lat": "tau_lat", "lon": "tau_lon"},
        }
    )


hover = _hover(
    "hover",
    ("p", "q", "u", "v"),
    "rates and velocities over cyclic at hover: rigid body with speeds and attitudes, and "
    "first-order flapping",
)

hover_imu = _hover(
    "hover_imu",
    ("p", "q", "ax", "ay"),
    "as hover, with accelerometers for velocities: ax = du/dt + g theta, ay = dv/dt - g phi",
)

hover_inflow = with_inflow(hover, "hover_inflow")

BUILT_IN: dict[str, Structure] = {
    structure.name: structure
    for structure in (
        heave,
        heave_imu,
        heave_inflow,
        yaw_base,
        yaw_sway,
        yaw_gyro,
        yaw_overall,
        rollpitch,
        rollpitch_tied,
        rollpitch_inflow,
        rollpitch_speeds,
        hover,
        hover_imu,
        hover_inflow,
    )
}
"""The built-in structures by name."""
