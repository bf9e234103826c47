"""Blade inertia or time constant: one is given, the other follows, also in other air."""

import re
import tomllib

import numpy as np
import pytest

import helisim as hs
import heron
from command import fails
from helisim.base.errors import ModelError
from helisim.cli import main
from helisim.study.paper import published
from helisim.vehicle.swashplate import FLAPPING, Flapping, TipPathPlane

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


def test_a_blade_one_can_buy_is_within_the_papers_bound(jr700):
    """NHP's carbon blade: 557 mm from bolt to tip and about 100 g, as measured at Delft.

    https://ii.tudelft.nl/~wouter/helipage/docs/blades/blades.html. Grown in all directions to the
    690 mm of this rotor, and as heavy everywhere along its length.
    """
    length, radius = 0.690, jr700.parameters["main_rotor.radius"]
    mass = 0.100 * (length / 0.557) ** 3
    root = radius - length
    inertia = mass * (radius**3 - root**3) / (3.0 * length)
    assert inertia == pytest.approx(0.0414, abs=5e-5)
    bought = hs.load("jr700", parameters={INERTIA: inertia})
    printed = published("jr700")["rollpitch_in1"]["tau_f"]
    off = 100.0 * (1.0 - bought.parameters["flapping.tau_f"] / printed.value)
    assert off == pytest.approx(21.3, abs=0.1)
    assert off < printed.cr_percent


def test_a_heavier_blade_follows_more_slowly(jr700):
    """Twice the inertia: half the Lock number; springs as stiff beside the air as before."""
    heavy = hs.load("jr700", parameters={INERTIA: 2.0 * jr700.parameters[INERTIA]})
    before, after = TipPathPlane.of(jr700.parameters), TipPathPlane.of(heavy.parameters)
    assert after.share == pytest.approx(0.5 * before.share, rel=1e-12)
    # of springs that are not the same all around eq. (8) holds the mean
    stiffness = [disc.springs[1, 0] - disc.springs[0, 1] for disc in (before, after)]
    assert stiffness[1] == pytest.approx(stiffness[0], rel=1e-11)
    assert after.cyclic == pytest.approx(before.cyclic, rel=1e-12)
    assert heavy.derivatives["tau_f"] == pytest.approx(heavy.parameters["flapping.tau_f"], rel=1e-8)


@pytest.mark.parametrize("name", ["air.density", "main_rotor.speed", "main_rotor.chord"])
def test_what_the_air_does_changes_and_the_blade_stays(jr700, name):
    """Of another density, speed or chord [flapping] is another, blade and swashplate the same."""
    other = hs.load("jr700", parameters={name: 0.95 * jr700.parameters[name]})
    own, before = other.parameters, jr700.parameters
    assert own[INERTIA] == pytest.approx(before[INERTIA], rel=1e-12)
    assert own["flapping.tau_f"] > before["flapping.tau_f"]
    assert TipPathPlane.of(own).cyclic == pytest.approx(TipPathPlane.of(before).cyclic, rel=1e-12)
    assert lock_number(own) / lock_number(before) == pytest.approx(
        TipPathPlane.of(own).share / TipPathPlane.of(before).share, rel=1e-12
    )


def test_a_time_constant_that_is_set_stands(jr700):
    """Beside a density too, and the blade that has it follows."""
    other = hs.load("jr700", parameters={"flapping.tau_f": 0.03, "air.density": 1.1})
    assert other.parameters["flapping.tau_f"] == 0.03
    assert other.derivatives["tau_f"] == pytest.approx(0.03, rel=1e-8)
    assert other.parameters[INERTIA] < jr700.parameters[INERTIA]


def test_all_parameters_of_a_vehicle_load_it_again(jr700):
    """As provenance keeps them: also where density and flapping are not the folder's."""
    thin = hs.load("jr700", parameters={"air.density": 1.0})
    again = hs.load("jr700", parameters=dict(thin.parameters))
    assert np.array_equal(again.model.actuator_user, thin.model.actuator_user)


def test_both_that_contradict_are_one_line(jr700):
    """The inertia, the time constant, what it would be, and what to do."""
    wrong = {INERTIA: 0.02, "flapping.tau_f": 0.04456}
    with pytest.raises(ModelError) as raised:
        hs.load("jr700", parameters=wrong)
    assert re.fullmatch(
        r"main_rotor.blade_inertia = 0.02 kg m\^2 and flapping.tau_f = 0.04456 s contradict: with "
        r"this time constant it is 0.05\d+ kg m\^2; give one of both",
        str(raised.value),
    )


def heavy_heron(folder, inertia=0.0115):
    """Make a vehicle whose author gives the blades' inertia and no time constant."""
    there = heron.build(folder)
    file = there / "parameters.toml"
    text = re.sub(r"(?m)^tau_f = .*\n", "", file.read_text())
    line = f'blade_inertia = {{ value = {inertia}, unit = "kg m^2", source = "swung" }}\n'
    file.write_text(text.replace("[main_rotor]\n", "[main_rotor]\n" + line))
    return there


@pytest.mark.slow
def test_a_folder_may_give_the_inertia(tmp_path, capsys):
    """Calibrated without a tau_f, the vehicle flies with that of its blades."""
    there = heavy_heron(tmp_path / "swung")
    assert main(["calibrate", str(there), "--write", "--quiet"]) == 0
    assert main(["tune", str(there), "--write", "--quiet"]) == 0
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
    said = fails(capsys, "calibrate", there, "--quiet")
    assert "main_rotor.blade_inertia and the target tau_f both say how fast" in said


def test_the_calibration_says_what_blade_it_is(capsys):
    """The head of calibrated.toml: inertia, Lock number, and what inflow leaves of it."""
    assert main(["calibrate", "jr700", "--quiet"]) == 0
    said = " ".join(capsys.readouterr().out.split("[flapping]")[0].replace("#", "").split())
    assert "a flapping inertia of 0.0521 kg m^2, as 0.266 kg spread evenly over 0.767 m" in said
    assert "a Lock number gamma of 3.18. Inflow that follows its flapping leaves 1.91" in said


def test_the_section_is_read_whole(jr700):
    """Seven numbers there and back."""
    section = Flapping.of(jr700.parameters).to_parameters()
    assert list(section) == [f"flapping.{name}" for name in FLAPPING]
    assert all(jr700.parameters[name] == value for name, value in section.items())
