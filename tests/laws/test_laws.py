"""Laws of every kind: read as written, tuned, linear as they fly, started where servos stand."""

import math
import shutil
from dataclasses import MISSING, fields, replace
from pathlib import Path

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import InputError, UnknownNameError
from helisim.cli import main
from helisim.physics.laws import Called
from helisim.vehicle.law import linearize_law
from own_laws import FULL, HOLDS, INPUTS, LAT, random_law
from tabled import tabled

OMEGA = np.geomspace(0.2, 150.0, 60)
MADE = {"by": "hand", "specifications": [{"axis": "lat", "least": 45.0}], "of": {"seed": 3}}


def rotorflight(vehicle):
    law = hs.Rotorflight.of(vehicle)
    cyclic = {"b": 20.0, "d": 30.0, "o": 0.0, "error_decay_time": 0.0, "relax_level": 0.0}
    yaw = {"b": 10.0, "f": 20.0, "relax_level": 0.0, "cyclic_ff_gain": 0.0}
    return replace(
        law,
        roll=replace(law.roll, **cyclic, response_time=20.0),
        pitch=replace(law.pitch, **cyclic),
        yaw=replace(law.yaw, **yaw),
        swash_phase=20.0,
        smoothing=50.0,
        notches=(hs.laws.Notch(frequency=28.3), hs.laws.Notch(frequency=56.7, q=2.0)),
        name="with notches",
    )


KINDS = {
    "rotorflight": rotorflight,
    "attitude_command": lambda _: FULL,
    "rate_command": hs.RateCommand.of,
    "state_space": lambda _: random_law(limits=(0.5, 0.4, 0.3, 0.2), name="mine"),
}


@pytest.fixture(params=KINDS)
def law(request, jr700):
    return KINDS[request.param](jr700)


def test_what_is_written_is_read_again_and_what_is_tuned_is_replaced(law, tmp_path):
    assert hs.law_of(law.to_dict()) == law
    made = replace(law, provenance=MADE)
    made.write(tmp_path / "law.toml")
    assert hs.read_law(tmp_path / "law.toml") == made != law
    names = law.parameters()
    moved = law.replace({name: 1.01 * value for name, value in names.items()})
    assert moved.parameters() == {name: 1.01 * value for name, value in names.items()}
    with pytest.raises(UnknownNameError, match=r"'lat\.k_rat'"):
        law.replace({"lat.k_rat": 1.0})


@pytest.mark.parametrize("kind", KINDS)
def test_linear_form_is_the_compiled_law_differentiated(kind, jr700):
    """Against central differences of what flies: 1e-9 of steps of 1e-5.

    Rotorflight's I, in degrees, is rounded by 4e-16 of the 7 that hold the trim: 4e-11 of a step,
    1e-7 where it is integrated for 1/(0.2 rad/s 2 ms) ticks.
    """
    own = KINDS[kind](jr700)
    flying = jr700.with_controller(own)
    system = linearize_law(flying.controller, flying.model, flying.trim).system
    linear = own.linear(system.dt)
    order = [system.input_labels.index(name) for name in linear.inputs]
    flown = system(np.exp(1j * OMEGA * system.dt))[:, order]
    size, least = np.abs(flown).max(axis=-1, keepdims=True), 1e-9
    if kind == "rotorflight":  # there the errors that hold the trim turn with the yaw rate
        turned, least = np.index_exp[1:3, linear.inputs.index("r")], 4e-7
        flown[turned] = linear.response(OMEGA)[turned]
    assert np.all(np.abs(linear.response(OMEGA) - flown) <= least * np.maximum(size, 1.0))
    by_others = np.hstack([linear.a - np.diag(np.diagonal(linear.a)), linear.b])
    assert np.all(np.any(by_others, axis=1))  # a state that nothing moves is none of a linear law's
    if kind == "rate_command":  # the vehicle's own gyro
        gyro = replace(jr700.gyro, delays={}).select(linear.inputs)
        np.testing.assert_allclose(linear.response(OMEGA), gyro.response(OMEGA), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["jr700", "lynx", "blade360"])
