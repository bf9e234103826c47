"""A vehicle whose rotor speed moves: trim, linear model, stock MuJoCo, what it needs to be told."""

import pickle
import warnings
from functools import cache

import mujoco
import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader

import helisim as hs
import script
from command import fails
from helisim.base.errors import HelisimError, InputError, ModelError, TrimError, UnknownNameError
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.records.record import LOAD
from helisim.show.recording import write_recording
from helisim.vehicle import load, read_parameters, standard_parameters
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import assemble, total_inertia
from helisim.vehicle.build import write_numbers
from helisim.vehicle.parameters import glossary, number_of, term, to_toml, vehicle_names
from helisim.vehicle.trim import place
from heron import copied, edited
from tabled import tabled

MOTOR = {"drive.governor": "motor"}


@pytest.fixture(scope="module")
def motor():
    return load("jr700", parameters=MOTOR)


@cache
def linear_models(name):
    return tuple(load(name, parameters=one).linearize() for one in ({}, MOTOR))


def largest_difference(name, response, low, high):
    """Return by how much a frequency response with the motor differs from the ideal, relative."""
    omega = np.geomspace(low, high, 60)
    output, cause = response.split("/")
    found = []
    for linear in linear_models(name):
        labels = linear.system.output_labels, linear.system.input_labels
        row, column = (known.index(one) for known, one in zip(labels, (output, cause)))
        found.append(linear.response(omega)[row, column])
    return np.abs(found[1] / found[0] - 1.0).max()


@pytest.mark.parametrize("name", ["jr700", "blade360"])
@tabled("response", "band", "most")
def test_the_hover_s_responses_are_those_of_the_ideal_governor(name, response, band, most):
    """From 3 rad/s up, where the paper's structures hold, an electric motor changes little.

    Its own mode, of back-EMF and governor against the inertia, is at 50 rad/s (JR700) and 36 rad/s
    (Blade 360): below it the motor turns the blades with the body, above it the body is without
    them, 17 % of what is left. A body that yaws changes the rotor's speed through the air: 2 Q /
    Omega of yaw damping, and what collective yaws comes back in w/col, to 5 %.
    """
    assert largest_difference(name, response, *band) < most


def power_of(vehicle):
    data = vehicle.hovering()
    with installed():
        mujoco.mj_forward(vehicle.model, data)
    return data.sensor("power").data.copy()


def test_the_trim_s_throttle_is_that_of_the_torque(motor, jr700):
    own = motor.parameters
    drive, main, tail, _ = power_of(motor)
    assert drive == pytest.approx(main + tail, rel=1e-9)
    torque = drive / own["main_rotor.speed"] + own["drive.friction"]
    current = torque / own["drive.gear"] * own["drive.speed_constant"]
    current += own["drive.no_load_current"]
    emf = own["main_rotor.speed"] * own["drive.gear"] / own["drive.speed_constant"]
    volts = emf + current * own["drive.resistance"]
    assert motor.trim.throttle == pytest.approx(volts / own["drive.voltage"], rel=1e-12)
    assert jr700.trim.throttle == 0.0
    assert motor.trim.col == jr700.trim.col


def test_stock_mujoco_starts_in_the_trim_or_from_rest(tmp_path):
    own = copied(tmp_path / "own")
    edited(own, "parameters.toml", 'governor = { value = "ideal"', 'governor = { value = "motor"')
    write_numbers(own)
    model = mujoco.MjModel.from_xml_path(str(own / "jr700.xml"))
    data, where = mujoco.MjData(model), addresses(model)
    states = slice(where.state + STATE.speed, where.state + STATE.governor + 1)
    with installed():
        mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
        settled = data.act[states].copy()
        for _ in range(500):
            mujoco.mj_step(model, data)
        assert data.act[states] == pytest.approx(settled, abs=1e-8)  # digits of the keyframe
        assert settled[0] == 1.0
        mujoco.mj_resetData(model, data)
        assert not np.any(data.act[states])
        data.ctrl[where.control + 8] = 1.0
        model.opt.gravity[:] = 0.0  # not to fall through air that would turn the rotor
        speeds = []
        for _ in range(1000):
            mujoco.mj_step(model, data)
            speeds.append(data.act[states][0])
    assert np.all(np.diff(speeds) >= 0.0)
    assert 0.1 < speeds[-1] < 0.4


