"""What is wrong in Table 1, and what the tables say of units."""

import math

from helisim.paper import jr700
from helisim.paper.errata.erratum import Erratum, of
from helisim.physics import rotor
from helisim.units import RAD_S_PER_RPM
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.parameters import read_parameters


def tail_speed() -> Erratum:
    """Return the erratum of Table 1's tail rotor speed."""
    air = jr700.AIRFRAME
    folder = model_folder("jr700")
    par = read_parameters(folder / "parameters.toml", folder / "calibrated.toml")
    printed, main = of(air, "Omega_tr_as_printed"), of(air, "Omega_mr") / RAD_S_PER_RPM
    slow, fast = printed * RAD_S_PER_RPM, of(air, "Omega_tr")
    radius = of(air, "R_tr")

    def thrust(speed: float, pedal: float) -> float:
        area = math.pi * radius**2
        solidity = par["tail_rotor.blades"] * par["tail_rotor.chord"] / (math.pi * radius)
        _, ct = rotor.inflow_and_thrust(
            par["tail_rotor.pitch_trim"] + pedal * par["tail_rotor.pitch_range"],
            0.0,
            0.0,
            solidity,
            par["tail_rotor.lift_slope"],
            par["tail_rotor.stall"],
            par["tail_rotor.inflow_floor"],
        )
        return of(air, "rho") * area * (speed * radius) ** 2 * ct

    idle, weak, needed = thrust(slow, 0.0), thrust(slow, 0.5), thrust(fast, 0.0)
    return Erratum(
        title="Tail rotor speed is the gear ratio upside down",
        where="Table 1",
        printed=f"tail rotor rotation speed {printed:g} rpm",
        calculation=(
            f"{printed:g} rpm x {radius:g} m = {slow * radius:.1f} m/s at the tip; "
            f"{main:g} rpm / {printed:g} rpm = {main / printed:.3f}"
        ),
        computed=(
            f"{idle:.2f} N with the pedals centred and {weak:.2f} N at full pedal, where the "
            f"hover needs {needed:.2f} N; {main:g} rpm x {main / printed:.3f} = "
            f"{fast / RAD_S_PER_RPM:.0f} rpm gives them"
        ),
        conclusion=(
            "A tail rotor turns faster than the main rotor: the speed was divided by the gear "
            "ratio instead of multiplied. helisim uses the product."
        ),
        confirmed=weak < needed,
    )


def fuselage_length() -> Erratum:
    """Return the erratum of Table 1's length of the fuselage."""
    printed, length = of(jr700.AIRFRAME, "l_f_as_printed"), of(jr700.AIRFRAME, "l_f")
    diameter = 2.0 * of(jr700.AIRFRAME, "R_mr")
    return Erratum(
        title="Fuselage longer than a kilometre",
        where="Table 1",
        printed=f"l_f = {printed:g}m",
        calculation=f"{printed:g} m / (2 x {0.5 * diameter:g} m) = {printed / diameter:.0f}",
        computed=(
            f"{printed / diameter:.0f} rotor diameters; {length:g} m is {length / diameter:.2f}"
        ),
        conclusion="The unit is mm, or the decimal point is missing.",
        confirmed=printed > 10.0 * diameter,
    )


def no_units() -> Erratum:
    """Return the erratum of the missing units of Tables 2 to 4."""
    tables = (jr700.YAW_BASE, jr700.YAW_GYRO, jr700.ROLLPITCH_IN1, jr700.HEAVE)
    values = [value for table in tables for value in table]
    kinds = sorted({value.unit for value in values})
    return Erratum(
        title="No parameter has a unit",
        where="Tables 2 to 4",
        printed="values alone",
        calculation=(
            f"{len(values)} parameters of N_r to Z_w have, by eqs. (1) to (10), "
            f"{len(kinds)} different units"
        ),
        computed=", ".join(kinds),
        conclusion=(
            "They follow from the equations if angles are in radians and inputs unitised, and "
            "helisim's force laws then meet all of them."
        ),
        confirmed=len(kinds) > 1,
    )