def test_a_rate_command_flies_as_the_gyro_that_it_is_of(name):
    vehicle = hs.load(name, parameters={"gyro.anti_windup": float(name != "lynx")})
    written = hs.law_of(hs.RateCommand.of(vehicle).to_dict())
    plan = hs.Step(axis="lat", amplitude=0.3, duration=8.0)
    flights = [
        hs.fly(vehicle, plan, seed=1, controller=one, keep_ended=True)[0].values
        for one in (vehicle.controller, written)
    ]
    np.testing.assert_array_equal(*flights)


def test_holds_the_hover(jr700):
    """A stick's step without a pilot: the attitude that it asks for, to the remnant's 0.005."""
    held = ("k_attitude", "k_velocity", "k_position", "k_heave", "k_height", "k_heading")
    vehicle = hs.load("jr700", parameters={f"pilot.{name}": 0.0 for name in held})
    (record,) = hs.fly(vehicle, hs.Step(axis="lat", amplitude=0.2, duration=6.0), controller=HOLDS)
    asked = jr700.trim.phi + 0.6 * 0.2
    assert record["phi"][record.time > 4.0].mean() == pytest.approx(asked, abs=0.01)


def free_states():
    c, d = (np.random.default_rng(3).standard_normal((4, n)) for n in (4, 2))
    matrices = {"a": np.eye(4), "b": np.zeros((4, 2)), "c": c, "d": d, "start": np.linalg.inv(c)}
    return hs.StateSpaceLaw(period=0.002, inputs=("p", "phi"), **matrices)


@tabled("made", "col")
def test_starts_where_the_servos_stand(jr700, made, col):
    (flown,) = made(jr700).on(jr700).laws
    servos = (*jr700.swashplate.mix(col, 0.06, -0.04), 0.11)
    at_rest = hs.Seen(*np.zeros(len(hs.Seen._fields)).tolist())
    seen = at_rest._replace(phi=jr700.trim.phi, theta=jr700.trim.theta, az=-9.8)
    seen = seen._replace(**dict(zip(("front", "left", "right", "tail"), servos)))
    called, state = Called(flown), np.zeros(flown.states)
    commands = called(seen, state, starts=True)
    np.testing.assert_allclose(commands, servos, rtol=0.0, atol=1e-14)


def test_a_law_of_ones_own_needs_its_methods():
    class Half(hs.Law):
        kind = "half"

    with pytest.raises(TypeError, match="linear"):
        Half()


NAN = np.full((5, 5), np.nan).tolist()


@tabled("kind", "change", "message")
def test_what_is_no_law_says_what_is_wrong(kind, change, message, jr700):
    others = {"rate": hs.RateCommand.of(jr700), "matrix": random_law(), "fc": rotorflight(jr700)}
    data = others.get(kind, HOLDS).to_dict()
    changed = {"lat": {**LAT, **change}} if kind == "lat" else change
    with pytest.raises(InputError, match=message):
        hs.law_of({key: one for key, one in {**data, **changed}.items() if one is not None})


ENDS = {  # of the firmware's settings: pg/pid.c, pg/rates.c, pg/mixer.c and its command line
    "limit": (1.0, 2500.0),
    "rate": (1.0, 2000.0),
    "expo": (0.0, 1.0),
    "error_limit": (1.0, 180.0),
    **dict.fromkeys(("p", "d", "f", "b", "gyro_cutoff", "d_cutoff", "b_cutoff"), (0.0, 1000.0)),
    **dict.fromkeys(("relax_level", "relax_cutoff", "error_decay_time"), (0.0, 1000.0)),
    **dict.fromkeys(("response_time", "error_decay_limit"), (0.0, 1000.0)),
}


@pytest.mark.parametrize("end", [0, 1])
def test_settings_reach_to_the_firmwares_ends_and_no_further(jr700, end):
    law = hs.Rotorflight.of(jr700)
    for axis in (law.roll, law.pitch, law.yaw):
        own = {"offset_limit": (0.0, 180.0)} if axis is not law.yaw else {}
        ends = {name: pair[end] for name, pair in (ENDS | own).items()}
        replace(axis, **ends)
        for name, value in ends.items():
            with pytest.raises(InputError, match=name):
                replace(axis, **{name: value + (2.0 * end - 1.0)})


