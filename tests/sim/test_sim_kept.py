"""Plans, sticks and short flights of every kind, whole, as reviewed: test_sim_kept.json."""

import pytest
from test_plan import FULL  # noqa: F401  (rows name them)

import helisim as hs
from helisim.sim import FlightPlan, Gust, Multisine, Weather, fly  # noqa: F401  (rows name them)
from helisim.sim.excitation import EXCITATIONS
from helisim.sim.missions import Everyday  # noqa: F401  (rows name them)
from helisim.sim.rigs import run_rigs
from tabled import rows

PARTS = hs.Doublet(axis="lat"), hs.Pulse(axis="ped")
OWN = {
    "History": hs.History.of([0.0, 1.0, 4.0], [0.0, 0.1, 0.0], axis="lat", source="-"),
    **{kind: EXCITATIONS[kind](parts=PARTS) for kind in ("Sequence", "Together")},
}
SHORT = {"Sweep": {"duration": 12.0, "trim_time": 2.0}, "Chirp": {"amplitude": 0.02}}
PLANS = dict(rows(globals(), "PLANS"))


FLIGHTS = PLANS | {
    kind: FlightPlan(
        excitation=OWN.get(kind) or EXCITATIONS[kind](axis="lat", **SHORT.get(kind, {}))
    )
    for kind, one in EXCITATIONS.items()
    if one.__module__ == hs.Sweep.__module__  # not those of tests, nor multisines, which are above
}


@pytest.mark.parametrize("name", sorted(FLIGHTS))
def test_a_flight(name, jr700, kept):
    plan = FLIGHTS[name].on(jr700)
    (record,) = fly(jr700, plan, count=1, seed=3, jobs=1, keep_ended=True)
    values = record.values[:: len(record) // 4].T.tolist()
    told = (record.provenance.get(one) for one in ("ended", "reached"))
    kept([plan.to_dict(), values, list(record.names), *told])


def test_ground_tests(jr700, kept):
    kept([one.to_dict() for one in run_rigs(jr700, seed=2)])
