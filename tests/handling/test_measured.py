"""What is measured of closed loops, against python-control's margins of the loops flown."""

from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest
from scipy.special import ndtri

import helisim as hs
from closed_loops import PERIOD, chirp, flown, known_loop
from helisim.base.errors import IdentificationError
from helisim.handling.loop import Curve, NoResponse
from helisim.handling.measured.interval import figures_of, interval
from helisim.handling.measured.margins import (
    Driven,
    MeasuredFigure,
    MeasuredLoop,
    _drives,
    _error_root,
    _excited_band,
    _groups,
    cuts_by_name,
    known_curve,
)
from helisim.ident import frequency_response
from helisim.records.record import Channel, FlightRecord
from tabled import rows, tabled

CROSSOVER = {"band": (4.0, 9.0), "draws": 2}
"""Around the crossover alone, at 4.9 rad/s, and no intervals: in a tenth of the time."""


@pytest.fixture(scope="module")
def measured():
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
    found = hs.margins(flown(loop, seed=1, noise=0.0), draws=3).loop
    assert found.count == 4  # draws come in pairs
    curve = found.broken("lat")
    exact = loop(np.exp(1j * curve.frequency * PERIOD))
    # swept from 1.5 to 80 rad/s, begun at once, which has power an octave below
    assert 0.75 < curve.frequency[0] < 1.6
    assert curve.frequency[-1] == pytest.approx(80.0, rel=0.05)
    inside = (curve.frequency > 2.0) & (curve.frequency < 60.0)
    np.testing.assert_allclose(curve.response[inside], exact[inside], rtol=3e-3)


@pytest.fixture(scope="module")
def coupled():
    one, other = (
        flown(known_loop(), seed=k, noise=0.02, name=n) for k, n in ((1, "lat"), (2, "lon"))
    )
    values = np.column_stack([one.values, other.values])
    # the other axis is swept downwards, and shows in this one's signals
    values[:, 3:] = values[::-1, 3:]
    values[:, 1:3] += 0.3 * values[:, [4]]
    return FlightRecord(one.time, values, one.channels + other.channels, {"made_by": "a test"})


def test_axes_that_are_swept_at_once_are_told_apart(coupled):
    found = hs.margins(coupled, **CROSSOVER)
    _, phase, _, _ = control.margin(known_loop())
    assert abs(found.figure("phase_margin", "lat").value - phase) < 2.0


def test_errors_of_a_loop_are_those_of_its_responses(coupled):
    """R R* is the estimate's own covariance; of outputs that are alike biases are one error.

    Draws of it scatter so: 4 000 are known to 2 % of the largest, in pairs about the response.
    """
    drives, outputs = ["lat_disturbance", "lon_disturbance"], ["lat_sum", "lat"]
    parts = [coupled.slice(0.0, 34.0), coupled.slice(30.0, 60.0)]
    scatter = frequency_response(parts, inputs=drives, outputs=outputs, band=(5.0, 5.6)).scatter
    at, both = scatter.frequency, np.hypot(scatter.bias, scatter.spread)
    scatter = replace(scatter, bias=both, spread=0.0 * both)
    output, position = (k.ravel() for k in np.indices((2, at.size)))
    wanted = scatter.covariance(output, 0 * output + 1, position)
    size = np.sqrt(np.real(np.diagonal(wanted)))
    over, near = (
        np.outer(size, size),
        np.exp(-2.0 * np.abs(np.subtract.outer(np.log(at), np.log(at)))),
    )
    across = np.kron([[0.0, 1.0], [1.0, 0.0]], near) * np.outer(*2 * [both[:, 1].ravel()])
    for alike, covariance in (([0, 1], wanted), ([0, 0], wanted + across)):
        root = _error_root(scatter, 1, np.array(alike))
        # of single precision, and of what is added to the diagonal
        np.testing.assert_allclose(root @ root.conj().T / over, covariance / over, atol=3e-5)
    response = np.ones((2, at.size)) + 1j
    draws = Driven("a", ("b", "c"), at, response, root).samples(4_000, 3)
    off = (draws - response).reshape(4_000, -1) / size
    np.testing.assert_allclose(off.T @ off.conj() / 4_000, covariance / over, atol=0.1)
    np.testing.assert_allclose(off[:2_000], -off[2_000:], atol=1e-9)


def test_a_band_is_where_all_that_was_injected_has_power():
    """Of flat lines from 5 to 40 and 3 to 20 rad/s; power is averaged over a tenth to each side."""
    time = 0.01 * np.arange(6_000)
    omega = 2.0 * np.pi * np.fft.rfftfreq(time.size, 0.01)
    turn = np.exp(1j * omega**2)

    def record(*bands):
        waves = [np.fft.irfft(turn * ((omega > low) & (omega < high))) for low, high in bands]
        channels = tuple(Channel(name, "1", "OTHER") for name in ("one", "other"))
        return FlightRecord(time, np.column_stack(waves), channels, {})

    found = _excited_band([record((5.0, 40.0), (3.0, 20.0))], ["one", "other"])
    assert found == pytest.approx((5.0 / 1.1, 20.0 / 0.9), rel=0.04)  # of the grid's points
    with pytest.raises(IdentificationError, match="one, other have no band of power in common"):
        _excited_band([record((3.0, 8.0), (20.0, 40.0))], ["one", "other"])


