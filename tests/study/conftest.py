"""How many models are drawn where gains are tuned."""

import pytest

from helisim.study import log_tune, rotorflight_tune


def drawing(count):
    with pytest.MonkeyPatch.context() as patch:
        for one in (log_tune, rotorflight_tune):
            patch.setattr(one, "DRAWS", count)
        yield


@pytest.fixture(scope="module")
def fewer_draws():
    """Half as many: ends of an interval of 95 % are then the third of 100."""
    yield from drawing(100)


@pytest.fixture
def few_draws():
    """Of tests that don't look at intervals."""
    yield from drawing(20)
