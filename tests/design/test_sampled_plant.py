"""Plants at ticks, against the closed form of a textbook and against their own responses."""

from dataclasses import replace

import numpy as np
import pytest

from exact_fits import OMEGA
from exact_fits import found as fitted
from helisim import ident
from helisim.base.linear import LinearSystem
from helisim.design.plant import Plant
from helisim.handling.loop import NoResponse

SERVO = ident.blocks.second_order("servo", omega=200.0, zeta=1.0)
HOVER = ident.in_series(ident.structures.rollpitch_speeds, inputs={"lat": SERVO, "lon": SERVO})
ROLL = {
    **{"tau_f": 0.045, "L_b": 540.0, "M_a": 315.0, "A_b": -0.35, "B_a": 0.53, "A_lat": 0.066},
    **{"A_lon": 0.37, "B_lat": 0.38, "B_lon": -0.06, "A_u": 1.1e-3, "L_p": -0.02, "M_q": -0.02},
}


@pytest.mark.parametrize("ticks", [0, 1, 3])
@pytest.mark.parametrize("rest", [0.0, 0.6, 1.5])
def test_a_delayed_lag_is_sampled_as_in_the_textbook(ticks, rest):
    """Of systems with a delay: Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed., 2.3.

    With dx/dt = -k x + u(t - d T - tau), x+ = e^(-k T) x + G0 u(-d) + G1 u(-d - 1), where
    G0 = (1 - e^(-k (T - tau))) / k, G1 = e^(-k (T - tau)) (1 - e^(-k tau)) / k.
    """
    k, period, tau = 0.9, 2.0, rest
    one = np.ones((1, 1))
    lag = LinearSystem(-k * one, one, one, 0.0 * one, None, ("u",), ("x",))
    now = replace(lag, delays={"u": ticks * period + tau}).discretise(period)
    a, b, c, d = now.a, now.b, now.c, now.d
    answer = [d[0, 0]] + [(c @ np.linalg.matrix_power(a, n) @ b)[0, 0] for n in range(8)]
    first = (1.0 - np.exp(-k * (period - tau))) / k
    then = np.exp(-k * (period - tau)) * (1.0 - np.exp(-k * tau)) / k
    expected = np.zeros(9)
    for n in range(9 - ticks - 1):
        expected[n + ticks + 1] += first * np.exp(-k * period * n)
        if n + ticks + 2 < 9:
            expected[n + ticks + 2] += then * np.exp(-k * period * n)
    np.testing.assert_allclose(answer, expected, atol=1e-14)


@pytest.mark.parametrize("latency", [0.0, 0.002, 0.0047])
def test_its_response_is_that_of_what_it_samples(latency):
    """But for the gain of a hold, sin x / x, whose phase is among the delays; and that of az.

    The integral of the roll rate is the model's own attitude: no second one is added.
    """
    rolling = fitted(HOVER, **ROLL, tau_lat=0.0047, tau_lon=-0.0152)
    heaving = fitted(ident.structures.heave, Z_w=-0.9, Z_col=-42.0, tau_col=0.0083)
    late = {"p": 0.0035, "q": 0.0035, "lon": 0.0198}
    plant = Plant((rolling, heaving), late=late, latency=latency, tilt=(0.07, -0.01))
    now = plant.sampled
    point = np.exp(1j * OMEGA * now.period)[:, None, None]
    states = np.linalg.solve(point * np.eye(len(now.a)) - now.a, now.b[None])
    at_ticks = np.moveaxis(now.c @ states + now.d, 0, -1)
    held = np.sinc(OMEGA * now.period / (2.0 * np.pi))
    expected = plant.response(OMEGA) * held
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


def test_a_model_of_which_another_tells_a_part_has_no_poles():
    whole = fitted(
        ident.structures.rollpitch, **{k: ROLL[k] for k in list(ROLL)[:9]}, tau_lat=0.0, tau_lon=0.0
    )
    part = fitted(
        ident.structures.yaw_base.renamed({"ped": "lat", "r": "p"}),
        N_r=-1.0,
        N_ped=40.0,
        tau_r_base=0.0,
    )
    with pytest.raises(NoResponse, match="'rollpitch' tells p/lon, q/lat, q/lon only"):
        _ = Plant((part, whole)).sampled
