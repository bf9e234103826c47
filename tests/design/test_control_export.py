"""Plants, laws and loops as python-control's objects, put together by python-control itself."""

import control
import numpy as np
import pytest

import helisim as hs
from exact_fits import found as fitted
from helisim import ident
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import NoResponse

OMEGA = np.geomspace(0.5, 100.0, 30)


@pytest.fixture(scope="module")
def loop():
    """Yaw and heave with a law of random matrices that sees and moves both."""
    yaw = fitted(ident.structures.yaw_base, N_r=-0.8, N_ped=48.0, tau_r_base=0.014)
    heave = fitted(ident.structures.heave, Z_w=-0.9, Z_col=-40.0, tau_col=0.0107)
    plant = hs.Plant((yaw, heave), latency=0.004)
    rng = np.random.default_rng(1)
    shapes = {"b": (3, 4), "c": (4, 3), "d": (4, 4)}
    law = hs.StateSpaceLaw(
        period=0.002,
        inputs=("r", "az", "PED", "COL"),
        a=np.diag([0.9, 0.5, 0.99]),
        **{name: 0.02 * rng.standard_normal(shape) for name, shape in shapes.items()},
    )
    return ClosedLoop(plant, law.linear(0.002), OMEGA)


@pytest.mark.filterwarnings("ignore:Unused output")
def test_closed_loop_is_what_python_control_connects(loop):
    """`interconnect` of the two exported systems by their names: poles and responses."""
    plant, law = loop.plant.sampled.system, loop.law.sampled.system
    system = loop.system()
    own = control.interconnect(
        [plant, law], inputs=["PED", "COL"], outputs=["r", "az", "psi", "ped"]
    )
    assert np.poly(system.A) == pytest.approx(np.poly(own.A), abs=1e-9)
    for z in np.exp(1j * OMEGA * 0.002):
        found = system(z)[[system.output_labels.index(name) for name in own.output_labels]]
        # each a sum of hundreds of terms
        assert found == pytest.approx(own(z), rel=1e-8, abs=1e-12)


def test_closed_and_cut_loops_have_the_responses_of_the_frame(loop):
    """`command` and `broken`, found frequency by frequency from the models' own responses."""
    points = np.exp(1j * OMEGA * 0.002)
    system, cut = loop.system(), loop.system(cut="yaw")
    row, column = system.output_labels.index("psi"), system.input_labels.index("PED")
    closed = np.array([system(z)[row, column] for z in points])
    row, column = cut.output_labels.index("ped"), cut.input_labels.index("ped")
    broken = -np.array([cut(z)[row, column] for z in points])
    for found, wanted in ((closed, loop.command("ped")), (broken, loop.broken("ped"))):
        # az answers as fast at any frequency, so the ticks fold its fast part onto the slow: 3e-3
        off = np.abs(found - wanted.response) / np.abs(wanted.response).max()
        assert np.all(off < 5e-3)


def test_a_loop_of_responses_alone_is_none_for_python_control(loop):
    class Alone:
        inputs, outputs, response = loop.plant.inputs, loop.plant.outputs, loop.plant.response

    with pytest.raises(NoResponse, match="known by its responses alone"):
        ClosedLoop(Alone(), loop.law).system()
    with pytest.raises(NoResponse, match="no command 'lat'"):
        loop.system(cut="lat")