@pytest.mark.parametrize("more", [0.9, 1.1])
def test_a_signal_that_hardly_moves_is_at_rest(more):
    """Below 1e-4 of the largest of its place; a stick slower than 0.3 of the fastest one."""
    sizes = dict.fromkeys(("lat_sum", "lon_sum", "phi_sum", "lat_disturbance", "LAT"), 1.0)
    sizes |= {
        "lon_disturbance": 1e-4 * more,
        "phi_disturbance": 1e-9,
        "LON": 0.3 * more,
        "PED": 0.0,
    }
    time = 0.01 * np.arange(500)
    values = np.outer(np.sin(30.0 * time), [*sizes.values()])
    channels = tuple(Channel(name, "1", "OTHER") for name in sizes)
    record, kept = FlightRecord(time, values, channels, {}), more > 1.0
    lon = ["lon_disturbance"] if kept else []
    assert _drives(record, cuts_by_name([*sizes])) == ("lat_disturbance", *lon, "phi_disturbance")
    assert _drives(record, ()) == (("LON", "LAT") if kept else ("LAT",))


def test_records_that_share_a_signal_are_estimated_together():
    assert _groups([("a",), ("c",), ("a", "b"), (), ("b",)]) == [
        (("a", "b"), [0, 2, 4]),
        (("c",), [1]),
    ]


def test_a_record_late_against_what_was_injected_is_put_right():
    record = flown(known_loop(), seed=3, noise=0.05)
    cut = hs.Cut("lat", "actuators", "lat_disturbance", None, "lat")
    straight = hs.margins(record, cuts=cut, **CROSSOVER).loop.driven[0]
    late = hs.margins(record, cuts=cut, late={"lat": 0.02}, **CROSSOVER).loop.driven[0]
    np.testing.assert_allclose(
        late.response, straight.response * np.exp(0.02j * straight.frequency), rtol=1e-12
    )
    recorder = {"recorder": {"latency": {"lat": 0.02}}}  # of what was added there too
    alike = hs.margins(replace(record, provenance=recorder), cuts=cut, **CROSSOVER).loop.driven[0]
    np.testing.assert_allclose(alike.response, straight.response, rtol=1e-12)


def test_what_is_doubtful_of_a_record_is_told():
    record = flown(known_loop(), seed=3, noise=0.05)
    stick = 0.2 * np.roll(record["lat_disturbance"], 500)
    values = np.column_stack([record.values, stick])
    held = FlightRecord(record.time, values, (*record.channels, Channel("LAT", "1", "IN2")), {})
    less = replace(held, values=values * [1.0, 1.0, 1.0, 0.45])  # 0.09 of what was injected
    told = [str(hs.margins(one, **CROSSOVER).remarks) for one in (held, less)]
    assert ["LAT moved while lat_disturbance did: what a pilot" in one for one in told] == [1, 0]
    jumps = np.random.default_rng(0).choice([-1.0, 1.0], (len(record), 1)) ** [1, 1, 0]
    wrong = {"lat_sum isn't lat plus": [1.0, 1.0, -1.0], "lat_disturbance jumps": jumps}
    for words, own in wrong.items():
        other = replace(record, values=record.values * own)
        told = [hs.margins(one, **CROSSOVER).remarks for one in (record, other)]
        assert [any(words in one for one in remarks) for remarks in told] == [False, True]


def test_sticks_alone_give_no_loop_and_the_remark_says_so():
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


def test_responses_of_a_loop_follow_from_what_was_injected():
    """Of L = 5 / s behind P = 4 / s: at the actuator, of an angle and of a stick."""
    frequency = np.geomspace(1.0, 30.0, 40)
    s = 1j * frequency
    left = 1.0 / (1.0 + 5.0 / s)
    driven = tuple(
        Driven(name, tuple(out), frequency, [*out.values()], np.zeros((40 * len(out),) * 2))
        for name, out in {
            "lat_disturbance": {"lat_sum": left, "lat": left - 1.0, "p": 4.0 * left},
            "phi_disturbance": {"phi_sum": left, "lat": -5.0 / 4.0 * left},
            "LAT": {"p": 3.0 * left, "q": 0.1 * left, "lat": 0.7 * left},
        }.items()
    )
    cuts = cuts_by_name(["lat_disturbance", "lat_sum", "lat", "phi_disturbance", "phi_sum"])
    loop = MeasuredLoop(driven, cuts, 2)
    for found, wanted in rows(
        {**globals(), **locals()}, "test_responses_of_a_loop_follow_from_what_was_injected"
    ):
        np.testing.assert_allclose(found.response, wanted, rtol=1e-9)
    # without errors of the measurement what is left is by how much a flight's loop isn't the trim's
    many = MeasuredLoop(driven, cuts, 4_000)
    samples = many.broken("lat").samples
    off = samples * s / 5.0 - 1.0
    assert (np.std(off.real), np.std(off.imag)) == pytest.approx((0.006, 0.002), rel=0.06)
    draws = [one.broken("lat").response for _, one in zip(range(3), many.draws)]
    np.testing.assert_array_equal(draws, samples[:3])
    for asked, words in (
        (lambda: loop.command("lat", "r"), "r was not recorded while LAT .* there are p, q, lat"),
        (lambda: loop.command("lon"), "LON was not moved .* lat_disturbance, phi_disturbance, LAT"),
        (lambda: loop.broken("ped"), "into ped at actuators; there is lat at actuators, lat at se"),
        (lambda: MeasuredLoop(driven, (), 2).broken("lat"), "there is no cut"),
        (lambda: MeasuredLoop((), (), 2).command("lat"), "in the records: nothing was"),
    ):
        with pytest.raises(NoResponse, match=words):
            asked()


