"""Recovery in closed loop: feedback and a gust bias the direct estimate, not the joint one."""

import numpy as np
import pytest
from plants import ROLLPITCH_IN1, fly_closed_loop

from helisim.ident import frequency_response, identify, structures
from helisim.ident.evaluate import response

BAND = (0.8, 20.0)
YAW = {"N_r": -0.75, "N_ped": 76.0, "tau_r_base": 0.0}
CYCLIC = {"inputs": ("lat", "lon"), "outputs": ("p", "q"), "band": (3.0, 35.0)}


def yaw_estimate(seed, **options):
    flights = [
        fly_closed_loop(
            structures.yaw_base,
            YAW,
            axis="ped",
            sticks=("PED",),
            gain=0.05,
            gust=0.5,
            seed=10 * seed + number,
            noise={"r": 0.01},
            band=(0.5, 25.0),
            amplitude=0.02,
        )
        for number in range(4)
    ]
    frf = frequency_response(flights, inputs="ped", outputs="r", band=BAND, **options)
    return identify(frf, structures.yaw_base, frequencies_per_response=40)["N_r"].value


@pytest.mark.study
@pytest.mark.filterwarnings("ignore::helisim.ident.ClosedLoopWarning")
def test_joint_beats_direct_in_yaw():
    """A gust under rate feedback biases N_r of the direct estimate, not the joint one's."""
    direct = np.array([yaw_estimate(seed) for seed in range(6)]) / YAW["N_r"] - 1.0
    joint = np.array([yaw_estimate(seed, reference="PED") for seed in range(6)])
    joint = joint / YAW["N_r"] - 1.0
    # Measured over 30 seeds: -27 % with a scatter of 17 %, so the mean of six scatters by 7 %.
    assert np.mean(direct) < -0.1
    # The joint estimates scatter by 9 % in this gust, so their mean of six by 4 %.
    assert abs(np.mean(joint)) < 0.1
    assert np.mean(np.abs(joint)) < 0.6 * np.mean(np.abs(direct))


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
