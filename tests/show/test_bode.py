"""Bode plots: phases on their turn, data as points with bars, what pilots do not notice."""

from dataclasses import replace

import numpy as np
import pytest

from helisim.ident import FrequencyResponse
from helisim.show.plots import beside, draw_bode, phase_degrees, spread_out, unnoticeable

OMEGA = np.geomspace(0.3, 30.0, 200)
S = 1j * OMEGA


@pytest.mark.parametrize(
    ("line", "starts", "ends"),
    [
        (1.0 / S, -90.0, -90.0),
        (1.0 / S**2, -180.0, -180.0),
        (-1.0 / S**2, 0.0, 0.0),
        (S, 90.0, 90.0),
        (-1.0 / (0.001 * S + 1.0), -180.0, -180.0),
        (np.exp(-0.2 * S), np.rad2deg(-0.06), np.rad2deg(-6.0)),
    ],
)
def test_a_phase_starts_on_its_own_turn(line, starts, ends):
    """As one reads it in a book: no response starts at a turn more."""
    phase = phase_degrees(line)
    assert phase[[0, -1]] == pytest.approx([starts, ends], abs=2.0)  # the lag's 0.03 rad


def test_noise_below_the_coherent_band_moves_no_phase():
    """Random angles that would wind the phase up and down do not turn what is known."""
    random = np.random.default_rng(3)
    line, good = np.exp(-0.1 * S) / (S + 1.0), OMEGA > 1.0
    wound = line.copy()
    wound[~good] = np.exp(1j * random.uniform(-np.pi, np.pi, np.count_nonzero(~good)))
    shown = phase_degrees(wound, good)
    assert np.allclose(shown[good], phase_degrees(line)[good], atol=1e-9)
    assert np.all(np.abs(shown[~good] - shown[good][0]) <= 180.0)
    # a model moves to the turn of the data, not the data to it
    model = beside(OMEGA, line, OMEGA[good], shown[good] - 360.0)
    assert np.allclose(model, phase_degrees(line) - 360.0, atol=1e-9)


def test_points_keep_apart():
    """A dense grid is shown by log-spaced points, its ends among them; a sparse one whole."""
    at = spread_out(OMEGA, 30)
    assert (at[0], at[-1], at.size) == (0, OMEGA.size - 1, 30)
    assert np.ptp(np.diff(np.log(OMEGA[at]))) < 1.01 * np.log(OMEGA[1] / OMEGA[0])
    assert spread_out(OMEGA[:7]).tolist() == list(range(7))


def test_bars_reach_two_random_errors():
    """A tenth of random error is bars of 20 %, and of 0.2 rad."""
    one = FrequencyResponse.exact(
        OMEGA, (1.0 / (S + 1.0))[None, None], inputs=["lat"], outputs=["p"]
    )
    data = replace(one, random_error=np.full((1, 1, OMEGA.size), 0.1))
    panels = draw_bode("", "p", "lat", data=data, identified=one).panels
    for panel, half in ((panels[0], 20.0 * np.log10(1.2)), (panels[2], np.rad2deg(0.2))):
        (bars,) = [mark for mark in panel.marks if mark.kind == "bars"]
        assert np.allclose(bars.top - bars.y, 2.0 * half)
    # what is left of an exact model is zero, within what pilots do not notice
    (dots,) = [mark for mark in panels[1].marks if mark.kind == "dots"]
    low, high = [mark for mark in panels[1].marks if mark.ink == "grey"]
    assert np.allclose(dots.y, 0.0)
    assert np.nanmax(low.y) < 0.0 < np.nanmin(high.y)


def test_unnoticed_dynamics_are_fewest_where_pilots_close_their_loops():
    """By hand at 1 rad/s, where the upper gain is 19.63 + 31.61j over 0.84 + 27.14j."""
    found = unnoticeable(np.array([1.0]))
    by_hand = (-1.660, 2.741, -13.66, 30.05)  # 20 log10 |.|, and differences of angles
    assert np.ravel(found) == pytest.approx(by_hand, abs=0.01)  # the digits given
    low_db, high_db, low_deg, high_deg = unnoticeable(OMEGA)
    assert np.all((low_db < 0.0) & (high_db > 0.0) & (low_deg < 0.0) & (high_deg > 0.0))
    assert 1.0 < OMEGA[np.argmin(high_db - low_db)] < 5.0
