"""Closed loops at their ticks: closed forms, python-control, and what is not known."""

from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest

import helisim as hs
from exact_fits import found as fitted
from helisim import ident
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.linear import LinearSystem
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import NoResponse

PERIOD, GAIN = 0.01, 20.0


INTEGRAL = LinearSystem([[1.0]], [[PERIOD]], [[1.0]], [[0.0]], PERIOD, ("lat",), ("phi",))
NONE = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0))
HOLD = LinearSystem(*NONE, [[-GAIN, GAIN]], PERIOD, ("phi", "LAT"), ("lat",))
"""It commands a rate of GAIN times what is left to the stick."""


def test_an_integral_that_is_held_goes_as_a_power():
    """Each tick leaves 1 - k T of what was left: y = 1 - (1 - k T)^n, one pole."""
    loop = ClosedLoop(INTEGRAL, HOLD)
    np.testing.assert_allclose(loop.poles, [np.log(1.0 - GAIN * PERIOD) / PERIOD], rtol=1e-12)
    history = loop.step("roll", size=0.3, duration=0.5)
    left = (1.0 - GAIN * PERIOD) ** np.arange(51)
    np.testing.assert_allclose(history.time, np.arange(51) * PERIOD)
    np.testing.assert_allclose(history.signals["phi"], 0.3 * (1.0 - left), atol=1e-14)
    np.testing.assert_allclose(history.signals["lat"], 0.3 * GAIN * left, atol=1e-13)
    assert set(history.signals) == {"LAT", "lat", "phi"}


def test_every_response_of_a_rate_that_is_commanded_is_its_closed_form():
    """Of phi = P u and p = u, P = T / (z - 1), behind u = K (s - phi) - R p: L = K P + R."""
    rate, rows = 0.3, ([[1.0], [0.0]], [[0.0], [1.0]])
    rated = LinearSystem([[1.0]], [[PERIOD]], *rows, PERIOD, ("lat",), ("phi", "p"))
    none = np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((1, 0))
    law = LinearSystem(*none, [[-GAIN, -rate, GAIN]], PERIOD, ("phi", "p", "LAT"), ("lat",))
    loop = ClosedLoop(rated, law)
    plant = PERIOD / (np.exp(1j * loop.frequency * PERIOD) - 1.0)
    open_ = GAIN * plant + rate
    to = {"lat": 1.0 / (1.0 + open_), "phi": plant / (1.0 + open_), "p": 1.0 / (1.0 + open_)}
    back = GAIN + 1j * loop.frequency * rate  # of an angle that is added, its derivative on p
    for found, wanted in (
        (loop.broken("lat"), open_),
        (loop.broken("lat", "sensors"), 1.0 / (1.0 - back * to["phi"]) - 1.0),
        (loop.disturbance("lat"), 1.0 - back * to["phi"]),
        (loop.command("lat"), GAIN * to["phi"]),
        (loop.command("lat", "p"), GAIN * to["p"]),
        (loop.turned("lat", "lat"), to["phi"]),
        (loop.actuator("lat"), GAIN * to["lat"]),
        (loop.actuator("lat", "disturbance"), -back * to["lat"]),
        *((one, to[name]) for name, one in loop.reached("actuators", "lat").items()),
        *((one, -back * to[name]) for name, one in loop.reached("sensors", "lat").items()),
    ):
        np.testing.assert_allclose(found.response, wanted, rtol=1e-9)
    assert set(loop.reached("sticks", "lat")) == {"lat", "phi", "p"}


def test_a_stick_that_is_seen_late_moves_all_that_much_later():
    """By 2.5 ticks, seen at the third; its response by 25 ms, whatever a tick is."""
    late = SimpleNamespace(
        inputs=INTEGRAL.inputs,
        outputs=INTEGRAL.outputs,
        response=INTEGRAL.response,
        sampled=INTEGRAL,
        stick_latency={"LAT": 2.5 * PERIOD},
    )
    loop, soon = ClosedLoop(late, HOLD), ClosedLoop(INTEGRAL, HOLD)
    then, now = (one.step("lat", size=1.0, duration=0.2).signals["phi"] for one in (loop, soon))
    np.testing.assert_allclose(then[3:], now[:-3], atol=1e-15)
    assert not then[:3].any()
    ratio = loop.command("lat").response / soon.command("lat").response
    np.testing.assert_allclose(ratio, np.exp(-0.025j * loop.frequency), rtol=1e-12)
    np.testing.assert_allclose(loop.broken("lat").response, soon.broken("lat").response)


def test_responses_alone_have_no_poles():
    def seen(inputs, outputs):
        def response(frequency):
            return np.ones((1, 1, frequency.size), dtype=complex)

        return SimpleNamespace(inputs=inputs, outputs=outputs, response=response)

    with pytest.raises(NoResponse, match="the plant is known by its responses alone"):
        _ = ClosedLoop(seen(("lat",), ("phi",)), HOLD).poles
    with pytest.raises(NoResponse, match="the law is known by its responses alone"):
        ClosedLoop(INTEGRAL, seen(("phi",), ("lat",))).step("lat", size=1.0, duration=1.0)


def test_other_ticks_and_an_unknown_stick_are_refused():
    slow = replace(HOLD, period=0.02)
    with pytest.raises(InputError, match=r"each 0\.01 s, the law each 0\.02 s"):
        _ = ClosedLoop(INTEGRAL, slow).poles
    with pytest.raises(NoResponse, match="the law has no stick 'PED': it has phi, LAT"):
        ClosedLoop(INTEGRAL, HOLD).step("yaw", size=1.0, duration=1.0)


@pytest.mark.parametrize("ask", [ClosedLoop.broken, lambda loop, *one: loop.reached(*one[::-1])])
def test_an_unknown_place_is_refused(ask):
    with pytest.raises(UnknownNameError, match="'sensor'; available: actuators, sensors"):
        ask(ClosedLoop(INTEGRAL, HOLD), "lat", "sensor")


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


def test_a_cut_loop_has_the_response_of_the_frame(loop):
    """As `broken`, found frequency by frequency from the models' own responses."""
    cut, wanted = loop.system(cut="yaw"), loop.broken("ped").response
    row, column = cut.output_labels.index("ped"), cut.input_labels.index("ped")
    broken = -np.array([cut(z)[row, column] for z in np.exp(1j * OMEGA * 0.002)])
    # az answers as fast at any frequency, so the ticks fold its fast part onto the slow: 3e-3
    assert np.all(np.abs(broken - wanted) < 5e-3 * np.abs(wanted).max())
    with pytest.raises(NoResponse, match="no command 'lat'"):
        loop.system(cut="lat")
