"""Anyone's helicopter: built in a folder, calibrated, tuned, flown and identified.

Another disc with three blades that turn counter-clockwise, an H3-140 swashplate with its elevator
servo behind and reversed, other servos with more travel: `heron`.
"""

import numpy as np
import pytest

import helisim as hs
import heron
from command import fails
from helisim.cli import main
from helisim.study.experiment import recover


def made(folder, **contents):
    """Build a vehicle, calibrate and tune it by the commands, and return its folder."""
    heron.build(folder, **contents)
    assert main(["calibrate", str(folder), "--write", "--quiet"]) == 0
    assert main(["tune", str(folder), "--write", "--quiet"]) == 0
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The vehicle's folder, as its owner has it in the end."""
    return made(tmp_path_factory.mktemp("hangar") / "heron")


@pytest.fixture(scope="module")
def vehicle(folder):
    return hs.load(folder)


@pytest.mark.slow
def test_it_has_the_derivatives_that_it_was_calibrated_to(vehicle):
    """All thirteen, and a hover with collective and pedals centred."""
    for name, value in heron.TARGETS.items():
        assert vehicle.derivatives[name] == pytest.approx(value, rel=1e-7), name  # the solver's
    trim = vehicle.trim
    assert np.abs([trim.col, trim.ped]).max() < 1e-7
    assert np.abs([trim.lon, trim.lat]).max() < 0.003  # against the tail's torque


@pytest.mark.slow
def test_pedals_and_cyclic_have_their_sense(vehicle):
    """`ped` turns the nose right, `lat` rolls right, `lon` pitches up, whichever way it turns."""
    response = vehicle.linearize("IN2").response(np.array([0.5]))[..., 0]
    system = vehicle.linearize("IN2").system
    for stick, rate, gain in (("PED", "r", 4.0), ("LAT", "p", 6.0), ("LON", "q", 6.0)):
        found = response[system.output_labels.index(rate), system.input_labels.index(stick)]
        # what it was tuned for, half a radian a second above where the hover drifts
        assert found.real == pytest.approx(gain, rel=0.1)


def within_bounds(results, share):
    """Assert that all that was identified is its Cramér-Rao bound or nearer to what flew."""
    rows = [row for table in results.tables for row in table.parameters]
    assert {row.name for row in rows} >= set(heron.TARGETS)
    for row in rows:
        away = 100.0 * abs(row.identified / row.truth - 1.0)
        assert away < share * row.cr_percent, (row.name, away, row.cr_percent)


@pytest.mark.study
def test_what_flew_is_identified(folder):
    """Sweeps on four axes, one flight each: every derivative and delay within its bound."""
    results = recover(folder, flights=1, seed=1)
    # 3 % of the main derivatives, 10 % of couplings and delays; but N_r of one flight is 1 to 6 %
    # high, seed by seed (smaller sweeps don't change that): within its bound of 11 % below
    assert [miss for miss in results.misses if not miss.startswith("yaw_base: N_r ")] == []
    within_bounds(results, 1.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Z_w = ", "#", "[targets] lacks Z_w (1/s); each is { value = NUMBER, unit = "),
        ("N_r = { value = -", "N_r = { value = ", "'targets.N_r' must be negative, got 0.84"),
        ("Z_w = { value = -1.1", "Z_w = { value = -30", "momentum theory allows -2.6 to 0"),
        ("N_r = { value = -0.84", "N_r = { value = -4", "inertia"),
        ("direction = { value = -1.0", "direction = { value = 2", "'main_rotor.direction' must be"),
    ],
)
def test_a_calibration_that_can_not_be_is_one_line(tmp_path, capsys, old, new, message):
    """What was given, what to give; exit status 2, and nothing written."""
    there = heron.build(tmp_path / "wrong")
    file = there / "parameters.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    before = sorted(there.iterdir())
    assert message in fails(capsys, "calibrate", there, "--write", "--quiet")
    assert sorted(there.iterdir()) == before


@pytest.mark.study
@pytest.mark.parametrize("size", [0.415, 2.78])
def test_the_same_at_any_size(tmp_path, size):
    """From 0.3 to 90 kg: what isn't calibrated follows Froude's laws, and sweeps identify it."""
    there = made(tmp_path / "other", size=size)
    other, one = hs.load(there), hs.load(made(tmp_path / "heron"))
    assert other.model.body_subtreemass[1] == pytest.approx(4.2 * size**3)
    # powers of n: forces n^3, lengths n, times n^0.5, so velocities n^0.5
    for name, power in (("Y_v", -0.5), ("Y_ped", 0.0), ("N_v", -1.5), ("P_v", -1.0), ("Q_u", -1.0)):
        scaled = one.derivatives[name] * size**power
        assert other.derivatives[name] == pytest.approx(scaled, rel=1e-5), name
    assert other.power == pytest.approx(one.power * size**3.5, rel=1e-6)
    within_bounds(recover(there, flights=1, seed=1), 1.0)
