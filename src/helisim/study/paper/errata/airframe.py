"""What is wrong in Table 1, and what the tables say of units."""

import math
from typing import Any

from helisim.base.units import RAD_S_PER_RPM
from helisim.physics import rotor
from helisim.study.paper import jr700
from helisim.study.paper.errata.erratum import Row, of
from helisim.vehicle.folder import model_folder
from helisim.vehicle.parameters import read_parameters


def _tail_speed() -> dict[str, Any]:
    folder = model_folder("jr700")
    par = read_parameters(folder / "parameters.toml", folder / "calibrated.toml")
    printed, main, fast, radius, density = of(
        jr700.AIRFRAME, "Omega_tr_as_printed", "Omega_mr", "Omega_tr", "R_tr", "rho"
    )
    slow, main = printed * RAD_S_PER_RPM, main / RAD_S_PER_RPM

    def thrust(speed: float, pedal: float) -> float:
        area = math.pi * radius**2
        solidity = par["tail_rotor.blades"] * par["tail_rotor.chord"] / (math.pi * radius)
        pitch = par["tail_rotor.pitch_trim"] + pedal * par["tail_rotor.pitch_range"]
        law = (par[f"tail_rotor.{name}"] for name in ("lift_slope", "stall"))
        _, ct = rotor.inflow_and_thrust(pitch, 0.0, 0.0, solidity, *law)
        return density * area * (speed * radius) ** 2 * ct

    idle, weak, needed = thrust(slow, 0.0), thrust(slow, 0.5), thrust(fast, 0.0)
    tip, ratio, geared = slow * radius, main / printed, fast / RAD_S_PER_RPM
    confirmed = weak < needed
    return locals()


def _fuselage() -> dict[str, Any]:
    printed, length, radius = of(jr700.AIRFRAME, "l_f_as_printed", "l_f", "R_mr")
    diameters, share = printed / (2.0 * radius), length / (2.0 * radius)
    confirmed = diameters > 10.0
    return locals()


def _units() -> dict[str, Any]:
    tables = (jr700.YAW_BASE, jr700.YAW_GYRO, jr700.ROLLPITCH_IN1, jr700.HEAVE)
    units = [value.unit for table in tables for value in table]
    values, count, kinds = len(units), len(set(units)), ", ".join(sorted(set(units)))
    confirmed = count > 1
    return locals()


ROWS = (
    Row(
        title="Tail rotor speed is the gear ratio upside down",
        where="Table 1",
        printed="tail rotor rotation speed {printed:g} rpm",
        calculation="{printed:g} rpm x {radius:g} m = {tip:.1f} m/s at the tip; "
        "{main:g} rpm / {printed:g} rpm = {ratio:.3f}",
        computed="{idle:.2f} N with the pedals centred and {weak:.2f} N at full pedal, where the "
        "hover needs {needed:.2f} N; {main:g} rpm x {ratio:.3f} = {geared:.0f} rpm gives them",
        conclusion="A tail rotor turns faster than the main rotor: the speed was divided by the "
        "gear ratio instead of multiplied. helisim uses the product.",
        figures=_tail_speed,
    ),
    Row(
        title="Fuselage longer than a kilometre",
        where="Table 1",
        printed="l_f = {printed:g}m",
        calculation="{printed:g} m / (2 x {radius:g} m) = {diameters:.0f}",
        computed="{diameters:.0f} rotor diameters; {length:g} m is {share:.2f}",
        conclusion="The unit is mm, or the decimal point is missing.",
        figures=_fuselage,
    ),
    Row(
        title="No parameter has a unit",
        where="Tables 2 to 4",
        printed="values alone",
        calculation="{values} parameters of N_r to Z_w have, by eqs. (1) to (10), {count} "
        "different units",
        computed="{kinds}",
        conclusion="They follow from the equations if angles are in radians and inputs unitised, "
        "and helisim's force laws then meet all of them.",
        figures=_units,
    ),
)
