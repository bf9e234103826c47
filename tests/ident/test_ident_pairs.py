"""Delays of single responses, and outputs that follow an input's rate."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident import Fit, FrequencyResponse, Structure, identify, reduce, verify
from helisim.ident.evaluate import delayed, response, response_and_slope, state_space
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

GRID = np.geomspace(0.4, 30.0, 40)
STEP = 0.01
TRUE = {"Z_w": -0.7, "Z_col": -40.0, "K": -0.6, "N": 3.0, "N_r": -2.0, "wait": 0.05, "more": 0.04}


def collective(**change):
    """Heave acceleration, improper by the blades' coning, and yaw over collective."""
    data = {
        "name": "collective",
        "parameters": {
            "Z_w": {"unit": "1/s", "start": -1.0},
            "Z_col": {"unit": "m/s^2", "start": -10.0},
            "K": {"unit": "m/s", "start": 0.0, "scale": 0.3},
            "N": {"unit": "1/s^2", "start": 1.0},
            "N_r": {"unit": "1/s", "start": -1.0},
            "wait": {"unit": "s", "start": 0.02, "bounds": [-0.3, 0.3]},
            "more": {"unit": "s", "start": 0.0, "bounds": [-0.3, 0.3], "scale": 0.03},
        },
        "states": ["w", "r"],
        "inputs": ["col", "ped"],
        "outputs": ["az", "r"],
        "F": {"w": {"w": "Z_w"}, "r": {"r": "N_r"}},
        "G": {"w": {"col": "Z_col"}, "r": {"col": "N", "ped": "9"}},
        "H0": {"r": {"r": 1}},
        "H1": {"az": {"w": 1}},
        "D1": {"az": {"col": "K"}},
        "input_delays": {"col": "wait"},
        "delays": {"r/col": "more"},
    }
    return Structure.from_dict({**data, **change})


def by_hand(s, k):
    """Return az/col, r/col and r/ped for TRUE."""
    late = np.exp(-k["wait"] * s)
    return (
        (s * k["Z_col"] / (s - k["Z_w"]) + k["K"] * s) * late,
        k["N"] / (s - k["N_r"]) * late * np.exp(-k["more"] * s),
        9.0 / (s - k["N_r"]),
    )


@pytest.fixture(scope="module")
def fit():
    structure = collective()
    data = FrequencyResponse.exact(
        GRID, response(structure, TRUE, GRID), inputs=structure.inputs, outputs=structure.outputs
    )
    return identify(data, structure, responses=("az/col", "r/col", "r/ped"))


def test_a_response_has_its_own_delay_beside_its_inputs():
    """The transfer functions are those that one writes by hand; r/ped waits for nothing."""
    found = response(collective(), TRUE, GRID)
    az_col, r_col, r_ped = by_hand(1j * GRID, TRUE)
    np.testing.assert_allclose(found[0, 0], az_col, rtol=1e-13)
    np.testing.assert_allclose(found[1, 0], r_col, rtol=1e-13)
    np.testing.assert_allclose(found[1, 1], r_ped, rtol=1e-13)


def test_derivatives_by_a_responses_delay_and_by_d1_are_exact():
    """Against central differences, whose truncation is below 1e-9 of the response."""
    structure = collective()
    _, slope = response_and_slope(structure, TRUE, GRID)
    for k, name in enumerate(structure.names):
        up = response(structure, {**TRUE, name: TRUE[name] + 1e-6}, GRID)
        down = response(structure, {**TRUE, name: TRUE[name] - 1e-6}, GRID)
        np.testing.assert_allclose(slope[k], (up - down) / 2e-6, rtol=1e-6, atol=1e-6)


def test_a_fit_finds_them_and_survives_json(fit):
    """From an exact response every parameter; the file says which response waits how long."""
    assert fit.values == pytest.approx(TRUE, rel=1e-6)
    assert fit.delays == pytest.approx({"col": 0.05, "ped": 0, "az": 0, "r": 0, "r/col": 0.04})
    again = Fit.from_dict(json.loads(json.dumps(fit.to_dict())))
    assert again.structure == fit.structure
    np.testing.assert_array_equal(again.response(GRID).response, fit.response(GRID).response)


def test_they_survive_toml_and_other_names(tmp_path):
    """A table by response, moved with its signals; what has neither is written without them."""
    structure = collective()
    structure.to_toml(tmp_path / "mine.toml")
    again = Structure.from_toml(tmp_path / "mine.toml")
    assert again == structure
    moved = structure.renamed({"r": "yaw", "col": "COL"})
    assert dict(moved.delays) == {"yaw/COL": "more"}
    plain = collective(D1={}, delays={})
    assert not {"D1", "delays"} & set(plain.to_dict())
    assert not plain.improper


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"delays": {"r/lat": "more"}}, UnknownNameError, "response with a delay.*az/col, az/ped"),
        ({"delays": {"r": "more"}}, UnknownNameError, "response with a delay"),
        ({"delays": {"r/col": "mor"}}, UnknownNameError, "'mor'; available"),
        ({"delays": {"r/col": []}}, InputError, r"delays.r/col must be text or a number"),
        ({"D1": {"az": {"lat": "K"}}}, UnknownNameError, "column of D1.az"),
        ({"D1": [["K"]]}, InputError, "D1 has 1 rows"),
    ],
)
def test_mistakes_in_them_are_named(change, error, message):
    """One line: what is wrong and what there is."""
    with pytest.raises(error, match=message):
        collective(**change)