@tabled("doubtful", "band")
def test_a_curve_is_the_longest_band_that_is_known(doubtful, band):
    """Known to 15 % by half of the draws; of bands as long as another the lowest."""
    frequency = np.arange(1.0, 13.0)
    size = np.where(np.isin(frequency, doubtful), 0.151, 0.149)
    response = 2.0 * np.exp(-1j * frequency)
    samples = response * (1.0 + np.outer([9.0, 1.0, 1j, -1.0, 0.0], size))
    if doubtful:
        samples[2, doubtful[0] - 1] = np.inf
    lost = samples.copy()
    lost[:, 1::2] = np.inf
    found = known_curve("L", frequency, response, samples)
    assert (found.frequency[0], found.frequency[-1]) == band
    seen = slice(band[0] - 1, band[1])
    np.testing.assert_array_equal(found.response, response[seen])
    np.testing.assert_array_equal(found.samples, samples[:, seen])
    with pytest.raises(NoResponse, match="L is lost in noise between 1 and 12 rad/s"):
        known_curve("L", frequency, response, lost)


@tabled("kind", "low", "high", "expected")
def test_figures_are_told_where_the_band_shows_them(kind, low, high, expected):
    frequency = np.geomspace(low, high, 300)
    s = 1j * frequency
    response = {
        "broken": 5.0 * np.exp(-s / 20.0) / s,
        "disturbance": s / (s + 5.0),
        "command": np.exp(-s / 10.0) / s,
    }[kind]
    found = figures_of(
        SimpleNamespace(**{kind: lambda *_: Curve(frequency, response)}), kind, "lat"
    )
    told = {name: value for name, value in found.items() if np.isfinite(value)}
    # straight lines between points 1 % apart
    assert told == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("value", [0.0, 0.5, -0.5])
def test_an_interval_holds_the_percentiles_of_both_rules(value):
    """Normal draws: plain ends -1.96 and 1.96, bias-corrected ones further by twice the value."""
    draws = ndtri((np.arange(100_000) + 0.5) / 100_000)
    found = interval(value, draws)
    wanted = -1.95996 + min(2.0 * value, 0.0), 1.95996 + max(2.0 * value, 0.0)
    assert (found.low, found.high) == pytest.approx(wanted, abs=0.01)  # of the outermost draws
    said = MeasuredFigure("DRB", "lat", "sensors", "rad/s", replace(found, low=-np.inf)).to_dict()
    assert (said["value"], said["low"], said["high"]) == (value, None, found.high)
    for lost in (9_000, 11_000):  # of which a tenth may lack the figure
        draws[-lost:] = np.nan
        assert np.isfinite(interval(value, draws).low) == (lost < 10_000)


def test_names_of_channels_say_where_loops_are_cut():
    found = cuts_by_name(["lat_disturbance", "lat", "lat_sum", "phi"])
    assert found == (hs.Cut("lat", "actuators", "lat_disturbance", "lat_sum", "lat"),)
    assert cuts_by_name(["ped_added", "ped", "ped_gyro"]) == (
        hs.Cut("ped", "actuators", "ped_added", "ped", "ped_gyro"),
    )
    assert cuts_by_name(["phi_disturbance", "phi_sum", "psi_disturbance"]) == (
        hs.Cut("roll", "sensors", "phi_disturbance", "phi_sum"),
    )


def test_a_signal_that_one_record_lacks_is_told():
    record = flown(known_loop(), seed=3, noise=0.05)
    channels = tuple(one for one in record.channels if one.name != "lat_sum")
    values = record.select([one.name for one in channels])
    short = FlightRecord(record.time, values, channels, {})
    both = hs.Cut("lat", "actuators", "lat_disturbance", "lat_sum", "lat")
    found = hs.margins([short, record], cuts=both, axes="lat", **CROSSOVER)
    assert found.figures == ()
    assert "lat_sum was not recorded, or rested, while lat_disturbance was moved" in found.remarks


RECORD = flown(known_loop(), seed=3, noise=0.05)


@tabled("ask", "error", "words")
def test_what_cannot_be_is_said(measured, ask, error, words):
    with pytest.raises(error, match=words):
        ask(measured)
