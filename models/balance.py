"""Close a vehicle's balance of mass: what its fuselage must be for the totals to be exact.

Used by the `build.py` of each vehicle.
"""

import re
import sys
from pathlib import Path

import mujoco
import numpy as np

from helisim.vehicle import read_parameters
from helisim.vehicle.assembly import wanted_inertia
from helisim.vehicle.build import write_numbers
from helisim.vehicle.parameters import completed


class Balance:
    """The parts of one vehicle and their totals. SI, in the vehicle's axes.

    Args:
        folder: of the vehicle, whose MJCF and parameters bear its name.
        total_mass_kg: that the parts must add up to.
    """

    def __init__(self, folder: Path, *, total_mass_kg: float) -> None:
        self.folder = folder
        self.mjcf = folder / f"{folder.name}.xml"
        self.total_mass_kg = total_mass_kg

    def wanted_inertia(self):
        """The vehicle's chosen and solved moments of inertia about its centre of gravity."""
        files = (self.folder / name for name in ("parameters.toml", "calibrated.toml"))
        return wanted_inertia(completed(read_parameters(*files)))

    def parts(self):
        """Each massive body's mass, centre and inertia about its own centre."""
        model = mujoco.MjModel.from_xml_path(str(self.mjcf))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        origin = data.body(self.folder.name).xpos
        rows = {}
        for i in range(model.nbody):
            if model.body_mass[i] > 0:
                turn = data.ximat[i].reshape(3, 3)
                inertia = turn @ np.diag(model.body_inertia[i]) @ turn.T
                rows[model.body(i).name] = (model.body_mass[i], data.xipos[i] - origin, inertia)
        return rows

    def closing_fuselage(self):
        """The fuselage's mass, centre and inertia that make the totals exact."""
        mass, centre, inertia = total(
            row for name, row in self.parts().items() if name != "fuselage"
        )
        own_mass = self.total_mass_kg - mass
        own_centre = -mass * centre / own_mass
        return (
            own_mass,
            own_centre,
            self.wanted_inertia() - inertia - steiner(own_mass, own_centre),
        )

    def close(self):
        """Rewrite the first inertial element inside the body named fuselage, with all digits."""
        element = inertial_element(*self.closing_fuselage())
        before, found, after = self.mjcf.read_text().partition('<body name="fuselage">')
        if not found:
            sys.exit(f"{self.mjcf}: no body named fuselage")
        self.mjcf.write_text(before + found + re.sub(r"<inertial .*?/>", element, after, count=1))
        write_numbers(self.folder)
        print(element)

    def print_parts(self):
        """Print the table of the README."""
        rows = self.parts()

        def show(name, mass, centre, inertia):
            # Rounded first, so that no cell reads -0.000.
            print(
                f"{name:<16}{mass:7.3f}"
                + "".join(f"{x:8.3f}" for x in np.round(centre, 3) + 0.0)
                + "".join(f"{x:10.5f}" for x in np.diag(inertia))
            )

        columns = {"x": 8, "y": 8, "z": 8, "Ixx": 10, "Iyy": 10, "Izz": 10}
        print(f"{'part':<16}{'mass':>7}" + "".join(f"{c:>{w}}" for c, w in columns.items()))
        print(f"{'':<16}{'kg':>7}" + 3 * f"{'m':>8}" + 3 * f"{'kg m2':>10}")
        rule = "-" * (23 + sum(columns.values()))
        print(rule)
        for name, row in rows.items():
            show(name, *row)
        print(rule)
        _, centre, inertia = whole = total(rows.values())
        show("total", *whole)
        wanted = self.wanted_inertia()
        products = np.abs((inertia - wanted)[~np.eye(3, dtype=bool)]).max()
        print(
            (f"product of inertia {wanted[0, 2]:g} kg m2, other " if wanted[0, 2] else "")
            + f"products of inertia below {max(products, 1e-12):.0e} kg m2, "
            f"centre within {max(np.linalg.norm(centre), 1e-12):.0e} m of the origin"
        )
        mass, _, own = rows["fuselage"]
        print(
            f"fuselage: radii of gyration {np.sqrt(np.diag(own) / mass).round(3)} m, "
            f"principal moments {np.linalg.eigvalsh(own).round(4)} kg m2"
        )


def total(rows):
    """Mass, centre of gravity, and inertia about the vehicle frame's origin."""
    rows = list(rows)
    mass = sum(m for m, _, _ in rows)
    centre = sum(m * r for m, r, _ in rows) / mass
    inertia = sum(j + steiner(m, r) for m, r, j in rows)
    return mass, centre, inertia


def steiner(mass, r):
    """Inertia of a point mass at r about the origin."""
    return mass * (r @ r * np.eye(3) - np.outer(r, r))


def inertial_element(mass, centre, inertia):
    """One line of MJCF."""

    def text(values):
        return " ".join(f"{v:.12g}" for v in np.where(np.abs(values) < 1e-15, 0.0, values))

    six = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial pos="{text(centre)}" mass="{mass:.12g}" fullinertia="{text(six)}"/>'
