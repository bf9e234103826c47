"""What is measured of closed loops, against python-control's margins of the loops flown."""

from types import SimpleNamespace

import control
import numpy as np
import pytest

import helisim as hs
from closed_loops import PERIOD, chirp, flown, known_loop
from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.handling.loop import Curve, NoResponse
from helisim.handling.measured.interval import Asked, intervals
from helisim.handling.measured.margins import cuts_by_name
from helisim.records.record import Channel, FlightRecord

CROSSOVER = {"band": (4.0, 9.0), "draws": 2}
"""Around the crossover alone, at 4.9 rad/s, and no intervals: in a tenth of the time."""


@pytest.fixture(scope="module")
def measured():
    """A loop measured in noise."""
    return hs.margins(flown(known_loop(), seed=3, noise=0.02), draws=100)


def test_margins_are_those_of_python_control(measured):
    """Crossover, phase and gain margin are the loop's own within their intervals, which are narrow.

    Twice the interval holds all but one in 10 000; how many the interval holds is the study's.
    """
    gain, phase, _, crossover = control.margin(known_loop())
    for name, exact, width in (
        ("crossover", crossover, 0.1 * crossover),
        ("phase_margin", phase, 8.0),
        ("gain_margin", 20.0 * np.log10(gain), 4.0),
    ):
        found = measured.figure(name, "roll", "actuators")
        assert abs(found.value - exact) < found.high - found.low
        assert found.low < found.value < found.high
        assert found.high - found.low < width


def test_without_noise_the_loop_is_exact():
    """What is left without noise is the estimate's own bias: a thousandth of the response."""
    loop = known_loop()
    curve = hs.margins(flown(loop, seed=1, noise=0.0), draws=2).loop.broken("lat")
    exact = loop(np.exp(1j * curve.frequency * PERIOD))
    inside = (curve.frequency > 2.0) & (curve.frequency < 60.0)
    np.testing.assert_allclose(curve.response[inside], exact[inside], rtol=3e-3)


def test_either_the_sum_or_what_returns_is_enough():
    """Both signals say the same: the sum is what returns and what was injected."""
    record = flown(known_loop(), seed=3, noise=0.05)
    found = [
        hs.margins(record, cuts=hs.Cut("lat", "actuators", "lat_disturbance", *names), **CROSSOVER)
        for names in (("lat_sum", None), (None, "lat"), ("lat_sum", "lat"))
    ]
    values = [one.figure("phase_margin", "lat").value for one in found]
    assert np.ptp(values) < 1.0  # deg: they weigh widths of the band by different responses


def test_axes_that_are_swept_at_once_are_told_apart():
    """Two loops excited together, coupled: S_ii has the other's reference taken out."""
    one, other = (
        flown(known_loop(), seed=k, noise=0.02, name=n) for k, n in ((1, "lat"), (2, "lon"))
    )
    values = np.column_stack([one.values, other.values])
    # the other axis is swept downwards, and shows in this one's signals
    values[:, 3:] = values[::-1, 3:]
    values[:, 1:3] += 0.3 * values[:, [4]]
    both = FlightRecord(one.time, values, one.channels + other.channels, {"made_by": "a test"})
    found = hs.margins(both, **CROSSOVER)
    _, phase, _, _ = control.margin(known_loop())
    assert abs(found.figure("phase_margin", "lat").value - phase) < 2.0


def test_a_criterion_of_ones_own_has_intervals(measured):
    """Any figure of a loop follows with its interval from the draws."""
    found = intervals(measured.loop, lambda one: {"gain": abs(one.broken("lat").at(10.0)[0])})
    exact = abs(known_loop()(np.exp(1j * 10.0 * PERIOD)))
    assert abs(found["gain"].value - exact) < found["gain"].high - found["gain"].low < 0.2 * exact


