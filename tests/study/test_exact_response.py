"""The exact response that a figure's truth is drawn from."""

from dataclasses import replace

import numpy as np
import pytest

from helisim.ident.evaluate import response
from helisim.sim import Recorder
from helisim.study.models import YAW_BASE
from helisim.study.truth import exact_response, true_values

OMEGA = np.geomspace(0.6, 6.0, 30)


@pytest.fixture(scope="module")
def structured(jr700):
    """The paper's yaw model with the vehicle's own derivatives."""
    true = true_values(jr700, YAW_BASE, Recorder.of(jr700))
    values = {name: true[name] for name in YAW_BASE.structure.names}
    return response(YAW_BASE.structure, values, OMEGA)[0, 0]


def test_with_the_side_velocity_held_the_yaw_response_is_the_structures(jr700, structured):
    """As the estimate does, the truth holds v and col: what remains is N_ped / (s - N_r)."""
    exact = exact_response(jr700, YAW_BASE, Recorder.of(jr700), OMEGA).response[0, 0]
    ratio = exact / structured
    # The structure has the servo as a delay alone: (6 / 222)^2 of its amplitude, 0.006 dB, and
    # (6 / 222)^3 of a radian, 0.001 deg, are missing; speeds along the other axes do the rest.
    assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.01
    assert np.abs(np.rad2deg(np.angle(ratio))).max() < 0.05


def test_with_the_side_velocity_free_it_is_not(jr700, structured):
    """Sideslip turns the helicopter too: near the lateral mode the phase is far away."""
    free = replace(YAW_BASE, conditioning=(), reference=())
    exact = exact_response(jr700, free, Recorder.of(jr700), OMEGA).response[0, 0]
    assert np.rad2deg(np.angle(exact / structured))[0] > 10.0
