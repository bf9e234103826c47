"""Anyone's helicopter: built in a folder, calibrated, tuned, flown and identified.

Another disc with three blades that turn counter-clockwise, an H3-140 swashplate with its elevator
servo behind and reversed, other servos with more travel: `heron`.
"""

import re
import shutil
import tomllib

import numpy as np
import pytest

import helisim as hs
import heron
from command import fails
from helisim.base.errors import InputError
from helisim.cli import main
from helisim.study.experiment import recover
from helisim.study.new_vehicle import calibrated_text
from helisim.study.paper import published
from helisim.vehicle import calibrate, read_parameters, standard_parameters
from helisim.vehicle.calibrate import DIRECT, SOLVED, flapping_of, is_known, settled
from helisim.vehicle.parameters import model_folder
from helisim.vehicle.swashplate import TipPathPlane
from tabled import tabled


def made(folder, **contents):
    heron.build(folder, **contents)
    assert main(["vehicle", "calibrate", str(folder), "--write", "--quiet"]) == 0
    assert main(["tune", "--vehicle", str(folder), "--write", "--quiet"]) == 0
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return made(tmp_path_factory.mktemp("hangar") / "heron")


@pytest.fixture(scope="module")
def vehicle(folder):
    return hs.load(folder)


@pytest.mark.slow
def test_it_has_the_derivatives_that_it_was_calibrated_to_and_sticks_their_sense(vehicle):
    for name, value in heron.TARGETS.items():
        assert vehicle.derivatives[name] == pytest.approx(value, rel=1e-7), name  # the solver's
    trim = vehicle.trim
    assert np.abs([trim.col, trim.ped]).max() < 1e-7
    assert np.abs([trim.lon, trim.lat]).max() < 0.003  # against the tail's torque
    response = vehicle.linearize("IN2").response(np.array([1.5]))[..., 0]
    system = vehicle.linearize("IN2").system
    for stick, rate, gain in (("PED", "r", 4.0), ("LAT", "p", 6.0), ("LON", "q", 6.0)):
        found = response[system.output_labels.index(rate), system.input_labels.index(stick)]
        # what it was tuned for, above where the hover drifts, at 0.6 rad/s
        assert found.real == pytest.approx(gain, rel=0.1)


def within_bounds(results, share):
    rows = [row for table in results.tables for row in table.parameters]
    assert {row.name for row in rows} >= set(heron.TARGETS)
    for row in rows:
        away = 100.0 * abs(row.identified / row.truth - 1.0)
        assert away < share * row.cr_percent, (row.name, away, row.cr_percent)


@pytest.mark.study
def test_what_flew_is_identified(folder):
    results = recover(folder, flights=1, seed=1)
    # 3 % of the main derivatives, 10 % of couplings and delays; but N_r of one flight is 1 to 6 %
    # high, seed by seed (smaller sweeps don't change that): within its bound of 11 % below
    assert [miss for miss in results.misses if not miss.startswith("yaw_base: N_r ")] == []
    within_bounds(results, 1.0)


@tabled("old", "new", "message")
def test_a_calibration_that_can_not_be_is_one_line(tmp_path, capsys, old, new, message):
    there = heron.build(tmp_path / "wrong")
    file = there / "parameters.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    before = sorted(there.iterdir())
    assert message in fails(capsys, "vehicle", "calibrate", there, "--write", "--quiet")
    assert sorted(there.iterdir()) == before


INERTIA = "main_rotor.blade_inertia"


def lock_number(parameters):
    """Return rho a c R^4 / I of a blade."""
    size = parameters["main_rotor.chord"] * parameters["main_rotor.radius"] ** 4
    air = parameters["air.density"] * parameters["main_rotor.lift_slope"]
    return air * size / parameters[INERTIA]


def test_the_papers_time_constant_is_a_blade(jr700):
    """Lock number 3.18 before inflow that follows, 1.91 after it: of eq. (8)'s three numbers."""
    own = jr700.parameters
    felt = 16.0 * TipPathPlane.of(own).share
    assert lock_number(own) == pytest.approx(felt * own["flapping.lock_reduction"], rel=1e-12)
    # 1 + a sigma / (16 lambda), lambda of a hover of 8.01 kg
    tip = own["main_rotor.speed"] * own["main_rotor.radius"]
    disc = np.pi * own["main_rotor.radius"] ** 2
    inflow = np.sqrt(8.01 * 9.8015 / (2.0 * own["air.density"] * disc)) / tip
    solidity = 2.0 * own["main_rotor.chord"] / (np.pi * own["main_rotor.radius"])
    reduction = 1.0 + own["main_rotor.lift_slope"] * solidity / (16.0 * inflow)
    assert own["flapping.lock_reduction"] == pytest.approx(reduction, rel=1e-3)  # tilt of the hover
    assert own[INERTIA] == pytest.approx(0.0521, abs=5e-5)


@pytest.mark.parametrize("name", ["air.density", "main_rotor.speed", "main_rotor.chord"])
def test_what_the_air_does_changes_and_the_blade_stays(jr700, name):
    other = hs.load("jr700", parameters={name: 0.95 * jr700.parameters[name]})
    own, before = other.parameters, jr700.parameters
    assert own[INERTIA] == pytest.approx(before[INERTIA], rel=1e-12)
    assert own["flapping.tau_f"] > before["flapping.tau_f"]
    assert TipPathPlane.of(own).cyclic == pytest.approx(TipPathPlane.of(before).cyclic, rel=1e-12)
    assert lock_number(own) / lock_number(before) == pytest.approx(
        TipPathPlane.of(own).share / TipPathPlane.of(before).share, rel=1e-12
    )


