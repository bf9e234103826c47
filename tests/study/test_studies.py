"""The structure with inflow states of scripts/proof/inflow_study.py beside the linearisation."""

import numpy as np

import helisim as hs
from helisim.ident.evaluate import linear
from helisim.sim import Recorder
from script import loaded

INFLOW = loaded("proof/inflow_study")
STATES = ("p", "q", "flap_a", "flap_b", "inflow_s", "inflow_c")
SWASH = ("front", "left", "right")


def test_rollpitch_inflow_is_the_linearised_vehicle_state_by_state():
    vehicle = hs.load("jr700", parameters={"main_rotor.inflow": "pitt-peters"})
    true, structure = INFLOW.truth(vehicle, Recorder.of(vehicle)), hs.structures.rollpitch_inflow
    model = linear(structure, {name: true[name] for name in structure.names})
    system = vehicle.linearize("IN1").system
    names = list(system.state_labels)
    rows = [names.index(name) for name in STATES]
    own = vehicle.parameters
    tip = own["main_rotor.speed"] * own["main_rotor.radius"] * own["main_rotor.direction"]
    scale = np.diag([1.0, 1.0, 1.0, 1.0, -1.0 / tip, 1.0 / tip])  # the tilts that slopes ask for
    whole = np.asarray(system.A)
    found = scale @ whole[np.ix_(rows, rows)] @ np.linalg.inv(scale)
    # damping of the bare body, 0.03 1/s, has no place in it; and eq. (8) has springs that are not
    # the same all around, 0.0066 / tau_f = 0.24 1/s of 37
    np.testing.assert_allclose(model.a, found, atol=0.25)
    inflow_and_hub = np.ix_([0, 1, 4, 5], [2, 3, 4, 5])
    np.testing.assert_allclose(model.a[inflow_and_hub], found[inflow_and_hub], atol=0.05)
    positions = [names.index(f"{one}_position") for one in SWASH]
    speeds = [names.index(f"{one}_rate") for one in SWASH]
    inputs = [system.input_labels.index(name) for name in structure.inputs]
    mixed = np.asarray(system.B)[np.ix_(speeds, inputs)]
    stiff = -whole[speeds, positions][:, None]
    cyclic = scale @ whole[np.ix_(rows, positions)] @ (mixed / stiff)
    np.testing.assert_allclose(model.b, cyclic, atol=1e-3)
