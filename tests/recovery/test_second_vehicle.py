"""Recovery: the Blade 360's published derivatives come back from its own sweeps."""

import pytest

from helisim.study.experiment import recover
from helisim.study.models import base_models
from helisim.study.paper import published
from helisim.study.results import Results
from helisim.vehicle import load

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def results() -> Results:
    return recover("blade360", flights=1, seed=2)


def test_published_derivatives_are_recovered_from_nothing_but_the_records(results):
    """Each within its tolerance of truth and of what is published, with a bound."""
    # 3 % of the main derivatives, 10 % of couplings and delays: reasons in helisim/recovery.py
    assert not results.misses
    found = {row.name for table in results.tables for row in table.parameters}
    assert found == {*published("blade360").targets, "A_u", "A_v"}
    for table in results.tables:
        assert {one.source for one in table.given} <= {"assumed"}
        assert all(row.cr_percent is not None for row in table.parameters)


def test_bands_are_the_vehicles_own():
    bands = {name: [m.band for m in base_models(load(name))] for name in ("blade360", "jr700")}
    assert bands["blade360"] == [(1.0, 30.0), (6.0, 100.0), (0.3, 12.0)]
    assert bands["jr700"] == [(0.6, 25.0), (3.0, 42.0), (0.3, 12.0)]
