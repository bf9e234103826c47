"""Poles and steps of a sampled loop, against closed forms and the vehicle's own closing."""

from dataclasses import dataclass

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem, zero_order_hold
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import NoResponse
from helisim.vehicle.linearize import OUTPUTS
from helisim.vehicle.sampled import close

PERIOD, GAIN = 0.01, 20.0


@dataclass(frozen=True)
class Within:
    """A system that has its matrices as another."""

    sampled: LinearSystem


def numbers(*rows):
    return np.array(rows, dtype=float)


def ticked(a, b, c, d, inputs, outputs, period=PERIOD):
    return LinearSystem(a, b, c, d, period, inputs, outputs)


INTEGRAL = ticked(
    numbers([1.0]), numbers([PERIOD]), numbers([1.0]), numbers([0.0]), ("lat",), ("phi",)
)
HOLD = ticked(
    np.zeros((0, 0)),
    np.zeros((0, 2)),
    np.zeros((1, 0)),
    numbers([-GAIN, GAIN]),
    ("phi", "LAT"),
    ("lat",),
)
"""It commands a rate of GAIN times what is left to the stick."""


def test_an_integral_that_is_held_goes_as_a_power():
    """Each tick leaves 1 - k T of what was left: y = 1 - (1 - k T)^n, one pole."""
    loop = ClosedLoop(Within(INTEGRAL), HOLD)
    np.testing.assert_allclose(loop.poles, [np.log(1.0 - GAIN * PERIOD) / PERIOD], rtol=1e-12)
    history = loop.step("roll", size=0.3, duration=0.5)
    left = (1.0 - GAIN * PERIOD) ** np.arange(51)
    np.testing.assert_allclose(history.time, np.arange(51) * PERIOD)
    np.testing.assert_allclose(history.signals["phi"], 0.3 * (1.0 - left), atol=1e-14)
    np.testing.assert_allclose(history.signals["lat"], 0.3 * GAIN * left, atol=1e-13)
    assert set(history.signals) == {"LAT", "lat", "phi"}


def test_a_stick_that_is_seen_late_moves_all_that_much_later():
    """By 2.5 ticks, seen at the third; its response by 25 ms, whatever a tick is."""

    class Late(Within):
        inputs, outputs = INTEGRAL.inputs, INTEGRAL.outputs
        response = INTEGRAL.response

        @property
        def stick_latency(self):
            return {"LAT": 2.5 * PERIOD}

    loop, soon = ClosedLoop(Late(INTEGRAL), HOLD), ClosedLoop(INTEGRAL, HOLD)
    late, now = (one.step("lat", size=1.0, duration=0.2).signals["phi"] for one in (loop, soon))
    np.testing.assert_allclose(late[3:], now[:-3], atol=1e-15)
    assert not late[:3].any()
    ratio = loop.command("lat").response / soon.command("lat").response
    np.testing.assert_allclose(ratio, np.exp(-0.025j * loop.frequency), rtol=1e-12)
    np.testing.assert_allclose(loop.broken("lat").response, soon.broken("lat").response)


def test_what_a_command_moves_at_once_is_in_the_loop():
    """Of u = k (s - y) and y = u is left y = k s / (1 + k)."""
    at_once = ticked(
        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), numbers([1.0]), ("lat",), ("phi",)
    )
    history = ClosedLoop(at_once, HOLD).step("lat", size=1.0, duration=0.02)
    np.testing.assert_allclose(history.signals["phi"], GAIN / (1.0 + GAIN), rtol=1e-12)


def test_it_is_the_loop_that_a_vehicle_closes_by_itself(jr700):
    """Its own closing, `vehicle.sampled.close`, is another way to the same loop."""
    gyro = jr700.gyro
    base = jr700.linearize("IN1").system
    a, b = zero_order_hold(np.asarray(base.A), np.asarray(base.B), gyro.period)
    shown = slice(len(OUTPUTS))
    plant = ticked(
        a,
        b,
        np.asarray(base.C)[shown],
        np.asarray(base.D)[shown],
        tuple(base.input_labels),
        OUTPUTS,
        gyro.period,
    )
    whole = close(jr700.linearize("IN1"), gyro).system
    loop = ClosedLoop(plant, gyro)
    own = np.linalg.eigvals(np.asarray(whole.A)).astype(complex)
    own = np.log(own[np.abs(own) > 0.01]) / gyro.period  # apart from what is over within a tick
    fast = loop.poles[np.abs(loop.poles) > 0.02]  # of its place nothing is held: poles near 0
    own = own[np.abs(own) > 0.02]
    np.testing.assert_allclose(np.sort_complex(fast)[-15:], np.sort_complex(own)[-15:], rtol=1e-6)
    history = loop.step("pitch", size=0.1, duration=0.5)
    state, stick = np.zeros(len(whole.A)), whole.input_labels.index("LON")
    a, b, c, d = (np.array(getattr(whole, name)) for name in "ABCD")
    moved = []
    for _ in history.time:
        moved.append(c @ state + d[:, stick] * 0.1)
        state = a @ state + b[:, stick] * 0.1
    for name in ("q", "theta", "p", "lon"):
        expected = np.array(moved)[:, whole.output_labels.index(name)]
        np.testing.assert_allclose(history.signals[name], expected, atol=1e-10)


def test_responses_alone_have_no_poles():
    class Seen:
        inputs, outputs = ("lat",), ("phi",)

        def response(self, frequency):
            return np.ones((1, 1, frequency.size), dtype=complex)

    with pytest.raises(NoResponse, match="the plant is known by its responses alone"):
        _ = ClosedLoop(Seen(), HOLD).poles
    with pytest.raises(NoResponse, match="the law is known by its responses alone"):
        ClosedLoop(INTEGRAL, Seen()).step("lat", size=1.0, duration=1.0)


def test_other_ticks_and_an_unknown_stick_are_refused():
    slow = ticked(HOLD.a, HOLD.b, HOLD.c, HOLD.d, HOLD.inputs, HOLD.outputs, 0.02)
    with pytest.raises(InputError, match=r"each 0\.01 s, the law each 0\.02 s"):
        _ = ClosedLoop(INTEGRAL, slow).poles
    with pytest.raises(NoResponse, match="the law has no stick 'PED': it has phi, LAT"):
        ClosedLoop(INTEGRAL, HOLD).step("yaw", size=1.0, duration=1.0)
