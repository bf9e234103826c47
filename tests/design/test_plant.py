"""Plants of fits: what is sensed, at ticks too, and their samples by the covariances."""

from dataclasses import replace

import numpy as np
import pytest

from helisim import ident
from helisim.base.errors import InputError
from helisim.design.exact import air_met, exact_loop, hands_off
from helisim.design.plant import Plant, sample_parameters, turned
from helisim.handling.loop import NoResponse
from helisim.physics.motion import flip
from helisim.sim import FlightPlan, Pilot, Step, Weather, simulate
from ident_data import OMEGA as WIDE
from ident_data import ROLL, SERVOED
from ident_data import found as fitted
from tabled import tabled

OMEGA = np.geomspace(1.0, 40.0, 60)
TRUE = {"N_r": -1.2, "N_ped": 40.0, "tau_r_base": 0.05}


@pytest.fixture(scope="module")
def yaw():
    response = 40.0 / (1j * OMEGA + 1.2) * np.exp(-0.05j * OMEGA)
    exact = ident.FrequencyResponse.exact(
        OMEGA, response[None, None], inputs=["ped"], outputs=["r"]
    )
    return ident.identify(exact, ident.structures.yaw_base)


def test_what_is_recorded_late_is_sensed_at_once_and_late_by_the_gyro(yaw):
    """The closed form of what is left: a lag, 50 - 40 ms, and the gyro's 4 ms on the rate."""
    plant = Plant((yaw,), late={"r": 0.04}, latency=0.004)
    rate, heading = plant.response(OMEGA)[:, 0]
    now = 40.0 / (1j * OMEGA + 1.2) * np.exp(-0.01j * OMEGA)
    assert (plant.inputs, plant.outputs) == (("ped",), ("r", "psi"))
    np.testing.assert_allclose(rate, now * np.exp(-0.004j * OMEGA), rtol=1e-6)
    np.testing.assert_allclose(heading, now / (1j * OMEGA), rtol=1e-6)


def test_a_fall_has_no_gyro_and_a_rate_that_is_its_acceleration():
    """dw/dt = Z_w w + Z_col col: w is late as it is recorded less so; az = s w; turned angles."""
    heave = fitted(ident.structures.heave, Z_w=-0.9, Z_col=-42.0, tau_col=0.05)
    rolling, tilt = fitted(SERVOED, **ROLL, tau_lat=0.0, tau_lon=0.0), (0.2, -0.1)
    late = {"w": 0.03, "col": 0.01}
    plant = Plant((heave, rolling), late=late, latency=0.004, tilt=tilt)
    s, found = 1j * OMEGA, dict(zip(plant.outputs, plant.response(OMEGA)))
    w = -42.0 / (s + 0.9) * np.exp(-s * (0.05 - 0.03 + 0.01))
    np.testing.assert_allclose(found["w"][0], w, rtol=1e-9)
    np.testing.assert_allclose(found["az"][0], s * w, rtol=1e-9)
    rates = np.array([found["p"], found["q"], 0.0 * found["q"]]) * np.exp(0.004 * s) / s
    angles = np.array([found["phi"], found["theta"]])
    np.testing.assert_allclose(angles, np.tensordot(turned(tilt)[:2], rates, 1), atol=1e-12)
    assert plant.axes == ("col", "lon", "lat")


def test_fits_that_tell_the_same_or_begin_at_a_stick_are_refused():
    rolling = fitted(SERVOED, **ROLL, tau_lat=0.0, tau_lon=0.0)
    part = fitted(ident.structures.yaw_base.renamed({"ped": "lat", "r": "p"}), **TRUE)
    with pytest.raises(InputError, match="two fits tell p/lat: leave one of them out"):
        Plant((part, rolling))
    with pytest.raises(InputError, match="a plant needs a fit, and values of each: got 2 and 1"):
        Plant((part, rolling), values=(part.values,))
    stick = fitted(ident.structures.yaw_base.renamed({"ped": "PED"}), **TRUE)
    with pytest.raises(InputError, match=r"servo command \(col, lon, lat, ped\).*PED"):
        Plant((stick,))