def test_a_motor_needs_its_numbers_and_its_power(tmp_path, capsys):
    with pytest.raises(TrimError, match=r"hover takes a torque of 5\..* N m .* full throttle"):
        load(parameters={**MOTOR, "drive.voltage": 30.0})
    own = copied(tmp_path / "own")
    text = (own / "parameters.toml").read_text()
    start = text.index("# What turns the rotor")
    (own / "parameters.toml").write_text(text[:start] + text[text.index("[servo]") :])
    assert load(own).trim.throttle == 0.0
    with pytest.raises(ModelError, match=r"positive drive\.inertia \(kg m\^2\), got 0"):
        load(own, parameters=MOTOR)
    assert "drive.inertia" in fails(capsys, "vehicle", "trim", own, "--set", "drive.governor=motor")


# A load on a cable: trim, linearisation, flight and recording, and force laws that ignore it.

proof = script.loaded("proof/slung_load")
RIGID = proof.LOAD.format(mass=1.0, length=3.0, arm=0.15)
ELASTIC = """<mujoco> <worldbody> <site name="hook" pos="0 0 -0.15"/>
  <body name="load" pos="0 0 -3.15"> <geom size="0.08" mass="1"/> <site name="top"/>
  <joint type="slide" axis="1 0 0"/> <joint type="slide" axis="0 1 0"/> <joint type="slide"/>
  </body> </worldbody> <tendon> <spatial springlength="0 3" stiffness="5000"> <site site="hook"/>
  <site site="top"/> </spatial> </tendon> </mujoco>"""


loaded = pytest.fixture(lambda: hs.load(slung=RIGID), scope="module")


