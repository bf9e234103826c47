"""Built-in structures and transfer functions.

Starts are orders of magnitude for a small helicopter.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from helisim.base.errors import InputError, item_of
from helisim.base.units import STANDARD_GRAVITY
from helisim.ident.structure import DELAYS, MATRICES, Parameter, Structure

__all__ = [
    "BUILT_IN",
    "heave",
    "heave_imu",
    "heave_inflow",
    "hover",
    "hover_imu",
    "hover_inflow",
    "named",
    "rollpitch",
    "rollpitch_inflow",
    "rollpitch_round",
    "rollpitch_speeds",
    "rollpitch_tied",
    "transfer_function",
    "yaw_alone",
    "yaw_base",
    "yaw_gyro",
    "yaw_overall",
    "yaw_sway",
]

_TRANSFER = re.compile(r"tf:(\d{1,2})/(\d{1,2})$")

_DELAY_BOUNDS = (-0.3, 5.0)  # s; searches look as far as `rational.delay_grid`
_LAG = (1e-3, 1.0)  # s: from far below to far above any lag of rotor or inflow
_BESIDE = (-3.0, 1.0)  # 1/s: damping of fuselage and tail besides the rotor


def delay_parameter(name: str, meaning: str) -> Parameter:
    """Return a delay of either sign."""
    return Parameter(name, "s", 0.0, _DELAY_BOUNDS, meaning, 0.03)


def transfer_function(
    *,
    zeros: int,
    poles: int,
    input: str,
    output: str,
    delay: str | None = "tau",
    name: str | None = None,
    frequency: float = 5.0,
) -> Structure:
    """Return (b_m s^m + ... + b0) e^(-tau s) / (s^n + a_(n-1) s^(n-1) + ... + a0).

    `zeros` is m, `poles` n >= m; `delay` is its name or None; starts are at `frequency`, rad/s.
    """
    if not 0 <= zeros <= poles:
        raise InputError(
            f"a transfer function has {zeros} zeros and {poles} poles; expected 0 <= zeros <= poles"
        )
    starts = [1.0, 2.0**0.5] if poles == 2 else [1.0]  # of well-damped poles
    for k in range(len(starts) - 1, poles - 1):
        starts.append(starts[-1] * (poles - k) / (k + 1.0))
    numerator = [Parameter(f"b{k}", "", 1.0, None, f"numerator, s^{k}") for k in range(zeros + 1)]
    denominator = [
        Parameter(
            f"a{k}",
            "1/s" if poles - k == 1 else f"1/s^{poles - k}",
            starts[k] * frequency ** (poles - k),
            None,
            f"denominator, s^{k}",
        )
        for k in range(poles)
    ]
    late = [delay_parameter(delay, "delay")] if delay else []
    gains = [f"b{k}" if k <= zeros else "0" for k in range(poles)]
    if zeros == poles:
        gains = [f"b{k} - a{k}*b{poles}" for k in range(poles)]
    # observable form: the numerator enters G alone, so it is solved from the data first
    rows = [["1" if j == k - 1 else "0" for j in range(poles)] for k in range(poles)]
    for k in range(poles):
        rows[k][-1] = f"-a{k}"
    return Structure(
        name=name or f"{output}_over_{input}",
        meaning=f"transfer function with {zeros} zeros and {poles} poles",
        parameters=(*reversed(numerator), *reversed(denominator), *late),
        states=tuple(f"x{k}" for k in range(poles)),
        inputs=(input,),
        outputs=(output,),
        F=tuple(map(tuple, rows)),
        G=tuple((gain,) for gain in gains),
        H0=(("0",) * (poles - 1) + ("1",) * (poles > 0),),
        D=((f"b{poles}" if zeros == poles else "0",),),
        input_delays={input: delay} if delay else {},
    )


_PARAMETERS = {
    one.name: one
    for one in (
        Parameter("Z_w", "1/s", -1.0, None, "heave damping"),
        Parameter("Z_col", "m/s^2", -10.0, None, "vertical acceleration by collective"),
        delay_parameter("tau_col", "delay from collective to vertical velocity"),
        Parameter("N_r", "1/s", -1.0, None, "yaw damping"),
        Parameter("N_ped", "1/s^2", 10.0, None, "yaw acceleration by pedal"),
        delay_parameter("tau_r_base", "delay from pedal to yaw rate"),
        Parameter("l_tail", "m", 1.0, None, "tail rotor behind the centre", fixed=True),
        Parameter("c_tail", "m", 0.1, None, "I_zz / (m l_tail)"),
        Parameter("P_v", "rad/m", 0.0, None, "quasi-steady roll rate by side velocity", 0.02),
        delay_parameter("tau_v", "delay from pedal to side velocity"),
        Parameter("lead", "s", 0.01, None, "the gyro's lead on the rate", fixed=True),
        Parameter("lead_filter", "s", 0.003, None, "lag that makes the lead proper", fixed=True),
        Parameter("k_I", "1/s", 10.0, None, "integral gain", fixed=True),
        Parameter("k_p", "1", 1.0, None, "proportional gain"),
        Parameter("k_delta", "1", 1.0, None, "commanded rate by stick, in the gyro's unit"),
        Parameter("k_a", "s/rad", 0.1, None, "gyro's unit by yaw rate"),
        delay_parameter("tau_PED", "delay from pedal stick to gyro"),
        Parameter("tau_f", "s", 0.1, _LAG, "rotor time constant"),
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
        Parameter("A_u", "rad s/m", 1e-3, (-0.02, 0.02), "flap-back by forward velocity"),
        Parameter("A_v", "rad s/m", 0.0, (-0.02, 0.02), "flap-back by side velocity", 0.005),
        Parameter("L_p", "1/s", 0.0, _BESIDE, "roll damping beside the rotor's", 0.1, True, 0.1),
        Parameter("M_q", "1/s", 0.0, _BESIDE, "pitch damping beside the rotor's", 0.1, True, 0.1),
        Parameter("X_u", "1/s", -0.1, None, "forward damping"),
        Parameter("X_a", "m/s^2", -10.0, None, "forward acceleration by longitudinal flapping: -g"),
        Parameter("Y_v", "1/s", -0.1, None, "side damping"),
        Parameter("Y_b", "m/s^2", 10.0, None, "side acceleration by lateral flapping: g"),
        Parameter("L_u", "rad/(s m)", 0.0, None, "roll acceleration by forward velocity", 0.5),
        Parameter("L_v", "rad/(s m)", 0.0, None, "roll acceleration by side velocity", 0.5),
        Parameter("M_u", "rad/(s m)", 0.0, None, "pitch acceleration by forward velocity", 0.5),
        Parameter("M_v", "rad/(s m)", 0.0, None, "pitch acceleration by side velocity", 0.5),
        Parameter("tau_0", "s", 0.1, _LAG, "time constant of the mean inflow"),
        Parameter("tau_1", "s", 0.03, _LAG, "time constant of the inflow's slopes"),
        Parameter(
            "C",
            "1",
            0.7,
            (0.05, 1.0),
            "lift deficiency: what stays of a load once the inflow has come",
        ),
        Parameter(
            "turn",
            "s",
            0.005,
            None,
            "1 over the rotor's speed; A_b and B_a are the couplings beside what the blades' "
            "flapping speed makes of it",
            fixed=True,
        ),
        Parameter(
            "torque",
            "1",
            0.0,
            None,
            "torque on the hub over its moment for a radian of tilt: torque leans with the disc; "
            "negative for blades that turn counter-clockwise",
            0.02,
        ),
    )
}

Cells = Mapping[str, Mapping[str, str]]  # expressions by row and column


def _built(
    name: str,
    meaning: str,
    parameters: str,
    *own: Parameter,
    states: str = "",
    inputs: str = "",
    outputs: str = "",
    like: Structure | None = None,
    delays: Mapping[str, Mapping[str, str]] | None = None,
    **matrices: Cells,
) -> Structure:
    """Build a structure from cells by row and column, replacing those of `like` if given."""
    old = {axis: getattr(like, axis, ()) for axis in ("states", "inputs", "outputs")}
    axes = {
        "states": (*old["states"], *states.split()),
        "inputs": tuple(inputs.split()) or old["inputs"],
        "outputs": tuple(outputs.split()) or old["outputs"],
    }
    made: dict[str, Any] = {}
    for key, (rows, columns) in MATRICES.items():
        changed = matrices.get(key, {})
        same = key == "M" or (key == "H0" and not changed)
        cells = {
            (y, x): cell
            for y, line in zip(old[rows], getattr(like, key, ()))
            for x, cell in zip(old[columns], line)
        }
        cells |= {(y, x): cell for y, line in changed.items() for x, cell in line.items()}
        made[key] = tuple(
            tuple(cells.get((y, x), str(int(same and x == y))) for x in axes[columns])
            for y in axes[rows]
        )
    known = _PARAMETERS | {one.name: one for one in own}
    found = tuple(known[one] for one in parameters.split())
    heavy = {"g", "-g"} & {cell for line in made["F"] for cell in line}
    constants = {"g": STANDARD_GRAVITY} if heavy else {}
    tables = {table: getattr(like, table, {}) for table in ("input_delays", "output_delays")}
    made |= axes | dict(delays or tables)
    return Structure(name, found, **made, constants=constants, meaning=meaning)


heave = _built(
    "heave",
    "vertical velocity over collective",
    "Z_w Z_col tau_col",
    states="w",
    inputs="col",
    outputs="w",
    F={"w": {"w": "Z_w"}},
    G={"w": {"col": "Z_col"}},
    delays={"input_delays": {"col": "tau_col"}},
)
heave_imu = _built(
    "heave_imu",
    "vertical acceleration over collective: as heave, with an accelerometer",
    "Z_w Z_col tau_col",
    like=heave,
    outputs="az",
    H1={"az": {"w": "1"}},
)
heave_inflow = _built(
    "heave_inflow",
    "vertical velocity and acceleration over collective, with the mean inflow as a state",
    "Z_w Z_col tau_0 C tau_col",
    Parameter("Z_w", "1/s", -1.0, (-50.0, -1e-3), "heave damping once the inflow has come"),
    Parameter("Z_col", "m/s^2", -10.0, None, "vertical acceleration by collective, likewise"),
    delay_parameter("tau_col", "delay of collective"),
    # nu is induced velocity; half of the damping stays with it
    like=heave,
    states="nu",
    outputs="w az",
    M={"nu": {"nu": "tau_0"}},
    F={"w": {"w": "2*Z_w/C", "nu": "-2*Z_w/C"}, "nu": {"w": "1 - C/2", "nu": "-1"}},
    G={"w": {"col": "Z_col/C"}, "nu": {"col": "(1 - C)*Z_col/(2*Z_w)"}},
    H1={"az": {"w": "1"}},
)
yaw_base = _built(
    "yaw_base",
    "yaw rate over pedal, sideslip apart",
    "N_r N_ped tau_r_base",
    states="r",
    inputs="ped",
    outputs="r",
    F={"r": {"r": "N_r"}},
    G={"r": {"ped": "N_ped"}},
    delays={"input_delays": {"ped": "tau_r_base"}},
)
yaw_alone = _built(
    "yaw_alone",
    "as yaw_base, where nothing tells the sideslip: by how much of it N_r seems too large is "
    "taken as 0 +- 0.12",
    "N_r N_ped sideslip tau_r_base",
    # 0.19 of the JR700 swept from 1.3 rad/s, less well above its lateral mode
    Parameter("sideslip", "1", 0.0, None, "share of N_r that sideslip feigns", 0.1, True, 0.12),
    like=yaw_base,
    F={"r": {"r": "N_r*(1 + sideslip)"}},
)
yaw_sway = _built(
    "yaw_sway",
    "yaw rate and side velocity over pedal, where all yaw damping is the tail's "
    "(fix l_tail at the tail rotor's arm)",
    "N_r N_ped l_tail c_tail Y_v P_v tau_r_base tau_v",
    Parameter("Y_v", "1/s", 0.0, None, "side damping without the tail's", 0.1),
    # One force T at the arm l_tail: I_zz r' = -l T, m v' = T + ..., so v' = -c_tail r' + ...
    like=yaw_base,
    states="v phi",
    outputs="r v",
    M={"v": {"r": "c_tail"}},
    F={"r": {"v": "-N_r / l_tail"}, "v": {"v": "Y_v", "phi": "g"}, "phi": {"v": "P_v"}},
    delays={"output_delays": {"r": "tau_r_base", "v": "tau_v"}},
)

_led = {"r": "-k_a*(lead + lead_filter)/lead_filter", "slow": "k_a*lead/lead_filter"}
_proportional = {
    state: f"k_p*{f'({cell})' if state == 'r' else cell}" for state, cell in _led.items()
}

yaw_gyro = _built(
    "yaw_gyro",
    "tail servo command over pedal stick: a PI yaw gyro with a lead on the rate, around "
    "base helicopter and servo (fix N_ped and tau_r_base from the base model, the rest from "
    "ground tests; signals alone give the four gains up to one common factor, so fix k_I)",
    "N_ped tau_r_base tau_r lead lead_filter k_I k_p k_delta k_a tau_PED N_r_slip",
    replace(_PARAMETERS["N_ped"], fixed=True),
    Parameter("tau_r_base", "s", 0.05, None, "delay from pedal to recorded yaw rate", fixed=True),
    Parameter(
        "tau_r",
        "s",
        0.04,
        None,
        "by how much the yaw rate is recorded late; the rest of tau_r_base is the servo's, inside "
        "the loop",
        fixed=True,
    ),
    Parameter(
        "N_r_slip",
        "1/s",
        -1.0,
        None,
        "yaw damping while the tail's thrust slips the helicopter sideways: "
        "N_r (1 + I_zz / (m l^2)) for a tail at the arm l",
    ),
    # rate, its error's integral, servo (two equal lags), filter of the lead
    states="r error behind servo slow",
    inputs="PED",
    outputs="ped",
    M={
        **{lag: {lag: "(tau_r_base - tau_r)/2"} for lag in ("behind", "servo")},
        "slow": {"slow": "lead_filter"},
    },
    F={
        "r": {"r": "N_r_slip", "servo": "N_ped"},
        "error": _led,
        "behind": {**_proportional, "error": "k_I", "behind": "-1"},
        "servo": {"behind": "1", "servo": "-1"},
        "slow": {"r": "1", "slow": "-1"},
    },
    G={"error": {"PED": "k_delta"}, "behind": {"PED": "k_p*k_delta"}},
    H0={"ped": {**_proportional, "error": "k_I"}},
    D={"ped": {"PED": "k_p*k_delta"}},
    delays={"input_delays": {"PED": "tau_PED"}},
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

_FLAPPING = "A_lat A_lon B_lat B_lon"
_CYCLIC = {"input_delays": {"lat": "tau_lat", "lon": "tau_lon"}}
rollpitch = _built(
    "rollpitch",
    "roll and pitch rate over cyclic: rigid fuselage and first-order flapping",
    f"tau_f L_b M_a A_b B_a {_FLAPPING} tau_lat tau_lon",
    states="p q a b",
    inputs="lat lon",
    outputs="p q",
    M={"a": {"a": "tau_f"}, "b": {"b": "tau_f"}},
    F={
        "p": {"b": "L_b"},
        "q": {"a": "M_a"},
        "a": {"q": "-tau_f", "a": "-1", "b": "A_b"},
        "b": {"p": "-tau_f", "a": "B_a", "b": "-1"},
    },
    G={"a": {"lat": "A_lat", "lon": "A_lon"}, "b": {"lat": "B_lat", "lon": "B_lon"}},
    delays=_CYCLIC,
)
rollpitch_tied = _built(
    "rollpitch_tied",
    "as rollpitch, with A_b = -B_a",
    f"tau_f L_b M_a B_a {_FLAPPING} tau_lat tau_lon",
    like=rollpitch,
    F={"a": {"b": "-B_a"}},
)


def with_inflow(flapping: Structure, name: str) -> Structure:
    """Return a model of p, q and tilts a, b with dynamic inflow.

    A load begins 1 / C times as large as it stays, C = 1 / (1 + a sigma / (16 lambda)) (Curtiss and
    Shupe, AHS Forum 1971; Chen and Hindson, NASA TM 88327); C = 1 is without inflow. dp/dt = L_b (b
    - torque a). `flapping` has rows tau_f (da/dt + q) = -a + A_b b + A_lat lat + A_lon lon.
    """
    mass: dict[str, dict[str, str]] = {}
    rates = {"p": {"a": "-torque*L_b"}, "q": {"b": "torque*M_a"}}
    drive: dict[str, dict[str, str]] = {}
    # tau_f (a' + q) = X / C + A_b b with the moment X = -(a - a_asked) - turn (b' + p) - nu_a,
    # tau_1 nu_a' = -C nu_a + (1 - C) (X + nu_a); likewise b, where turn has the other sign
    for tilt, other, roll, sign, minus in (("a", "b", "p", "", "-"), ("b", "a", "q", "-", "")):
        slope = f"nu_{tilt}"
        mass[tilt] = {other: f"{sign}turn/C"}
        mass[slope] = {other: f"{sign}(1 - C)*turn", slope: "tau_1"}
        rates[tilt] = {tilt: "-1/C", slope: "-1/C", roll: f"{minus}turn/C"}
        rates[slope] = {roll: f"{minus}(1 - C)*turn", tilt: "-(1 - C)", slope: "-1"}
        asked = dict(zip(flapping.inputs, flapping.G[flapping.states.index(tilt)]))
        drive[tilt] = {key: f"({cell})/C" for key, cell in asked.items()}
        drive[slope] = {key: f"(1 - C)*({cell})" for key, cell in asked.items()}
    kept = " ".join(one for one in flapping.names if one not in ("tau_lat", "tau_lon"))
    return _built(
        name,
        f"{flapping.meaning}, and the inflow's slopes as states (fix turn at 1 over the "
        "rotor's speed, negative for blades that turn counter-clockwise)",
        f"{kept} tau_1 C turn torque tau_lat tau_lon",
        like=flapping,
        states="nu_a nu_b",
        M=mass,
        F=rates,
        G=drive,
    )


rollpitch_inflow = with_inflow(rollpitch, "rollpitch_inflow")
rollpitch_speeds = _built(
    "rollpitch_speeds",
    # The tilted thrust accelerates it, and the disc flaps back from the speed, which is several
    # percent of the rates at three times the frequency of the hover's slow modes.
    f"{rollpitch.meaning}, with the speeds that tilting gathers: flap-back, and what fuselage and "
    "tail do (dampings 0 +- 0.1 1/s, L_v 0 +- 0.2 and M_u 0 +- 0.1 rad/(s m); free L_p and M_q "
    "where sweeps are long)",
    f"{' '.join(rollpitch.names)} A_u A_v L_p M_q X_u Y_v L_v M_u",
    # the JR700 has -0.01, -0.06, -0.10 and 0.06, the Blade 360 -0.01, -0.12, -0.54 and 0.08
    *(
        replace(_PARAMETERS[name], start=0.0, scale=0.1, fixed=True, error=error)
        for name, error in {"X_u": 0.1, "Y_v": 0.1, "L_v": 0.2, "M_u": 0.1}.items()
    ),
    like=rollpitch,
    states="u v phi theta",
    F={
        "p": {"p": "L_p", "v": "L_v"},
        "q": {"q": "M_q", "u": "M_u"},
        "a": {"u": "A_u", "v": "A_v"},
        "b": {"u": "A_v", "v": "-A_u"},  # the rotor is round
        "u": {"u": "X_u", "theta": "-g", "a": "-g"},
        "v": {"v": "Y_v", "phi": "g", "b": "g"},
        "phi": {"p": "1"},
        "theta": {"q": "1"},
    },
)
# What is odd: the JR700 has 0.18, -0.02, 0.01 and 0, the Blade 360 0.04, -0.04, 0.02 and 0
rollpitch_round = _built(
    "rollpitch_round",
    "as rollpitch_speeds, of a round rotor and equal servos, for short or gusty flights: what is "
    "odd is taken as 0 +- 0.05, 0.03 and 1 ms, but for odd_cross, which is free",
    "tau_f L_b M_a B_a B_lat B_lon tau_lat A_u A_v L_p M_q X_u Y_v L_v M_u "
    "odd_cross odd_gain odd_phase odd_delay",
    *rollpitch_speeds.parameters,
    Parameter("odd_cross", "1", 0.0, None, "A_b + B_a", 0.1),
    Parameter("odd_gain", "1", 0.0, None, "A_lon / B_lat - 1", 0.1, True, 0.05),
    Parameter("odd_phase", "1", 0.0, None, "(A_lat + B_lon) / B_lat", 0.1, True, 0.03),
    Parameter("odd_delay", "s", 0.0, None, "tau_lon - tau_lat", 0.01, True, 0.001),
    like=rollpitch_speeds,
    F={"a": {"b": "odd_cross - B_a"}},
    G={"a": {"lat": "odd_phase*B_lat - B_lon", "lon": "(1 + odd_gain)*B_lat"}},
    delays={"input_delays": {"lat": "tau_lat", "lon": "tau_lat + odd_delay"}},
)
# Mettler, Tischler and Kanade's hover model of the Yamaha R-50 (J. AHS 47, 2002), reduced
hover = _built(
    "hover",
    "rates and velocities over cyclic at hover: rigid body with speeds and attitudes, and "
    "first-order flapping",
    f"X_u X_a Y_v Y_b L_u L_v L_b M_u M_v M_a tau_f A_b B_a {_FLAPPING} tau_lat tau_lon",
    states="u v p q phi theta a b",
    inputs="lat lon",
    outputs="p q u v",
    M={"a": {"a": "tau_f"}, "b": {"b": "tau_f"}},
    F={
        "u": {"u": "X_u", "theta": "-g", "a": "X_a"},
        "v": {"v": "Y_v", "phi": "g", "b": "Y_b"},
        "p": {"u": "L_u", "v": "L_v", "b": "L_b"},
        "q": {"u": "M_u", "v": "M_v", "a": "M_a"},
        "phi": {"p": "1"},
        "theta": {"q": "1"},
        "a": {"q": "-tau_f", "a": "-1", "b": "A_b"},
        "b": {"p": "-tau_f", "a": "B_a", "b": "-1"},
    },
    G={"a": {"lat": "A_lat", "lon": "A_lon"}, "b": {"lat": "B_lat", "lon": "B_lon"}},
    delays=_CYCLIC,
)
hover_imu = _built(
    "hover_imu",
    "as hover, with accelerometers for velocities: ax = du/dt + g theta, ay = dv/dt - g phi",
    " ".join(hover.names),
    like=hover,
    outputs="p q ax ay",
    H0={"p": {"p": "1"}, "q": {"q": "1"}, "ax": {"theta": "g"}, "ay": {"phi": "-g"}},
    H1={"ax": {"u": "1"}, "ay": {"v": "1"}},
)
hover_inflow = with_inflow(hover, "hover_inflow")

BUILT_IN: dict[str, Structure] = {
    structure.name: structure
    for structure in (
        *(heave, heave_imu, heave_inflow, yaw_base, yaw_alone, yaw_sway, yaw_gyro, yaw_overall),
        *(rollpitch, rollpitch_tied, rollpitch_inflow, rollpitch_speeds, rollpitch_round),
        *(hover, hover_imu, hover_inflow),
    )
}


def named(name: str, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> Structure:
    """Return a built-in structure, or a transfer function such as "tf:1/2" of one input and output.

    Raises UnknownNameError, InputError.
    """
    if (match := _TRANSFER.match(name)) is None:
        return item_of(BUILT_IN, name, "structure")
    if len(inputs) != 1 or len(outputs) != 1:
        raise InputError(f"{name} needs one input and one output", remedy="inputs,outputs")
    return transfer_function(
        zeros=int(match[1]), poles=int(match[2]), input=inputs[0], output=outputs[0]
    )


class Rational(NamedTuple):
    """Orders of a transfer function, its delay, and its coefficients, numerator first, s^0 up."""

    zeros: int
    poles: int
    delay: str | None
    names: tuple[str, ...]


def rational_form(structure: Structure) -> Rational | None:
    """Return the form of what `transfer_function` made, else None."""
    if len(structure.inputs) != 1 or len(structure.outputs) != 1:
        return None
    delay = structure.input_delays.get(structure.inputs[0])
    if delay not in (None, *structure.names):  # an expression, such as that of a block in series
        return None
    poles = len(structure.states)
    zeros = len(structure.names) - poles - 1 - (delay is not None)
    if not 0 <= zeros <= poles:
        return None
    (input_,), (output,) = structure.inputs, structure.outputs
    made = transfer_function(zeros=zeros, poles=poles, input=input_, output=output, delay=delay)
    parts = ("names", *MATRICES, *DELAYS)
    if any(getattr(structure, part) != getattr(made, part) for part in parts):
        return None
    names = (*(f"b{k}" for k in range(zeros + 1)), *(f"a{k}" for k in range(poles)))
    return Rational(zeros, poles, delay, names)
