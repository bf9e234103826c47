"""Identified models as ArduPilot's state-space helicopter: its file, its equations, its limits."""

import json
from dataclasses import replace

import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident import blocks, in_series, structures
from helisim.ident.ardupilot import ArduPilotModel, numbers_of
from helisim.ident.evaluate import delayed, linear
from helisim.study.paper import published
from ident_data import HEAVE, fitted
from tabled import tabled

AS_IT_IS = dict.fromkeys(("col", "lon", "lat", "ped"), 1.0)
SETTINGS = {"nominal_rpm": 2100.0, "coll_min": -2.0, "coll_max": 12.0, "coll_hover": 5.0}
OMEGA = np.geomspace(0.3, 60.0, 50)


def values_of(table) -> dict[str, float]:
    return {one.name: one.value for one in table.values}


BLADE = (
    (structures.rollpitch, values_of(published("blade360")["rollpitch_in1"])),
    (structures.yaw_base, values_of(published("blade360")["yaw_base"])),
    (structures.heave, values_of(published("blade360")["heave"])),
)


def test_blade_360_becomes_the_numbers_of_ardupilots_own_file():
    """The published helicopter in helisim's structures gives what the pull request's file holds."""
    # Tools/autotest/models/blade360.json of ArduPilot's pull request 29462, at commit 5ad7596;
    # the forces of the tilted thrust there are 9.81 m/s^2
    theirs = {
        "Ma1s": 796.7, "Lb1s": 5115.2, "Xa1s": -9.81, "Yb1s": 9.81, "Zw": -0.5910, "Nr": -2.0131,
        "Nped": 63.0040, "Zcol": -22.3239, "tf": 0.0353, "Lfa1s": 1.0477, "Mfb1s": -1.0057,
        "Lflt": 0.2375, "Lflg": -0.0286, "Mflt": 0.0344, "Mflg": 0.2292, "time_delay_rp": 40,
        "time_delay_ped": 40, "time_delay_col": 40,
    }  # fmt: skip
    numbers, remarks = numbers_of(BLADE, full=AS_IT_IS, late={})
    assert numbers == pytest.approx(theirs, rel=5e-4)  # 9.81 for 9.80665
    assert not remarks
    halved, _ = numbers_of(BLADE, full={}, late={})
    by_full = {"Nped": 0.5, "Lflt": 0.5, "Lflg": 0.5, "Mflt": 0.5, "Mflg": 0.5}
    ratios = {name: halved[name] / numbers[name] for name in numbers}
    assert ratios == pytest.approx({**dict.fromkeys(numbers, 1.0), **by_full})


def simulated(values: dict[str, float], commands: np.ndarray, step: float) -> np.ndarray:
    """p, q, r, w as SIM_StateSpace.cpp (commit 569e2a2) steps them, commands roll pitch coll yaw.

    First the rotor, from the rates before; then the accelerations; Euler. Commands wait in a
    buffer of delay / step samples. The attitude is kept: forces turn no velocity here.
    """
    get = {**dict.fromkeys(("Lu", "Lv", "Lp", "Mu", "Mv", "Mq", "Nv", "Nw", "Ncol"), 0.0), **values}
    lines = {
        key: int(min(100, max(1, int(get[f"time_delay_{key}"]))) * 0.001 / step)
        for key in ("rp", "ped", "col")
    }
    hover = (get["coll_hover"] - get["coll_min"]) / (get["coll_max"] - get["coll_min"])
    p = q = r = w = a = b = 0.0
    out = []
    for k in range(len(commands)):
        roll, pitch = commands[max(0, k - lines["rp"]), :2]
        coll = commands[max(0, k - lines["col"]), 2]
        yaw = commands[max(0, k - lines["ped"]), 3]
        out.append((p, q, r, w))
        inverse = 1.0 / get["tf"]
        b_dot = (
            -p
            - inverse * b
            + inverse * (get["Lfa1s"] * a + get["Lflt"] * roll + get["Lflg"] * pitch)
        )
        a_dot = (
            -q
            - inverse * a
            + inverse * (get["Mfb1s"] * b + get["Mflt"] * roll + get["Mflg"] * pitch)
        )
        a, b = a + step * a_dot, b + step * b_dot
        r_dot = get["Nr"] * r + get["Nped"] * yaw + get["Nw"] * w + get["Ncol"] * (coll - hover)
        w_dot = get["Zcol"] * (coll - hover) + get["Zw"] * w
        p, q = p + step * get["Lb1s"] * b, q + step * get["Ma1s"] * a
        r, w = r + step * r_dot, w + step * w_dot
    return np.array(out)