def test_the_force_laws_know_the_vehicles_mass_alone(jr700):
    slung, laws, wrenches = hs.load(slung=RIGID.replace('mass="1.0"', 'mass="4.0"')), [], []
    assert dict(slung.parameters) == dict(jr700.parameters)
    np.testing.assert_array_equal(slung.model.actuator_user, jr700.model.actuator_user)
    assert slung.model.body_mass[1] == jr700.model.body_mass[1]
    assert slung.imu_offset == pytest.approx(jr700.imu_offset, abs=1e-14)  # sums of parts round
    for model in (slung.model, jr700.model):
        data = mujoco.MjData(model)
        place(model, data, jr700.trim)
        data.qvel[:6] = 0.3, -0.2, 0.1, 0.4, -0.3, 0.2
        with hs.installed():
            mujoco.mj_forward(model, data)
        laws.append(np.r_[data.sensor("rotor").data, data.sensor("power").data])
        wrenches.append(data.qfrc_passive[:6])
    # MuJoCo counts velocities and moments about the whole's centre of mass: rounding of 3 m
    np.testing.assert_allclose(*laws, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(*wrenches, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(("cable", "stretch"), [(RIGID, 0.0), (ELASTIC, 9.8015 / 5000.0)])
def test_the_trim_carries_both_weights_and_the_load_hangs_still_below(cable, stretch):
    """Newton: the air's force upwards is the weight of 8.01 kg and 1 kg; the cable is plumb."""
    slung = hs.load(slung=cable)
    data = slung.hovering()
    with hs.installed():
        mujoco.mj_forward(slung.model, data)
        hook, load = data.site("slung/hook").xpos.copy(), data.body("slung/load").xipos.copy()
        assert np.abs(data.qacc).max() < 1e-9  # the trim's own residual
        assert data.qfrc_passive[2] == pytest.approx(9.01 * 9.8015, rel=1e-9)
        mujoco.mj_step(slung.model, data, 500)
    np.testing.assert_allclose(load - hook, [0.0, 0.0, -3.0 - stretch], atol=1e-9)
    np.testing.assert_allclose(data.body("slung/load").xipos, load, atol=1e-6)  # after a second


@pytest.mark.parametrize("arm", [0.0, 0.15, 0.3])
def test_the_linearisations_pendulum_is_the_closed_form(jr700, arm):
    """Without the hub's cross stiffness and the bank of 0.064 rad: 1.5e-4 of the frequency."""
    found = proof.exact(hs.load(slung=proof.LOAD.format(mass=1.0, length=3.0, arm=arm)))
    assert found == pytest.approx(2 * [proof.closed_form(jr700, 1.0, 3.0, arm)], rel=5e-4)


def test_a_record_says_what_hung_there_and_rerun_draws_it_there(loaded, tmp_path):
    (record,) = hs.fly(loaded, hs.Pulse(axis="lat", amplitude=0.05, duration=4.0), seed=1)
    assert hs.load(slung=record.provenance["slung"]) == loaded == pickle.loads(pickle.dumps(loaded))
    assert np.ptp(record["load_y"]) > 0.1
    path = write_recording(tmp_path / "lat.rrd", {"lat": record}, model=loaded.visual_model())
    chunks = [one.to_record_batch() for one in RrdReader(path).stream() if "/load" in str(one)]
    (drawn,) = [one for one in chunks if "Transform3D:translation" in one.schema.names]
    place = np.array(drawn.column("Transform3D:translation").to_pylist())[:, 0]
    wanted = record.select(LOAD)[::2] + np.array([0.0, 0.0, 0.15])  # the hook
    np.testing.assert_allclose(place, wanted, atol=1e-6)  # single precision


def test_a_load_that_cannot_hang_is_refused(loaded):
    for old, new, error, says in (
        ("hook", "hock", ModelError, "needs a site 'hook'"),
        ("<worldbody>", "<worldbody", ModelError, "the slung load's MJCF"),
        ('"ball" damping="0.6"', '"slide"', TrimError, "no place where it hangs still"),
    ):
        with pytest.raises(error, match=says):
            hs.load(slung=RIGID.replace(old, new))
    plan = hs.FlightPlan(excitation=hs.Pulse(axis="lat"), ground=hs.Ground(parked=True))
    with pytest.raises(InputError, match="starts in the air"):
        hs.fly(loaded, plan)


# What the compiled vehicle weighs and is made of, and what its mirror image flies.


def test_inertia_is_the_calibrated_about_the_centre_of_gravity(jr700):
    wanted = [jr700.parameters[f"airframe.{axis}"] for axis in ("ixx", "iyy", "izz")]
    # MuJoCo keeps principal axes as a quaternion: rounding of 0.4 kg m^2
    assert total_inertia(jr700.model, "jr700") == pytest.approx(np.diag(wanted), abs=1e-12)
    data = mujoco.MjData(jr700.model)
    mujoco.mj_kinematics(jr700.model, data)
    mujoco.mj_comPos(jr700.model, data)
    # a micrometre under a thrust of 78 N is 8e-5 N m
    assert data.subtree_com[1] == pytest.approx(data.xpos[1], abs=1e-6)


def test_time_step_is_set():
    for timestep in (0.002, 0.0005):
        model = load(timestep=timestep).model
        assert model.opt.timestep == timestep
        pedal = model.actuator("PED").id
        # one delay, one step of skew between stamp and sample, one sample for the slope
        assert model.actuator_history[pedal, 0] * timestep >= 0.022 + timestep


def test_the_model_to_look_at_flies_the_same(jr700):
    seen = assemble("jr700", jr700.parameters, visual=True)
    assert seen.ngeom > jr700.model.ngeom
    assert seen.nbody > jr700.model.nbody
    one, other = (total_inertia(model, "jr700") for model in (seen, jr700.model))
    assert one == pytest.approx(other, abs=1e-12)
    ends = []
    for model in (seen, jr700.model):
        data = mujoco.MjData(model)
        place(model, data, jr700.trim)
        data.qvel[3:6] = [0.3, -0.2, 0.1]
        with installed():
            for _ in range(200):
                mujoco.mj_step(model, data)
        ends.append(np.concatenate([data.qpos, data.qvel, data.act]))
    # inertias summed in another order: rounding, grown over 0.4 s
    assert ends[0] == pytest.approx(ends[1], abs=1e-11)


# Parameters: names, units, words and sources; what can't be is refused with one clear line.

CHOICES = {name: known.words for name, known in glossary().items() if known.words}


@pytest.mark.parametrize("name", vehicle_names())
def test_the_shipped_vehicles_are_plausible(name, tmp_path):
    parameters = standard_parameters(name)
    for key, entry in parameters.entries().items():
        known = term(key)
        assert known is not None, key
        assert (entry.name, entry.unit) == (key, known.unit)
        assert entry.source
        assert known.low <= entry.value <= known.high, key
    assert all(key in parameters for key, known in glossary().items() if not known.optional)
    (tmp_path / "p.toml").write_text(to_toml(parameters, "header"))
    assert dict(read_parameters(tmp_path / "p.toml")) == dict(parameters)


@pytest.mark.parametrize("name", CHOICES)
def test_every_word_stands_for_a_number_and_back(name):
    for k, word in enumerate(CHOICES[name]):
        assert number_of(name, word) == number_of(name, k) == k
        chosen = standard_parameters("jr700").replace({name: word})
        assert chosen.word(name) == word
        assert f'value = "{word}"' in to_toml(chosen, "header")


GOVERNOR = "[drive]\ngovernor = { value = 'perfect', unit = '1', source = 'x' }"
DENSITY = "[air]\ndensity = "


@tabled("text", "message")
def test_a_malformed_file_is_refused(tmp_path, text, message):
    path = tmp_path / "parameters.toml"
    path.write_text(text)
    with pytest.raises(ModelError, match=message) as caught:
        read_parameters(path)
    assert str(path) in str(caught.value)


def test_a_parameter_is_defined_once_and_ones_own_section_is_left_alone(tmp_path):
    text = DENSITY + "{ value = 1.2, unit = 'kg/m^3', source = 'x' }"
    for name in ("a.toml", "b.toml"):
        (tmp_path / name).write_text(text)
    with pytest.raises(ModelError, match=r"air\.density' is already defined"):
        read_parameters(tmp_path / "a.toml", tmp_path / "b.toml")
    with pytest.raises(ModelError, match=r"none\.toml"):
        read_parameters(tmp_path / "none.toml")
    own = copied(tmp_path / "own")
    with (own / "parameters.toml").open("a") as file:
        file.write('[my_law]\ngain = { value = 2.0, unit = "bananas", source = "mine" }\n')
    assert load(own).parameters["my_law.gain"] == 2.0
    edited(own, "parameters.toml", "[servo]", "[servos]")
    with pytest.raises(ModelError, match=r"servo\.swash_frequency \(rad/s\) is missing"):
        load(own)


@tabled("changes", "error", "message")
def test_a_value_that_can_not_be_is_refused(changes, error, message):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(error, match=message) as raised:
            load(parameters=changes).linearize()
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="Python's numbers raise where these overflow")
def test_a_linearisation_that_overflows_is_refused():
    with pytest.raises(ModelError, match="linearisation isn't finite"):
        load(parameters={"servo.swash_frequency": 1e300}).linearize()


def test_replace_leaves_the_original(jr700):
    changed = jr700.parameters.replace({"air.density": 1.0})
    assert changed["air.density"] == 1.0
    assert changed.entry("air.density").source == "set by the user"
    assert jr700.parameters["air.density"] == 1.225
    assert "main_rotor.radios" not in jr700.parameters
    with pytest.raises(UnknownNameError, match=r"air\.density"):
        jr700.parameters["density"]


@pytest.mark.parametrize(("file", "command"), [("calibrated", "calibrate"), ("tuned", "tune")])
def test_a_file_that_a_command_makes_is_asked_of_it(tmp_path, file, command):
    own = copied(tmp_path / "own")
    (own / f"{file}.toml").unlink()
    with pytest.raises(ModelError, match=f"{file}.toml: no such file") as caught:
        load(own)
    (remedy,) = caught.value.remedy
    assert remedy.name == command


NAMES = sorted(load().parameters)
VALUES = st.one_of(
    st.floats(allow_nan=False),
    st.floats(-10.0, 10.0),
    st.sampled_from([0.0, 5e-324, 1e-12, 1e9, -1e300, 1e300, float("inf")]),
)


@given(changes=st.dictionaries(st.sampled_from(NAMES), VALUES, min_size=1, max_size=3))
@settings(max_examples=20)
def test_any_override_loads_or_is_one_clear_error(changes):
    message = ""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            system = load(parameters=changes).linearize()
        except HelisimError as error:
            message = str(error)
        else:
            assert np.all(np.isfinite(system.a))
    assert len(message.splitlines()) <= 1
