import numpy as np
import pytest

from helisim import ident
from helisim.base.errors import InputError
from helisim.design.plant import Plant, turned

OMEGA = np.geomspace(1.0, 40.0, 60)
TRUE = {"N_r": -1.2, "N_ped": 40.0, "tau_r_base": 0.05}


@pytest.fixture(scope="module")
def yaw():
    """A fit to an exact yaw response whose rate is recorded 40 ms late."""
    response = 40.0 / (1j * OMEGA + 1.2) * np.exp(-0.05j * OMEGA)
    exact = ident.FrequencyResponse.exact(
        OMEGA, response[None, None], inputs=["ped"], outputs=["r"]
    )
    return ident.identify(exact, ident.structures.yaw_base)


def test_what_is_recorded_late_is_sensed_at_once_and_late_by_the_gyro(yaw):
    """The closed form of what is left: a lag, 50 - 40 ms, and the gyro's 4 ms on the rate."""
    plant = Plant((yaw,), late={"r": 0.04}, latency=0.004)
    rate, heading = plant.response(OMEGA)[:, 0]
    now = 40.0 / (1j * OMEGA + 1.2) * np.exp(-0.01j * OMEGA)
    assert (plant.inputs, plant.outputs) == (("ped",), ("r", "psi"))
    np.testing.assert_allclose(rate, now * np.exp(-0.004j * OMEGA), rtol=1e-6)
    np.testing.assert_allclose(heading, now / (1j * OMEGA), rtol=1e-6)


def test_angles_turn_as_euler_angles_do():
    """Of a rotation matrix turned a little by body rates."""
    from scipy.spatial.transform import Rotation

    phi, theta, step = 0.2, -0.1, 1e-7
    start = Rotation.from_euler("ZYX", [0.3, theta, phi])
    for axis in range(3):
        after = start * Rotation.from_rotvec(step * np.eye(3)[axis])
        psi_, theta_, phi_ = after.as_euler("ZYX") - [0.3, theta, phi]
        # differences of angles of 1e-7 rad lose nine digits of sixteen
        np.testing.assert_allclose(
            turned((phi, theta))[:, axis], np.array([phi_, theta_, psi_]) / step, atol=1e-6
        )


def test_the_first_model_that_tells_a_response_tells_it(yaw):
    other = ident.structures.yaw_base.with_fixed({**TRUE, "N_ped": 10.0})
    exact = yaw.response(OMEGA)
    second = ident.identify(exact, other)
    assert np.array_equal(Plant((yaw, second)).response(OMEGA), Plant((yaw,)).response(OMEGA))


def test_nothing_to_begin_at_is_refused(yaw):
    stick = ident.identify(
        ident.FrequencyResponse.exact(
            OMEGA, yaw.response(OMEGA).response, inputs=["PED"], outputs=["r"]
        ),
        ident.structures.yaw_base.renamed({"ped": "PED"}),
    )
    with pytest.raises(InputError, match=r"servo command \(col, lon, lat, ped\).*PED"):
        Plant((stick,))
