"""Blocks by name: each has its closed form, and in series it multiplies the response."""

import numpy as np
import pytest
from scipy.signal import butter, freqs

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import Structure, blocks, identify, in_series
from helisim.ident.evaluate import response
from helisim.ident.structures import heave_inflow, hover_imu, rollpitch, yaw_base
from ident_data import data

GRID = np.geomspace(0.5, 80.0, 25)
S = 1j * GRID
SERVO = blocks.second_order("servo", omega=(60.0, 1.0), zeta=(0.7, 0.01))
SERVO_RESPONSE = 3600.0 / (S**2 + 84.0 * S + 3600.0)


def alone(block):
    return response(block, block.starts, GRID)[0, 0]


def test_blocks_have_their_closed_forms():
    """The lag, the servo and the delay as written; scipy's Butterworth filters of each order."""
    assert alone(SERVO) == pytest.approx(SERVO_RESPONSE, rel=1e-12)
    assert alone(blocks.first_order(tau=0.1)) == pytest.approx(1.0 / (1.0 + 0.1 * S), rel=1e-12)
    assert alone(blocks.delay(tau=0.03)) == pytest.approx(np.exp(-0.03 * S), rel=1e-12)
    for order in range(1, 9):
        expected = freqs(*butter(order, 40.0, analog=True), GRID)[1]
        # eight poles one after the other, the response down to 1e-3 of itself
        assert alone(blocks.low_pass(corner=40.0, order=order)) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("plant", [rollpitch, hover_imu, heave_inflow], ids=lambda one: one.name)
def test_series_multiply_the_response(plant):
    """An input's block multiplies its column, an output's its row."""
    rng = np.random.default_rng(4)
    values = {one.name: one.start or 0.1 * rng.normal() for one in plant.parameters}
    inner = response(plant, values, GRID)
    lag, late = blocks.first_order(tau=0.1), blocks.delay(tau=0.02)
    first, last = plant.inputs[0], plant.inputs[-1]
    ends = {plant.outputs[0]: blocks.low_pass(corner=40.0, order=3), plant.outputs[-1]: late}
    made = in_series(plant, inputs={first: SERVO, last: lag}, outputs=ends)
    expected = inner.copy()
    expected[:, plant.inputs.index(last)] *= alone(lag)
    if first != last:
        expected[:, 0] *= SERVO_RESPONSE
    expected[0] *= alone(blocks.low_pass(corner=40.0, order=3))
    expected[-1] *= alone(late)
    found = response(made, {**made.starts, **values}, GRID)
    # a few dozen operations, of states that differ by 1e4
    assert np.abs(found / expected - 1.0) == pytest.approx(0.0, abs=1e-10)


def test_one_servo_for_two_inputs_has_one_natural_frequency():
    """Blocks of one name share their parameters; two of one name that differ are refused."""
    made = in_series(rollpitch, inputs={"lat": SERVO, "lon": SERVO})
    assert made.names == (*rollpitch.names, "servo_omega", "servo_zeta")
    assert len(made.states) == len(rollpitch.states) + 4
    assert made.parameter("servo_omega").error == 1.0
    other = blocks.second_order("servo", omega=50.0, zeta=0.7)
    with pytest.raises(InputError, match=r"'servo_omega': 50 rad/s of the block 'servo' and 60"):
        in_series(rollpitch, inputs={"lat": SERVO, "lon": other})
    again = Structure.from_dict(made.to_dict())
    assert again == made


def test_a_known_servo_is_taken_out_and_its_error_carried_through():
    """A first order behind a servo is found exactly, with more error than a servo without any."""
    exact = 50.0 / (S + 0.7) * np.exp(-0.03 * S) * SERVO_RESPONSE
    frf = data(exact, GRID, inputs=("ped",), outputs=("r",))
    found = identify(frf, in_series(yaw_base, inputs={"ped": SERVO}), band=(0.5, 12.0))
    expected = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.03}
    assert {name: found.values[name] for name in expected} == pytest.approx(expected, rel=1e-6)
    # far below it a servo is the delay 2 zeta / omega; the band goes to a fifth of omega
    delay = 2.0 * 0.7 / 60.0 * np.hypot(1.0 / 60.0, 0.01 / 0.7)
    assert found["tau_r_base"].standard_error == pytest.approx(delay, rel=0.1)


def test_blocks_are_read_from_words():
    """Numbers with and without errors; what is left out is free; two signals share one."""
    made = blocks.with_blocks(
        rollpitch,
        {"lat,lon": "second_order:omega=62+-1,zeta=0.7", "p": "low_pass:corner=40,order=4"},
    )
    assert made.parameter("lat_lon_omega").error == 1.0
    assert made.parameter("lat_lon_zeta").start == 0.7
    assert made.parameter("lat_lon_zeta").fixed
    assert made.parameter("p_corner").start == 40.0
    free = blocks.with_blocks(rollpitch, {"p": "first_order:name=servo"})
    assert not free.parameter("servo_tau").fixed
    for words, error, what in (
        ("third_order:omega=3", UnknownNameError, "third_order"),
        ("first_order:omega=3", UnknownNameError, "'omega'"),
        ("first_order:tau=fast", InputError, r"tau = 'fast' of the block .* isn't a number"),
        (
            "low_pass:corner=3,order=12",
            InputError,
            "order of the low-pass .* at most 8, got 12",
        ),
        ("first_order:tau=1+-2+-3", InputError, "lat_tau must be a list of 2 numbers"),
    ):
        with pytest.raises(error, match=what):
            blocks.with_blocks(rollpitch, {"lat": words})
    with pytest.raises(UnknownNameError, match="'pad'"):
        blocks.with_blocks(rollpitch, {"pad": "first_order:tau=1"})
    with pytest.raises(InputError, match="lat has two blocks"):
        blocks.with_blocks(rollpitch, {"lat": "first_order", "lat,lon": "delay"})


def test_what_cannot_be_in_series_is_refused():
    """A block of two inputs, and an input that isn't there."""
    with pytest.raises(InputError, match="has 2 inputs and 2 outputs"):
        in_series(rollpitch, inputs={"lat": rollpitch})
    with pytest.raises(UnknownNameError, match="input of 'rollpitch' 'col'"):
        in_series(rollpitch, inputs={"col": SERVO})


def test_a_file_has_its_blocks_in_a_table(tmp_path):
    """[series] of a structure's file is `with_blocks`; what it wrote reads back as it is."""
    path = tmp_path / "yaw.toml"
    path.write_text(
        yaw_base.to_toml() + '\n[series]\nped = "second_order:omega=60+-1,zeta=0.7,name=servo"\n'
    )
    found = Structure.from_toml(path)
    assert found.parameter("servo_omega").error == 1.0
    assert found.states == ("r", "ped_servo_x0", "ped_servo_x1")
    found.to_toml(path)
    assert Structure.from_toml(path) == found
    path.write_text(yaw_base.to_toml() + "\n[series]\nped = 3\n")
    with pytest.raises(InputError, match=r"series.ped must be text, got 3"):
        Structure.from_toml(path)