def test_simulating_the_file_as_ardupilot_does_gives_the_identified_motion(tmp_path):
    """Doublets through the file's numbers, stepped as its source does, against the fits' own."""
    numbers, _ = numbers_of(BLADE, full=AS_IT_IS, late={})
    ArduPilotModel({**numbers, **SETTINGS}).write(tmp_path / "blade.json")
    values = {
        k: v for k, v in json.loads((tmp_path / "blade.json").read_text()).items() if k != "made_by"
    }
    errors = []
    for step in (1.0 / 2000.0, 1.0 / 8000.0):
        time = np.arange(0.0, 1.5, step)
        moved = 0.05 * ((time > 0.1) & (time < 0.4)) - 0.05 * ((time >= 0.4) & (time < 0.7))
        commands = np.column_stack([moved, 0.5 * moved, 0.5 + moved, moved])
        found = simulated(values, commands, step)
        ours = {"lat": moved, "lon": 0.5 * moved, "ped": moved, "col": moved}
        wanted = []
        for structure, own in BLADE:
            lags = np.full((len(structure.outputs), len(structure.inputs)), 0.040)
            driven = np.column_stack([ours[name] for name in structure.inputs])
            wanted.append(delayed(linear(structure, own), driven, step, lags))
        wanted = np.hstack(wanted)  # p, q, r, w
        errors.append(np.max(np.abs(found - wanted), axis=0) / np.max(np.abs(wanted), axis=0))
    # Euler's error, of first order: a quarter with a quarter of the step
    assert np.all(errors[1] < 0.01)
    assert np.all(errors[1] < 0.35 * errors[0])


def test_servos_become_delays():
    """What the file has no state for stands in what it has, and is said."""
    servo = blocks.second_order("swash", omega=200.0, zeta=0.7)
    structure = in_series(structures.rollpitch, inputs={"lat": servo, "lon": servo})
    own = values_of(published("blade360")["rollpitch_in1"]) | {"tau_lon": 0.041}
    values = structure.starts | own
    numbers, remarks = numbers_of([(structure, values)], full=AS_IT_IS, late={"p": 0.02, "q": 0.02})
    # servo 2 zeta / omega = 7 ms, and of 40 and 41 ms the recorder's 20: 27 and 28 ms
    assert numbers["time_delay_rp"] == 28.0
    said = " ".join(remarks)
    assert "stand as delays" in said
    assert "27.0 ms of lat, 28.0 ms of lon" in said
    found, _ = numbers_of([(structures.rollpitch, own)], full=AS_IT_IS, late={})
    assert {**numbers, "time_delay_rp": 0.0} == pytest.approx({**found, "time_delay_rp": 0.0})


def test_a_model_of_a_fit_has_the_vehicles_numbers():
    """Revolutions a minute, degrees, and collective as shares; a negative one is refused."""
    heave = fitted(structures.heave, HEAVE)
    made = ArduPilotModel.of([heave], rotor_speed=100.0 * np.pi, hover_lean=np.pi / 60, hover=0.4)
    assert made.values["Zw"] == pytest.approx(HEAVE["Z_w"])
    vehicle = {"nominal_rpm": 3000.0, "hover_lean": 3.0, "coll_hover": 0.4}
    vehicle |= {"coll_min": 0.0, "coll_max": 1.0}
    assert {name: made.values[name] for name in vehicle} == pytest.approx(vehicle)
    for wrong in ({"rotor_speed": 0.0}, {"hover": 1.1}, {"hover": -0.1}):
        with pytest.raises(InputError, match="rotor_speed must be above 0"):
            ArduPilotModel.of([heave], **{"rotor_speed": 200.0} | wrong)


SPEEDS = structures.rollpitch_speeds


def test_flap_back_becomes_derivatives_by_the_velocities():
    """Without coupling the disc rests at A_u u + A_v v, back: M_u = M_a A_u, M_v = M_a A_v."""
    drift = {"A_u": 2e-3, "A_v": -5e-3, "A_b": 0.0, "B_a": 0.0, "L_b": 500.0, "M_a": 300.0}
    found, remarks = numbers_of([(SPEEDS, SPEEDS.starts | drift)], full=AS_IT_IS, late={})
    expected = {"Mu": 0.6, "Mv": -1.5, "Lu": -2.5, "Lv": -1.0, "Xu": -9.80665 * 2e-3}
    assert {name: found[name] for name in expected} == pytest.approx(expected)
    assert "no place for 0.049 in du/dt by v, -0.049 in dv/dt by u" in " ".join(remarks)


ORDER = structures.transfer_function(zeros=0, poles=2, input="lat", output="p")


@tabled("parts", "message")
def test_model_that_has_no_place_says_which_number(parts, message):
    """Nothing is lost without a word."""
    with pytest.raises(InputError, match=message):
        numbers_of(parts, full={}, late={})


def test_other_commands_and_numbers_are_checked():
    """A number or a command that doesn't exist is refused."""
    with pytest.raises(UnknownNameError, match=r"'Lb1'.*did you mean Lb1s"):
        ArduPilotModel({"Lb1": 1.0})
    with pytest.raises(UnknownNameError, match="'roll'"):
        numbers_of(BLADE, full={"roll": 1.0}, late={})
    split = replace(structures.rollpitch, name="split", M=(), F=tuple(
        tuple("-2" if i == j == 2 else "-1" if i == j == 3 else cell for j, cell in enumerate(row))
        for i, row in enumerate((("0",) * 4,) * 4)
    ))  # fmt: skip
    with pytest.raises(InputError, match="one lag"):
        numbers_of([(split, structures.rollpitch.starts)], full={}, late={})