def test_all_parameters_of_a_vehicle_load_it_again(jr700):
    thin = hs.load("jr700", parameters={"air.density": 1.0})
    again = hs.load("jr700", parameters=dict(thin.parameters))
    assert np.array_equal(again.model.actuator_user, thin.model.actuator_user)


def heavy_heron(folder, inertia=0.0115):
    there = heron.build(folder)
    file = there / "parameters.toml"
    text = re.sub(r"(?m)^tau_f = .*\n", "", file.read_text())
    line = f'blade_inertia = {{ value = {inertia}, unit = "kg m^2", source = "swung" }}\n'
    file.write_text(text.replace("[main_rotor]\n", "[main_rotor]\n" + line))
    return there


@pytest.mark.slow
def test_a_folder_may_give_the_inertia(folder, tmp_path):
    there = heavy_heron(tmp_path / "swung")
    shutil.copy(folder / "tuned.toml", there)  # of blades that are all but the same
    assert main(["vehicle", "calibrate", str(there), "--write", "--quiet"]) == 0
    solved = tomllib.loads((there / "calibrated.toml").read_text())
    assert "tau_f" not in solved["flapping"]
    vehicle = hs.load(there)
    own = vehicle.parameters
    assert own[INERTIA] == pytest.approx(0.0115, rel=1e-14)  # rounding
    assert own["flapping.tau_f"] == pytest.approx(vehicle.derivatives["tau_f"], rel=1e-8)
    assert 16.0 * TipPathPlane.of(own).share == pytest.approx(
        lock_number(own) / own["flapping.lock_reduction"], rel=1e-12
    )
    assert main(["vehicle", "check", str(there)]) == 0
    new = hs.new_vehicle("egret", like=there, to=tmp_path)
    assert hs.load(new).parameters[INERTIA] == own[INERTIA]


def test_a_target_beside_the_inertia_is_refused(tmp_path, capsys):
    there = heavy_heron(tmp_path / "both")
    file = there / "parameters.toml"
    line = 'tau_f = { value = 0.04, unit = "s", source = "flown" }\n'
    file.write_text(file.read_text().replace("[targets]\n", "[targets]\n" + line))
    said = fails(capsys, "vehicle", "calibrate", there, "--quiet")
    assert "main_rotor.blade_inertia and the target tau_f both say how fast" in said


FOLDER = model_folder("jr700")
PAPERS = {
    item.name: item.value
    for name in ("yaw_base", "rollpitch_in1", "heave")
    for item in published("jr700")[name]
    if item.name in DIRECT + SOLVED
}


@pytest.mark.slow
def test_calibrated_file_is_what_calibrate_writes():
    given = read_parameters(FOLDER / "parameters.toml", FOLDER / "tuned.toml")
    stored = read_parameters(FOLDER / "calibrated.toml")
    tried = []
    solved = calibrate("jr700", given, PAPERS, "paper", on_progress=tried.append)
    assert set(tried) == {"jr700"}
    assert list(solved) == list(stored)
    for name in stored:
        # the solver stops at 1e-8 of each condition; conditions are well scaled
        assert solved[name] == pytest.approx(stored[name], rel=1e-6)
        assert solved.entry(name).unit == stored.entry(name).unit


@pytest.mark.parametrize("value", [None, float("nan")])
def test_missing_target_is_named(value):
    given = read_parameters(FOLDER / "parameters.toml")
    targets = {key: item for key, item in PAPERS.items() if key != "N_r"}
    if value is not None:
        targets["N_r"] = value
    with pytest.raises(InputError, match="N_r"):
        calibrate("jr700", given, targets, "test")


LYNX = model_folder("lynx")


@pytest.fixture(scope="module")
def given():
    return read_parameters(LYNX / "parameters.toml")


def test_the_disc_of_a_spring_at_the_centre_is_the_books(given):
    """Padfield's closed form: S = 8 (nu^2 - 1) / gamma; per cyclic 1 / (1 + S^2) and S / (1 + S^2).

    In eq. (8) the steady tilt is inv([[1, -A_b], [-B_a, 1]]) times the cyclic's.
    """
    assert is_known(given)
    assert not is_known(standard_parameters("jr700"))
    found = flapping_of(given)
    inertia, speed = 678.14, 35.63
    lock = 1.225 * 6.0 * 0.391 * 6.4**4 / inertia
    stiffness = 8.0 * 166352.0 / (inertia * speed**2) / lock
    back = (found.a_lon + found.a_b * found.b_lon) / (1.0 - found.a_b * found.b_a)
    right = (found.b_lon + found.b_a * found.a_lon) / (1.0 - found.a_b * found.b_a)
    assert back == pytest.approx(0.35 / (1.0 + stiffness**2), rel=1e-9)
    # blades turn counter-clockwise: back cyclic tilts left, too
    assert right == pytest.approx(-0.35 * stiffness / (1.0 + stiffness**2), rel=1e-9)


def test_the_calibrated_file_is_what_calibrate_writes():
    stored = read_parameters(LYNX / "calibrated.toml")
    solved = settled("lynx", read_parameters(LYNX / "parameters.toml", LYNX / "tuned.toml"))
    assert dict(solved) == pytest.approx(dict(stored), rel=1e-9)
    assert calibrated_text("lynx") == (LYNX / "calibrated.toml").read_text()