def test_angles_turn_as_euler_angles_do():
    from scipy.spatial.transform import Rotation

    phi, theta, step = 0.2, -0.1, 1e-7
    start = Rotation.from_euler("ZYX", [0.3, theta, phi])
    for axis in range(3):
        after = start * Rotation.from_rotvec(step * np.eye(3)[axis])
        psi_, theta_, phi_ = after.as_euler("ZYX") - [0.3, theta, phi]
        # differences of angles of 1e-7 rad lose nine digits of sixteen
        np.testing.assert_allclose(
            turned((phi, theta))[:, axis], np.array([phi_, theta_, psi_]) / step, atol=1e-6
        )


@pytest.mark.parametrize("latency", [0.0, 0.002, 0.0047])
def test_its_response_is_that_of_what_it_samples(latency):
    """But for the gain of a hold, sin x / x, whose phase is among the delays; and that of az.

    The integral of the roll rate is the model's own attitude: no second one is added.
    """
    rolling = fitted(SERVOED, **ROLL, tau_lat=0.0047, tau_lon=-0.0152)
    heaving = fitted(ident.structures.heave, Z_w=-0.9, Z_col=-42.0, tau_col=0.0083)
    late = {"p": 0.0035, "q": 0.0035, "lon": 0.0198}
    plant = Plant((rolling, heaving), late=late, latency=latency, tilt=(0.07, -0.01))
    now = plant.sampled
    point = np.exp(1j * WIDE * now.period)[:, None, None]
    states = np.linalg.solve(point * np.eye(len(now.a)) - now.a, now.b[None])
    at_ticks = np.moveaxis(now.c @ states + now.d, 0, -1)
    held = np.sinc(WIDE * now.period / (2.0 * np.pi))
    expected = plant.response(WIDE) * held
    # what a sampler folds down from 3000 rad/s: the more, the less a signal is smoothed
    folded = dict.fromkeys(plant.outputs, 1e-5) | {"w": 1e-3, "az": 0.02}
    for name, found, wanted in zip(plant.outputs, at_ticks, expected):
        np.testing.assert_allclose(found, wanted, rtol=folded[name], atol=1e-12, err_msg=name)
    assert len(rolling.structure.states) == 12
    waiting = len(now.a) - 12 - 1
    assert waiting <= 2 + 5 + 2 * 3


def test_a_model_that_leads_a_little_is_read_later():
    """Its command then moves at once what is sensed: 0.3 ms of the period's 2 have passed."""
    fit = fitted(ident.structures.yaw_base, N_r=-1.0, N_ped=40.0, tau_r_base=0.0407)
    plant = Plant((fit,), late={"r": 0.04})
    now = plant.sampled
    assert now.d[0, 0] == pytest.approx((1.0 - np.exp(-0.0003)) * 40.0, rel=1e-9)
    ahead = Plant((fit,), late={"r": 0.042})
    with pytest.raises(NoResponse, match=r"'ped' moves leads it by 2\.3 ms, more than the period"):
        _ = ahead.sampled


@pytest.fixture(scope="module")
def fit(yaw):
    structure = ident.structures.yaw_base.with_fixed({"tau_r_base": 0.05}, {"tau_r_base": 0.002})
    carried, own = np.array([[0.03], [-0.5]]), np.array([[0.01, 0.06], [0.06, 4.0]])
    found = ident.identify(yaw.response(OMEGA), structure)
    return replace(found, carried=carried, covariance=own + carried @ carried.T)


def test_drawn_parameters_scatter_as_the_covariance_says(fit):
    """5000 draws: a variance is then known to 2 % of itself, one standard deviation."""
    rng = np.random.default_rng(1)
    drawn = np.array([list(sample_parameters([fit], rng)[0].values()) for _ in range(5_000)])
    found = np.cov(drawn.T)
    errors = np.append(np.sqrt(np.diagonal(fit.covariance)), 0.002)
    whole = np.block([[fit.covariance, fit.carried * 0.002], [fit.carried.T * 0.002, 4e-6]])
    np.testing.assert_allclose(
        found / np.outer(errors, errors), whole / np.outer(errors, errors), atol=0.07
    )
    np.testing.assert_allclose(drawn.mean(axis=0), list(fit.values.values()), atol=0.1, rtol=2e-3)


def test_fits_that_share_a_known_value_share_its_error(fit):
    one, other = sample_parameters([fit, fit], np.random.default_rng(2))
    assert one["tau_r_base"] == other["tau_r_base"] != 0.05
    assert one["N_ped"] != other["N_ped"]


