"""Recovery with default options: nobody chose a band, an estimator or a start."""

import pytest
from fleet import FLEET
from recovering import recover

from tabled import tabled


@pytest.mark.parametrize("name", FLEET)
def test_no_start_is_the_answer(name):
    """Every fit starts at zero or at a power of ten."""
    for parameter in FLEET[name]().structure.free:
        assert parameter.start in (0.0, *(s * 10.0**k for k in range(-6, 5) for s in (-1, 1)))


@tabled("name", "seed")
def test_all_come_back(name, seed):
    """All parameters are inside their bounds, and the points err as they say.

    Three stated errors hold 98.9 % of complex normal errors. Neighbouring points err together,
    so single flights scatter about that by 1 %. `scripts/proof/recovery_study.py` flies 20 seeds.
    """
    found = recover(FLEET[name](), seed)
    assert not {name: excess for name, excess in found.excess.items() if excess > 1.0}
    assert found.fit.converged
    assert found.share > 0.97
