"""Modes of published aircraft: the figures that their sources print, and those that fits find."""

from dataclasses import replace

import numpy as np
import published
import pytest
from fleet import boeing_747
from recovering import recover

from helisim.ident.modes import modes


def damped(gain):
    """Return the 747 with rudder = gain times yaw rate, as the source's yaw damper without filter.

    Positive, as yaw rate and rudder have opposite signs there.
    """
    structure, truth = published.boeing_747(), published.BOEING_747
    known = dict(structure.constants)
    known["Y_r"] += gain * known["Y_rud"]
    by_r = {
        "N_r": truth["N_r"] + gain * truth["N_rud"],
        "L_r": truth["L_r"] + gain * truth["L_rud"],
    }
    return modes(replace(structure, constants=known), truth | by_r, ())


def test_the_747s_dutch_roll_is_damped_as_its_source_says():
    """The example prints near 1 rad/s and 0.45 at a gain of 2.85; two digits, so 3 %."""
    (free,) = [one for one in damped(0.0).poles if one.oscillates]
    assert free.frequency == pytest.approx(1.0, rel=0.1)
    assert free.damping < 0.05
    (held,) = [one for one in damped(2.85).poles if one.oscillates]
    assert held.damping == pytest.approx(0.45, rel=0.03)


@pytest.mark.slow
def test_true_modes_are_within_the_errors_of_fits():
    """Five flights of the 747 in gusts, four modes' figures each: their errors are what is stated.

    Of 20 figures over their errors the rms is 1 with a scatter of 16 %, so 0.5 to 1.5 is three.
    """
    structure, truth = published.boeing_747(), published.BOEING_747
    spiral, roll, dutch = modes(structure, truth, ()).poles
    off = []
    for seed in range(5):
        found = recover(boeing_747(), seed).fit.modes.poles
        for one, true in zip(found, (spiral, roll)):
            off.append((one.real - true.real) / one.real_error)
        off.append((found[2].frequency - dutch.frequency) / found[2].frequency_error)
        off.append((found[2].damping - dutch.damping) / found[2].damping_error)
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5
    assert np.max(np.abs(off)) < 4.0
