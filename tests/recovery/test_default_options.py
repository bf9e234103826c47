"""Recovery with default options: nobody chose a band, an estimator or a start."""

import numpy as np
import pytest
from fleet import FLEET
from recovering import recover

from helisim.ident.evaluate import state_space


@pytest.fixture(params=list(FLEET))
def aircraft(request):
    return FLEET[request.param]()


def test_the_hover_model_is_the_one_that_was_promised():
    """Twelve states, 38 free parameters, four inputs, nine outputs; its phugoid is unstable."""
    one = FLEET["hover"]()
    structure = one.structure
    assert len(structure.states) == 12
    assert len(structure.free) == 38
    assert (len(structure.inputs), len(structure.outputs)) == (4, 9)
    unstable = [pole for pole in state_space(structure, one.truth).poles() if pole.real > 0.0]
    assert len(unstable) == 2
    assert 0.1 < abs(unstable[0]) < 0.5


def test_feedback_holds_it_in_the_air(aircraft):
    """Every loop is stable, whatever the aircraft does by itself."""
    assert np.max(np.abs(np.linalg.eigvals(aircraft.rig.loop()[0]))) < 1.0


def test_no_start_is_the_answer(aircraft):
    """Every fit starts at zero or at a power of ten."""
    for parameter in aircraft.structure.free:
        assert parameter.start in (0.0, *(s * 10.0**k for k in range(-6, 5) for s in (-1, 1)))


def check(name: str, seed: int) -> None:
    """All parameters are inside their bounds, and the points err as they say.

    Three stated errors hold 98.9 % of complex normal errors. Neighbouring points err together,
    so single flights scatter about that by 1 %.
    """
    found = recover(FLEET[name](), seed)
    outside = {name: excess for name, excess in found.excess.items() if excess > 1.0}
    assert not outside
    assert found.fit.converged
    assert found.share > 0.97


def test_the_f_16_comes_back():
    """Nobody chose a band, an estimator, nor a start."""
    check("f_16", 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["hover", "boeing_747", "lynx", "f_16", "hummingbird"])
def test_all_come_back(name, seed):
    """`scripts/proof/recovery_study.py` does this for 20 seeds."""
    check(name, seed)