def test_a_record_late_against_what_was_injected_is_put_right():
    """A latency that is named is taken out of the phase, exactly."""
    record = flown(known_loop(), seed=3, noise=0.05)
    cut = hs.Cut("lat", "actuators", "lat_disturbance", None, "lat")
    straight = hs.margins(record, cuts=cut, **CROSSOVER).loop.driven[0]
    late = hs.margins(record, cuts=cut, late={"lat": 0.02}, **CROSSOVER).loop.driven[0]
    np.testing.assert_allclose(
        late.response, straight.response * np.exp(0.02j * straight.frequency), rtol=1e-12
    )


def test_sticks_alone_give_no_loop_and_the_remark_says_so():
    """A pilot's sweep: the answer to the stick, and that margins can't be had."""
    time = np.arange(0.0, 60.0, PERIOD)
    stick = chirp(60.0, (1.0, 40.0), 0.1)
    answer = control.forced_response(control.tf([60.0], [1.0, 12.0, 60.0]), time, stick).outputs
    channels = (Channel("LAT", "1", "IN2", ""), Channel("p", "rad/s", "OUT", ""))
    record = FlightRecord(time, np.column_stack([stick, answer]), channels, {"made_by": "a test"})
    found = hs.margins(record, draws=20)
    assert any("no loop was cut" in remark for remark in found.remarks)
    assert found.loop.axes == ("lat",)
    with pytest.raises(NoResponse, match="nothing was injected into lat"):
        found.loop.broken("lat")
    # of 60 / (s (s^2 + 12 s + 60)) the phase is -135 deg where w^2 + 12 w = 60
    exact = -6.0 + np.sqrt(96.0)
    assert found.figure("bandwidth", "lat").value == pytest.approx(exact, rel=0.01)


def test_a_gain_margin_is_that_of_a_crossing_that_was_seen(measured):
    """Where the band begins at a gain of 1.2, -1 is not near: only the crossing at 16 rad/s is."""
    _, _, turn, _ = control.margin(known_loop())
    curve = measured.loop.broken("lat")
    inside = (curve.frequency > 4.4) & (curve.frequency < 2.0 * turn)
    seen = Curve(curve.frequency[inside], curve.response[inside])
    found = Asked("broken", "lat", "actuators")(SimpleNamespace(broken=lambda *_: seen))
    assert found["gain_margin"] == pytest.approx(measured.figure("gain_margin", "lat").value)


def test_names_of_channels_say_where_loops_are_cut():
    """What helisim's records call what was added, at actuators, servos, angles and rates."""
    found = cuts_by_name(["lat_disturbance", "lat", "lat_sum", "r_disturbance", "r_sum", "phi"])
    assert found == (
        hs.Cut("lat", "actuators", "lat_disturbance", "lat_sum", "lat"),
        hs.Cut("ped", "r", "r_disturbance", "r_sum"),
    )
    assert cuts_by_name(["ped_added", "ped", "ped_gyro"]) == (
        hs.Cut("ped", "actuators", "ped_added", "ped", "ped_gyro"),
    )
    assert cuts_by_name(["phi_disturbance", "phi_sum", "psi_disturbance"]) == (
        hs.Cut("roll", "sensors", "phi_disturbance", "phi_sum"),
    )


def test_what_cannot_be_is_said(measured):
    """Bad arguments are refused with what exists."""
    record = flown(known_loop(), seed=3, noise=0.05)
    with pytest.raises(InputError, match="what follows 'a' is not said"):
        hs.Cut("lat", "actuators", "a")
    with pytest.raises(InputError, match="actuators or sensors or p"):
        hs.Cut("lat", "wings", "a", "b")
    with pytest.raises(UnknownNameError, match="place of a cut 'wings'"):
        hs.margins(record, at="wings")
    with pytest.raises(UnknownNameError, match="'foo'"):
        hs.margins(record, cuts=hs.Cut("lat", "actuators", "foo", "lat_sum"))
    still = FlightRecord(record.time, 0.0 * record.values, record.channels, {})
    with pytest.raises(IdentificationError, match="nothing was injected"):
        hs.margins(still)
    with pytest.raises(InputError, match="late by inf"):
        hs.margins(record, late={"lat": np.inf})
    with pytest.raises(UnknownNameError, match="DRB lon"):
        measured.figure("DRB", "lon")
