"""The numbers of a Blade 360, a sub-scale flybarless helicopter, at hover.

J. Walker and M. Tischler, "Identification and Control Design of a Sub-Scale Flybarless
Helicopter", Vertical Flight Society 77th Annual Forum, 2021, as ArduPilot's simulator uses them
(libraries/SITL/SIM_Helicopter.cpp, frame blade360, read there number by number; the paper itself
was not seen, and with it not the Cramér-Rao bounds). SI, radians, forward-right-down.

Inputs are that simulator's: col is 0 at no thrust and 1 at the greatest collective, and hovers
where Z_col col = -g, at 0.44; the others are what multiplies the derivatives there. helisim's col
counts from the hover. The simulator delays all servos by 40 ms. Its file writes g a and g b for
the force of the tilted thrust, as helisim's does.

The structure is larger than helisim's three models. What the force laws say of the rest, and what
they cannot, stands in models/blade360/README.md.
"""

from helisim.base.units import RAD_S_PER_RPM
from helisim.study.paper.values import Published, ReferenceTable, ReferenceValue

_SOURCE = "Walker and Tischler (2021), see README.md"
_DELAY = "all servos' delay in ArduPilot's SIM_Helicopter.cpp"


def _values(**units: tuple[float, str]) -> tuple[ReferenceValue, ...]:
    return tuple(
        ReferenceValue(name, value, unit, source=_SOURCE) for name, (value, unit) in units.items()
    )


def _delay(name: str) -> ReferenceValue:
    return ReferenceValue(name, 0.040, "s", source=_DELAY)


AIRFRAME = ReferenceTable(
    "airframe",
    input="",
    cost=None,
    values=(
        ReferenceValue("Omega_mr", 2100.0 * RAD_S_PER_RPM, "rad/s", source=f"{_SOURCE}: 2100 rpm"),
    ),
)

YAW_BASE = ReferenceTable(
    "yaw_base",
    input="IN1",
    cost=None,
    values=(
        *_values(N_r=(-2.0131, "1/s"), N_ped=(63.0040, "rad/s^2")),
        _delay("tau_r_base"),
    ),
)
"""r/ped = N_ped exp(-tau_r_base s) / (s - N_r), as the JR700's eq. (1)."""

ROLLPITCH_IN1 = ReferenceTable(
    "rollpitch_in1",
    input="IN1",
    cost=None,
    values=(
        *_values(
            tau_f=(0.0353, "s"),
            L_b=(5115.2, "1/s^2"),
            M_a=(796.7, "1/s^2"),
            A_b=(-1.0057, "1"),
            B_a=(1.0477, "1"),
            A_lat=(0.0344, "rad"),
            A_lon=(0.2292, "rad"),
            B_lat=(0.2375, "rad"),
            B_lon=(-0.0286, "rad"),
        ),
        _delay("tau_lat"),
        _delay("tau_lon"),
    ),
)
"""The coupled roll-pitch model, in the JR700's names: M_f_b is A_b, L_f_a is B_a, and so on."""

HEAVE = ReferenceTable(
    "heave",
    input="IN1",
    cost=None,
    values=(*_values(Z_col=(-22.3239, "m/s^2"), Z_w=(-0.5910, "1/s")), _delay("tau_col")),
)
"""w/col = Z_col exp(-tau_col s) / (s - Z_w), as the JR700's eq. (10)."""

OTHERS = ReferenceTable(
    "others",
    input="IN1",
    cost=None,
    values=_values(
        X_u=(-0.2270, "1/s"),
        Y_v=(-0.1852, "1/s"),
        Y_p=(0.2303, "m/s"),
        L_u=(-28.7796, "rad/(s m)"),
        L_v=(-5.5376, "rad/(s m)"),
        M_u=(2.7501, "rad/(s m)"),
        M_v=(-2.3039, "rad/(s m)"),
        N_v=(1.7258, "rad/(s m)"),
        N_w=(5.7574, "rad/(s m)"),
        N_col=(-32.4616, "rad/s^2"),
    ),
)
"""Published too, but in none of the three models; nothing is solved for them."""

TABLES = {item.name: item for item in (AIRFRAME, YAW_BASE, ROLLPITCH_IN1, HEAVE, OTHERS)}

PUBLISHED = Published(TABLES, calibration=(YAW_BASE, ROLLPITCH_IN1, HEAVE), source=_SOURCE)


def table(name: str) -> ReferenceTable:
    """Return the published table of that name.

    Raises:
        UnknownNameError: no such table; the message lists those that exist.
    """
    return PUBLISHED.table(name)
