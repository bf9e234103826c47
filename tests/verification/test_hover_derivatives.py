"""The hover is a regular point: derivatives just beside it are those at it."""

import numpy as np
import pytest

import helisim as hs
import script

proof = script.loaded("proof/hover_derivatives")


@pytest.mark.parametrize("name", ["jr700", "lynx"])
def test_derivatives_about_the_hover_lie_on_a_smooth_curve(name):
    """A parabola through three speeds holds a fourth; both laws of inflow agree at the hover."""
    speeds = (0.0, 0.1, 0.3, 1.0)
    laws = [hs.load(name, parameters={"main_rotor.inflow": law}) for law in proof.LAWS]
    found = [np.array(proof.rows(law, speeds))[:, :4] for law in laws]
    for curve in found:
        parabola = np.polyfit(np.take(speeds, [0, 2, 3]), curve[[0, 2, 3]], 2)
        size = np.abs(curve).max(axis=0)
        # the cubic's share: (u / v_h)^3 x 0.1 x 0.2 x 0.9 of the speeds, v_h 4 m/s, is 3e-4
        assert np.all(np.abs([0.01, 0.1, 1.0] @ parabola - curve[1]) < 1e-3 * size)
    if name == "lynx":  # its Lock number is not reduced, as in Padfield's model
        return
    # central differences of 1e-6 and trims of 1e-9 leave five digits
    assert np.abs(found[0] - found[1])[0].max() < 2e-5 * np.abs(found[0]).max()
