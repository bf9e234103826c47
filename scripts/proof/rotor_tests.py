"""The rotor's force laws beside measured rotors, and Prouty's worked one.

The main rotor's laws alone, with each rotor's own numbers: with the blades' polar, stall and
compressibility, and as they were without (one drag coefficient at any lift, Mach number and speed).

The measured numbers and their sources are in rotor_tests.toml. Of the wake: dynamic pressure below
a hovering rotor over the disc's load, wash at the tail, and what fin and tailplane have at 115 kn;
before, the load was uniform, the hover's wake had momentum theory's edge, 0.71 radii, and surfaces
the free stream's pressure.

    python scripts/proof/rotor_tests.py
"""

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import common
import numpy as np
from scipy.optimize import brentq, root

from helisim.base.files import read_toml
from helisim.physics.flapping import coning, flap_back
from helisim.physics.flow import fin, tailplane, wash_share
from helisim.physics.layout import PARAM
from helisim.physics.motion import Velocities
from helisim.physics.rotor import drag_rise, main_rotor, normal
from helisim.vehicle.assembly import downwash, loaded_downwash, wash_coefficients

PRINTED = read_toml(Path(__file__).with_suffix(".toml"))
TABLES, WAKE = PRINTED["table"], PRINTED["wake"]
DENSITY, SPEED = 1.225, 100.0  # of no matter: all is over them, and the radius is 1 m
RISE = {"model": 1.25 / 5.75**2, "full": 0.4 / 5.73**2}
"""Of c_d by c_l^2: Knight and Hefner's, Bailey's."""


@dataclass(frozen=True)
class Rotor:
    solidity: float
    lift_slope: float
    profile_drag: float
    lift_drag: float
    induced_factor: float = 1.15
    twist: float = 0.0
    mach: float = 0.0
    stall_fall: float = 1.8
    divergence: float = 0.725
    stall: float = 0.18
    direction: float = 1.0
    radius: float = 1.0
    speed: float = SPEED
    pitch_range: float = 1.0

    def before(self, mean_drag: float | None = None) -> "Rotor":
        """Return it with one drag coefficient, one stall limit and incompressible air."""
        drag = mean_drag or self.profile_drag
        return replace(self, profile_drag=drag, lift_drag=0.0, mach=0.0, stall_fall=0.0)

    def at(self, pitch: float, ahead: float = 0.0, down: float = 0.0, back: float = 0.0) -> Any:
        """Return `MainRotor`, CT, CQ and force, (3,), over rho A (Omega R)^2; back: tilt, rad."""
        par = np.zeros(len(PARAM))
        par[[PARAM.air_density, PARAM.flap_stop]] = DENSITY, 10.0
        for name, value in asdict(self).items():
            par[getattr(PARAM, f"main_{name}")] = value
        motion = Velocities(ahead * SPEED, 0.0, down * SPEED, 0.0, 0.0, 0.0)
        tips = (back, 0.0)
        main = main_rotor(par, motion, 1.0, pitch, tips, (0.0, 0.0))
        unit = DENSITY * math.pi * SPEED**2
        force = main.thrust * np.array(normal(par, tips)) + [main.drag_x, main.drag_y, 0.0]
        return main, main.thrust / unit, main.torque / unit, force / unit

    def torque(self, thrust: float, down: float = 0.0) -> float:
        pitch = brentq(lambda one: self.at(one, 0.0, down)[1] - thrust, -0.3, 0.5)
        return self.at(pitch, 0.0, down)[2]

    def flapped(self, pitch: float, ahead: float, down: float) -> tuple[Any, float]:
        back = 0.0
        for _ in range(30):
            found = self.at(pitch, ahead, down, back)
            back = ahead * flap_back(pitch, found[0].inflow, ahead)
        return found, back


class Row(NamedTuple):
    source: str
    what: str
    printed: float
    found: float
    before: float

    @property
    def off(self) -> float:
        return self.found / self.printed - 1.0


STILL = 0.05 * 0.0106 / 8.0  # CQ at no thrust of Castles and Gray's rotor


def autorotation(rotor: Rotor, thrust: float) -> float:
    hover = math.sqrt(0.5 * thrust)
    return brentq(lambda down: rotor.torque(thrust, down) - STILL, 1.6 * hover, 2.5 * hover)


@cache
def glide(rotor: Rotor, advance: float) -> tuple[float, float]:
    pitch = math.radians(2.7)
    down = brentq(lambda one: rotor.flapped(pitch, advance, one)[0][2], -0.01, 0.2)
    force, along = rotor.flapped(pitch, advance, down)[0][3], np.array([advance, 0.0, down])
    drag = float(-force @ along / np.linalg.norm(along))
    lift = math.sqrt(force @ force - drag**2)
    return 2.0 * lift / float(along @ along), lift / drag


FIGURES = {
    "CT": lambda rotor, degrees, *_: rotor.at(math.radians(degrees))[1],
    "CQ at CT": lambda rotor, _, thrust, *__: rotor.torque(thrust),
    "CQ": lambda rotor, thrust, _: rotor.torque(thrust),
    "descent in autorotation": lambda rotor, thrust, _: autorotation(rotor, thrust),
    "figure of merit": lambda r, thrust, _: thrust**1.5 / math.sqrt(2.0) / r.torque(thrust),
    "CL": lambda rotor, advance, *_: glide(rotor, advance)[0],
    "L/D": lambda rotor, advance, *_: glide(rotor, advance)[1],
}
"""Column of a table -> what the model says, by a rotor and a row's numbers."""