def test_compiled_matrices_act_within_limits_and_are_cut_off_beyond(jr700):
    vehicle = jr700
    law = random_law()
    controller = law.on(vehicle)
    settings, trim = np.asarray(controller.settings), vehicle.trim
    call = controller.law
    rng = np.random.default_rng(2)
    state, x = np.zeros(len(law.a)), np.zeros(len(law.a))
    steady = hs.Seen(*([0.0] * 18))._replace(phi=trim.phi, theta=trim.theta)
    middle = np.array([trim.col, trim.lon, trim.lat, trim.ped])
    cut = 0
    for size in (1e-3, 1e-2, 10.0, 1.0, 1e-3):
        off = dict(zip(INPUTS, size * rng.standard_normal(5)))
        seen = steady._replace(**{name: getattr(steady, name) + by for name, by in off.items()})
        y = np.array([*off.values()])
        y[2] = math.remainder(y[2], 2.0 * math.pi)  # of a heading
        front, left, right, tail = call(seen, state, settings)
        given = np.array([*vehicle.swashplate.unmix(front, left, right), tail])
        whole = middle + law.c @ x + law.d @ y
        assert given == pytest.approx(np.clip(whole, -0.5, 0.5), abs=1e-12)
        cut += bool(np.any(np.abs(whole) > 0.5))
        x = law.a @ x + law.b @ y + law.windup @ (np.clip(whole, -0.5, 0.5) - whole)
        assert state == pytest.approx(x, abs=1e-12)
    assert 0 < cut < 5


FLY = ["fly", "--excitation", "doublet", "--axis", "ped", "--quiet", "--out", "flown.parquet"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    shutil.copy(Path(__file__).with_name("law.toml"), tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_flies_and_its_record_can_be_flown_again(folder, jr700):
    assert main([*FLY, "--controller", "law.toml"]) == 0
    record = hs.read_record(folder / "flown.parquet")
    law = hs.law_of(record.provenance["controller"]["written"])
    assert law == HOLDS
    (again,) = hs.fly(jr700, hs.Doublet(axis="ped"), seed=record.provenance["seed"], controller=law)
    np.testing.assert_array_equal(again.values, record.values)


def test_a_law_follows_the_vehicle_that_flies_it(jr700):
    flying = jr700.with_controller(HOLDS)
    ahead = flying.trimmed(speed=5.0)
    assert ahead.controller.settings[1:3].tolist() == [ahead.trim.phi, ahead.trim.theta]
    assert ahead.linearize("IN2").system.nstates > sum(ahead.controller.state_counts)
    slower = flying.with_settings({"gyro.period": 0.004})
    assert slower.gyro.system.dt == slower.controller.settings[0] == 0.004
    assert np.abs(slower.linearize("IN2").system.poles()).max() < 1.0 + 1e-9  # neutral heading


@tabled("ask", "says")
def test_a_law_that_no_vehicle_flies_is_refused(jr700, ask, says):
    with pytest.raises(InputError, match=says):
        ask(jr700)


@pytest.mark.parametrize("kind", KINDS)
def test_a_law_is_as_kept(kind, jr700, kept):
    """What it leaves out, its response, and the first commands of its compiled form."""
    own = KINDS[kind](jr700)
    linear, parts = own.linear(0.002), own.to_dict()
    controller = own.on(jr700)
    kept([parts, np.abs(linear.response(OMEGA[::12])).tolist(), list(controller.settings)])


PARTS = (hs.laws.AttitudeAxis, hs.laws.YawAxis, hs.laws.RateAxis, hs.laws.YawRateAxis)


def test_what_is_left_out_is_as_kept(kept):
    kept(
        {
            one.__name__: {f.name: str(f.default) for f in fields(one) if f.default is not MISSING}
            for one in PARTS
        }
    )
