"""A slung load's pendulum: in closed form, linearised, and found from records of sweeps alone.

From attitude to load, whatever gyro and pilot do, the vehicle M is a free mass, and for a load m

    omega^2 = g / l (1 + k m / M),  k = 1 + T a / (K + T h)

with its centre l below a hook that is a below the centre of gravity: the disc, of stiffness K and
thrust T at h above, leans against the load's moment and pulls along.

    python scripts/proof/slung_load.py [MASS LENGTH ARM]
"""

import sys

import numpy as np
from scipy.linalg import eigvals

import helisim as hs

AXES = {"lat": ("phi", "load_y"), "lon": ("theta", "load_x")}
LOAD = """<mujoco> <worldbody> <site name="hook" pos="0 0 -{arm}"/>
  <body name="load" pos="0 0 -{arm}"> <joint name="swing" type="ball" damping="0.6"/>
    <geom size="0.08" pos="0 0 -{length}" mass="{mass}"/> </body> </worldbody> </mujoco>"""


def closed_form(bare: hs.Vehicle, mass: float, length: float, arm: float) -> float:
    """Return the frequency, rad/s, of a load (kg, m, m); its own inertia adds to m l^2."""
    own, gravity = bare.parameters, abs(float(bare.model.opt.gravity[2]))
    vehicle = float(bare.model.body_mass.sum())
    thrust = (vehicle + mass) * gravity
    hub = own["main_rotor.hub_stiffness"] - thrust * own["main_rotor.hub_z"]
    share = vehicle / (vehicle + mass * (1.0 + thrust * arm / hub))
    return float(np.sqrt(gravity * length / (0.4 * 0.08**2 + length**2 * share)))


def exact(loaded: hs.Vehicle) -> list[float]:
    """Return the frequencies, rad/s, of the linearisation whose attitude and heave are held."""
    linear = loaded.linearize().select(outputs=("phi", "theta", "psi", "w"))
    whole = np.block([[linear.a, linear.b], [linear.c, linear.d]])
    free = np.diag(np.arange(len(whole)) < len(linear.a))
    roots = eigvals(whole, free.astype(float))
    return sorted(abs(complex(one)) for one in roots if one.imag > 0.3 and abs(complex(one)) < 10.0)


def identified(loaded: hs.Vehicle, axis: str, seed: int = 1) -> hs.Mode:
    """Return the pole pair from attitude to load in the record of one sweep."""
    inputs, outputs = AXES[axis]
    sweep = hs.Sweep(axis=axis, duration=120.0, band=(0.5, 8.0), amplitude=0.005)
    flown, band = hs.fly(loaded, sweep, seed=seed), (0.7, 6.0)
    response = hs.frequency_response(flown, inputs=inputs, outputs=outputs, band=band)
    pair = hs.structures.transfer_function(zeros=2, poles=2, input=inputs, output=outputs)
    return hs.identify(response, pair).modes.poles[0]


if __name__ == "__main__":
    given = dict(zip(("mass", "length", "arm"), map(float, sys.argv[1:] or (1.0, 3.0, 0.15))))
    wanted, vehicle = closed_form(hs.load(), **given), hs.load(slung=LOAD.format(**given))
    print(f"closed form {wanted:.4f} rad/s, linearised {np.round(exact(vehicle), 4)}")
    for name in AXES:
        print(f"record of a {name} sweep: {identified(vehicle, name).frequency:.4f} rad/s")