def measured() -> Iterator[Row]:
    for table in TABLES:
        given = dict(table["rotor"])
        mean_drag, rise = given.pop("mean_drag", None), RISE[given.pop("rise")]
        rotor = Rotor(**given, lift_drag=rise)
        for numbers in table["rows"]:
            for name, printed in zip(table["columns"], numbers[1:]):
                found = (FIGURES[name](one, *numbers) for one in (rotor, rotor.before(mean_drag)))
                above = STILL if name == "CQ" else 0.0
                what = table["what"].format(numbers[0]) + name
                yield Row(table["source"], what, printed + above, *found)


POUND, FOOT, HORSEPOWER = 4.4482216, 0.3048, 745.69987
TIP, RADIUS, ADVANCE, LEAN = 650.0 * FOOT, 30.0 * FOOT, 0.30, math.radians(3.7)
FORCE = DENSITY * math.pi * RADIUS**2 * TIP**2
POWER = FORCE * TIP / HORSEPOWER


def cruise(rotor: Rotor) -> dict[str, float]:
    thrust, climb = 20790.0 * POUND / FORCE, ADVANCE * math.tan(LEAN)

    def miss(unknown: Any) -> list[float]:
        (main, found, *_), _ = rotor.flapped(unknown[0], ADVANCE, unknown[1])
        return [1e3 * (found - thrust), 1e2 * (main.climb - climb)]

    pitch, down = root(miss, [0.15, -0.05]).x
    (main, _, torque, _), back = rotor.flapped(pitch, ADVANCE, down)
    return {
        "main rotor, hp": POWER * torque,
        "root collective, deg": math.degrees(pitch - 0.75 * rotor.twist),
        "B1 + a1s, deg": math.degrees(back),
        "coning, deg": math.degrees(coning(pitch, rotor.twist, main.inflow, ADVANCE, 8.1, 0.0)),
    }


def prouty() -> Iterator[Row]:
    # c_d of NACA 0012 at 0 and 6 degrees (his p. 433), kappa of blades with such a twist
    twist, mach = math.radians(-10.0), 650.0 / 1116.4
    rotor = Rotor(0.084883, 6.0, 0.0081, 0.0058, 1.1, twist, mach)
    plain = rotor.before(0.010)
    hover = [POWER * one.torque(0.00719) for one in (rotor, plain)]
    yield Row("Prouty", "hover, CT 0.00719: main rotor, hp", 1995.0, *hover)
    found, before = cruise(rotor), cruise(plain)
    for what, printed in zip(found, (1097.0, 15.8, 4.9, 4.3)):
        yield Row("Prouty", f"115.5 kn: {what}", printed, found[what], before[what])
    # figure 3.43 as he reads it (table 3.5, case 2): 750 ft/s, mu = 0.3, CT / sigma = 0.086
    mach *= 750.0 / 650.0
    torque, _ = drag_rise(mach, 0.725 * (1.0 - 6.0 * 0.086**2), 0.3)
    yield Row("Prouty", "750 ft/s, mu 0.3: rise of CQ/sigma", 0.0043 * mach**3, torque / 8.0, 0.0)


def wake() -> Iterator[Row]:
    for at, printed in WAKE["below"]:
        found = 0.25 * float(loaded_downwash(at, 0.3, 0.0, radius=0.85, core=0.05)) ** 2
        before = 0.25 * float(downwash(at, 0.3, 0.0, radius=math.sqrt(0.5), core=0.05)) ** 2
        yield Row("Boatwright", f"0.3 R below, {at} R: q / load", printed, found, before)
    ratio, speed = WAKE["induced"], math.sqrt(2.0 * WAKE["pressure"] / WAKE["density"])
    skew = math.atan2(1.0, math.tan(LEAN) + ratio)
    numbers = np.array(wash_coefficients(*WAKE["place"]))
    share = wash_share(numbers, 0, math.cos(skew), math.sin(skew) ** 2)
    even = float(downwash(*WAKE["place"], skew, core=0.05))
    yield Row("Heyson and Katzoff", "1.08 R behind: wash over v", 1.5, share, even)
    par = np.zeros(len(PARAM))
    par[PARAM.air_density] = WAKE["density"]
    for name, value in WAKE["par"].items():
        par[getattr(PARAM, name)] = value
    level = Velocities(speed, 0.0, speed * WAKE["pitch"], 0.0, 0.0, 0.0)
    aside = Velocities(speed, 0.01 * speed, 0.0, 0.0, 0.0, 0.0)
    forces = []
    for par[PARAM.fin_pressure] in (0.6, 1.0):
        par[PARAM.tailplane_pressure] = par[PARAM.fin_pressure]
        lift = -tailplane(par, level, share * ratio * speed).fz
        forces.append((lift, 100.0 * fin(par, aside, 0.0).fy))
    lifts, slopes = zip(*forces)
    yield Row("Prouty, ch. 8", "115 kn: tailplane's lift, lb", -273.0, *lifts)
    yield Row("Prouty, ch. 8", "115 kn: fin, lb by rad of sideslip", -2833.0, *slopes)


def rows() -> tuple[Row, ...]:
    return (*measured(), *prouty(), *wake())


def main() -> None:
    common.table(
        "source:<19|figure:<38|printed:10.4g|model:10.4g|off, %:8.1f|before:10.4g|off, %:8.1f",
        (
            (*row[:4], 100.0 * row.off, row.before, 100.0 * row.before / row.printed - 100.0)
            for row in rows()
        ),
    )


if __name__ == "__main__":
    common.run(main)