def test_a_signal_with_them_in_code_is_checked_too():
    """Not only what a file says."""
    with pytest.raises(UnknownNameError, match="response with a delay 'r/lat'"):
        replace(collective(), delays={"r/lat": "more"})


def test_an_improper_model_has_no_state_space_and_says_what_it_has(fit):
    """For python-control; the message names the ways that there are."""
    with pytest.raises(IdentificationError, match=r"improper.*proper_part"):
        state_space(fit.structure, TRUE)
    with pytest.raises(IdentificationError, match="improper"):
        _ = fit.model


def test_matlab_gets_an_improper_model_as_a_descriptor(fit, tmp_path):
    """C (s E - A)^-1 B + D with its delays is the model, computed from what the file holds."""
    fit.to_matlab(tmp_path / "model.mat")
    m = loadmat(tmp_path / "model.mat")
    s = 1j * GRID[:, None, None]
    plain = m["C"] @ np.linalg.solve(s * m["E"] - m["A"], m["B"] + 0j * s) + m["D"]
    lag = m["OutputDelay"] + m["InputDelay"].T + m["IODelay"]
    expected = fit.response(GRID).response.transpose(2, 0, 1)
    np.testing.assert_allclose(plain * np.exp(-s * lag), expected, rtol=1e-9, atol=1e-12)
    assert [str(cell[0][0]) for cell in m["StateName"]] == ["w", "r", "col", "d(col)/dt"]


def smooth(time):
    """Return an input that starts and ends at rest, and its rate."""
    x = np.clip((time - 1.0) / 4.0, 0.0, 1.0)
    return (x * (1 - x)) ** 4 * 256, 1024 * (x * (1 - x)) ** 3 * (1 - 2 * x) / 4.0


def motion(time):
    """Return az and r of TRUE in `smooth` collective, integrated by hand at a fine step."""
    fine = np.arange(0.0, time[-1] + 1e-9, STEP / 20)

    def first_order(pole, u):
        """Return x of dx/dt = pole x + u by the trapezium rule, 4e-7 of the result off."""
        h, x = STEP / 20, np.zeros(fine.size)
        for k in range(1, fine.size):
            x[k] = ((1 + pole * h / 2) * x[k - 1] + h / 2 * (u[k] + u[k - 1])) / (1 - pole * h / 2)
        return x

    u, rate = smooth(fine - TRUE["wait"])
    w = first_order(TRUE["Z_w"], TRUE["Z_col"] * u)
    az = TRUE["Z_w"] * w + TRUE["Z_col"] * u + TRUE["K"] * rate
    later = smooth(fine - TRUE["wait"] - TRUE["more"])[0]
    r = first_order(TRUE["N_r"], TRUE["N"] * later)
    return np.stack([az, r], axis=1)[::20]


def test_time_histories_have_them(fit):
    """A record made by hand is predicted: by 1e-4, what the samples' corners leave of the input."""
    time = np.arange(0.0, 8.0, STEP)
    u, outputs = smooth(time)[0], motion(time)
    names = ("col", "ped", "az", "r")
    columns = np.column_stack([u, 0.0 * u, outputs])
    record = FlightRecord(time, columns, tuple(channel(name) for name in names))
    assert verify(fit, record).tic < 1e-4


@pytest.mark.parametrize("lag", [0.03, 0.0344, -0.0271])
def test_an_inputs_rate_is_of_second_order_in_the_step(lag):
    """Half the step leaves a quarter of the error, whatever part of a sample the delay is."""
    error = []
    model = replace(collective(), H0=(("0", "0"),) * 2, H1=(("0", "0"),) * 2, D1=((0, 0),) * 2)
    for step in (0.02, 0.01):
        time = np.arange(0.0, 8.0, step)
        u = np.column_stack([smooth(time)[0], 0.0 * time])
        d1 = np.array([[1.0, 0.0], [0.0, 0.0]])
        lags = np.full((2, 2), lag)
        got = delayed(state_space(model, TRUE), u, step, lags, d1)[:, 0]
        error.append(np.max(np.abs(got - smooth(time - lag)[1])))
    assert error[1] < 0.35 * error[0]
    assert error[1] < 1e-3


def test_a_responses_delay_is_not_dropped_unless_delays_may_be(fit):
    """As an input's; K, which the exact response has none of, goes."""
    structure = collective()
    none = response(structure, {**TRUE, "K": 0.0, "more": 0.0}, GRID)
    data = FrequencyResponse.exact(GRID, none, inputs=structure.inputs, outputs=structure.outputs)
    smaller = reduce(data, structure, responses=("az/col", "r/col", "r/ped"), searches=2)
    assert smaller.dropped == ("K",)
    assert smaller.protected == ("more",)
