"""Recovery in closed loop: feedback and a gust bias the direct estimate, not the joint one."""

import numpy as np
import pytest
from plants import ROLLPITCH_IN1, fly_closed_loop

from helisim.ident import frequency_response, identify, structures
from helisim.ident.evaluate import response

CYCLIC = {"inputs": ("lat", "lon"), "outputs": ("p", "q"), "band": (3.0, 35.0)}


@pytest.mark.study
@pytest.mark.filterwarnings("ignore::helisim.ident.ClosedLoopWarning")
def test_joint_response_is_closer_in_roll_and_pitch():
    """Where a gust and feedback drive the cyclic, the joint response is nearer to the truth."""
    values = {**ROLLPITCH_IN1, "tau_lat": 0.0, "tau_lon": 0.0}
    flights = [
        fly_closed_loop(
            structures.rollpitch,
            values,
            axis=axis,
            sticks=("LAT", "LON"),
            gain=0.1,
            gust=3.0,
            seed=seed,
            noise={"p": 0.01, "q": 0.01},
        )
        for seed, axis in enumerate(("lat", "lat", "lon", "lon"))
    ]
    direct = frequency_response(flights, **CYCLIC)
    joint = frequency_response(flights, **CYCLIC, reference=("LAT", "LON"))
    truth = response(structures.rollpitch, values, direct.frequency)
    low = direct.frequency < 6.0
    for k in range(2):  # p/lat and q/lon, below the band where the sweep outweighs the gust
        wrong = np.mean(np.abs(direct.response / truth - 1.0)[k, k, low])
        right = np.mean(np.abs(joint.response / truth - 1.0)[k, k, low])
        assert right < 0.7 * wrong
    fit = identify(joint, structures.rollpitch, frequencies_per_response=40)
    assert fit.to_dict()["method"] == "joint input-output"
    for name in ("L_b", "M_a", "A_lon", "B_lat", "tau_f"):
        assert fit[name].value == pytest.approx(values[name], rel=0.06)