@tabled("covariance", "message")
def test_a_fit_whose_errors_are_not_known_is_refused(fit, covariance, message):
    known = None if covariance is None else np.diag(covariance)
    with pytest.raises(InputError, match=message):
        sample_parameters([replace(fit, covariance=known)], np.random.default_rng(1))


# The exact loop: as `Vehicle.loop`, as the vehicle flies, and in the air that it meets.


@pytest.fixture(scope="module")
def exact(jr700):
    return exact_loop(jr700)


@pytest.mark.parametrize("axis", ["lat", "lon", "ped"])
def test_a_broken_loop_is_the_vehicles(jr700, exact, axis):
    """`Vehicle.loop` cuts matrices where this inverts responses: the same to rounding."""
    loop = jr700.loop(axis)
    found = exact.broken(axis)
    cut = -np.array([loop(np.exp(1j * w * loop.dt)) for w in found.frequency])
    # rounding of 1 / S - 1, which loses log10 |1 + L| digits
    assert np.abs(found.response - cut).max() < 1e-11 * np.abs(1.0 + cut).max()


def test_commands_poles_and_steps_are_the_closed_systems(jr700, exact):
    whole = jr700.linearize("IN2")
    point = np.exp(1j * exact.frequency * whole.system.dt)
    row = whole.system.output_labels.index("phi")
    answer = np.array([whole.system(one)[row, 2] for one in point])
    assert np.abs(exact.command("lat").response / answer - 1.0).max() < 1e-9
    # the pedal is late by 11.4 ticks, linear between two: less than (w T)^2 / 8 from a pure delay
    turn = whole.system.output_labels.index("psi")
    late = np.exp(-1j * exact.frequency * whole.delays["PED"])
    answer = np.array([whole.system(one)[turn, 3] for one in point]) * late
    assert np.abs(exact.command("ped").response / answer - 1.0).max() < 0.15**2 * 4.0 / 8.0
    poles = np.linalg.eigvals(np.asarray(whole.system.A))
    slow = np.log(poles[np.abs(poles) > 0.5]) / whole.system.dt
    for pole in slow[np.abs(slow) > 0.1]:
        assert np.abs(exact.poles - pole).min() < 1e-6 * abs(pole)


def test_a_step_is_what_flies(jr700, exact):
    step = Step(axis="ped", amplitude=0.002, trim_time=0.1, duration=1.0)
    plan = FlightPlan(excitation=step, pilot=Pilot(remnant=0.0))
    flown = next(simulate(hands_off(jr700), plan, jobs=1))
    assert not np.ptp(flown.sticks[:, [1, 2]], axis=0).any()  # hands off: col alone, and the step
    found = exact.step("ped", size=0.002, duration=0.8)
    first = int(np.searchsorted(flown.time, 0.1 - 1e-9))
    rate = flown.rates[first : first + found.time.size, 2] - flown.rates[0, 2]
    # nonlinear by 1 % at 0.02 rad/s; nothing is fitted
    assert found.signals["r"] == pytest.approx(rate, abs=0.01 * np.abs(rate).max())


def test_calm_air_is_met_as_it_is(jr700):
    """One wind, which blows all the time: the steady one."""
    ((share, there),) = air_met(jr700, Weather())
    assert (share, there) == (1.0, jr700)
    ((share, there),) = air_met(jr700, Weather(wind=3.0))
    assert share == 1.0
    assert there.derivatives["Z_w"] == jr700.trimmed(wind=(-3.0, 0.0, 0.0)).derivatives["Z_w"]


def test_gusts_lie_along_the_path_through_the_air(jr700):
    """Their covariance is that of independent gusts ahead, to the right and down of the path."""
    rms, heading = (2.0, 0.1, 0.4), 0.6
    weather = Weather(wind=1.0, wind_from=heading, rms=rms)
    air = air_met(jr700, weather, points=(3, 3, 3))
    assert sum(share for share, _ in air) == pytest.approx(1.0, rel=1e-12)
    winds = np.array([flip(*there.model.opt.wind) for _, there in air])
    shares = np.array([share for share, _ in air])
    mean = shares @ winds
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    assert mean == pytest.approx(-ahead, abs=1e-12)
    path = np.array([ahead, [-ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
    # the quadrature has the variance of the normal distribution
    found = (winds - mean).T @ (shares[:, None] * (winds - mean))
    assert found == pytest.approx(path.T @ np.diag(rms) ** 2 @ path, abs=1e-9)
