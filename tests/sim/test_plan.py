"""The flight plan: one value, the same in Python, as plain data, as TOML and in a record."""

import json
import tomllib
from dataclasses import replace

import pytest

from helisim.base.errors import InputError, StorageError
from helisim.cli import main
from helisim.ident import frequency_response
from helisim.records.storage import read_record, write_record
from helisim.sim import (
    Deck,
    Doublet,
    FlightEnvelope,
    FlightPlan,
    Ground,
    Gust,
    GyroDropout,
    Pilot,
    Recorder,
    SensorSpikes,
    ServoStuck,
    Sweep,
    Swing,
    Weather,
    fly,
    fly_to,
    read_plan,
    write_plan,
)
from helisim.vehicle import load

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
FULL = FlightPlan(
    excitation=Doublet(axis="ped", amplitude=0.05, width=0.4),
    pilot=Pilot(remnant=0.001),
    recorder=Recorder(rate_hz=200.0, noise={"p": 0.01}, latency={"r": 0.02}),
    weather=Weather(rms=(1.0, 2.0, 0.5), gust=Gust(down=2.0), wind=3.0),
    faults=(
        SensorSpikes(channels=("p", "q"), size=5.0),
        ServoStuck(servo="servo_tail", at=3.0),
        GyroDropout(at=4.0, lasts=0.1, rates=("p",)),
    ),
    ground=Ground(friction=0.4, deck=Deck(width=4.0, heave=Swing(amplitude=0.5, period=6.0))),
    envelope=FlightEnvelope(tilt=0.8, descent=None, touchdown=1.0),
)
PLANS = {
    "all else default": FlightPlan(excitation=SHORT),
    "everything set": FULL,
    "nothing limited": FlightPlan(excitation=SHORT, envelope=FlightEnvelope.off()),
}


@pytest.mark.parametrize("name", PLANS)
def test_a_plan_comes_back_from_its_file_and_its_data(tmp_path, name):
    """The same value, hash and digest, from TOML and through JSON."""
    plan = PLANS[name]
    write_plan(plan, tmp_path / "plan.toml")
    through_json = FlightPlan.from_dict(json.loads(json.dumps(plan.to_dict())))
    for again in (read_plan(tmp_path / "plan.toml"), through_json):
        assert again == plan
        assert hash(again) == hash(plan)
        assert again.digest == plan.digest


@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_a_plan_on_a_vehicle_has_nothing_left_open(name):
    """It is what the vehicle's own parameters say, also after a detour over TOML."""
    vehicle = load(name)
    plan = FlightPlan(excitation=Sweep(axis="ped")).on(vehicle)
    own = vehicle.parameters
    assert plan.excitation.amplitude == own["sweep.ped_amplitude"]
    assert plan.excitation.band == (own["sweep.ped_w_min"], own["sweep.ped_w_max"])
    assert plan.recorder == Recorder.of(vehicle)
    assert plan.on(vehicle) == plan
    assert FlightPlan.from_dict(tomllib.loads(plan.to_toml())) == plan


def test_a_recorder_in_a_file_keeps_the_vehicles_latencies(jr700):
    """Unless the file gives them; who asks for another rate asks for no other sensors."""
    content = {"excitation": {"kind": "Sweep", "axis": "lat"}, "recorder": {"rate_hz": 200}}
    plan = FlightPlan.from_dict(content)
    assert plan.on(jr700).recorder == replace(Recorder.of(jr700), rate_hz=200.0)
    content["recorder"]["latency"] = {}
    assert FlightPlan.from_dict(content).on(jr700).recorder == Recorder(rate_hz=200.0)


@pytest.mark.parametrize(
    "change",
    [
        {"excitation": replace(FULL.excitation, width=0.5)},
        {"pilot": Pilot()},
        {"recorder": None},
        {"recorder": replace(FULL.recorder, noise={"p": 0.02})},
        {"weather": replace(FULL.weather, gust=None)},
        {"faults": FULL.faults[::-1]},
        {"faults": ()},
        {"ground": None},
        {"ground": Ground(slope=0.1)},
        {"envelope": FlightEnvelope(tilt=0.8)},
    ],
)
def test_any_change_is_another_plan(change):
    """With another digest; the order of a recorder's faults counts."""
    other = replace(FULL, **change)
    assert other != FULL
    assert other.digest != FULL.digest


def test_equal_numbers_make_equal_plans():
    """Whole numbers and lists are what people write; they are the same plan, hash and digest."""
    plan = FlightPlan(excitation=Sweep(axis="lat", duration=90.0, band=(1.0, 20.0)))
    other = FlightPlan(excitation=Sweep(axis="lat", duration=90, band=[1, 20]), faults=[])
    assert (other, hash(other), other.digest) == (plan, hash(plan), plan.digest)
    one, two = (Recorder(rate_hz=rate, noise={"p": 0.0, "q": 1.0}) for rate in (100.0, 100))
    assert (one, hash(one)) == (two, hash(two))


def test_a_plan_in_words_says_what_is_not_default():
    """One line a part, as one would write it; what isn't said is as by default."""
    lines = str(FULL).splitlines()
    assert lines[0] == f"flight plan {FULL.digest[:8]}"
    assert lines[1] == "  excitation  Doublet(axis='ped', amplitude=0.05, width=0.4)"
    assert lines[2] == "  pilot       Pilot(remnant=0.001)"
    deck = "Deck(width=4.0, heave=Swing(amplitude=0.5, period=6.0))"
    assert lines[5] == f"  ground      Ground(friction=0.4, deck={deck})"
    assert lines[6] == "  envelope    FlightEnvelope(tilt=0.8, touchdown=1.0, descent=None)"
    plain = str(FlightPlan(excitation=SHORT)).splitlines()
    assert "  recorder    the vehicle's own" in plain
    assert "  weather     Weather()" in plain


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "needs an excitation"),
        ("excitation = 'lat'", "excitation must be a table with a kind, one of "),
        (
            "[excitation]\nkind = 'Wobble'\naxis = 'lat'",
            "unknown kind of plan.excitation 'Wobble'; available: ",
        ),
        ("[excitation]\nkind = 'Sweep'", "plan.excitation needs axis"),
        ("[excitation]\nkind = 'Sweep'\naxis = 'lat'\nwidth = 1", "'width'; available: axis, "),
        ("[excitation]\nkind = 'Sweep'\naxis = 'roll'", "'roll'; available: col, lon"),
        ("[excitation]\nkind = 'Sweep'\naxis = 'lat'\nduration = '9'", "duration must be a num"),
        ("@wind = 3", "'wind'; available: excitation, mission, pilot, recorder"),
        ("@weather = 'light'", "weather must be a table"),
        ("@weather = {winds = 3}", "'winds'; available: wind, wind_from"),
        ("@weather = {turbulence = true}", "turbulence must be text or a number"),
        ("@weather = {rms = [1.0, 2.0]}", "rms must be a list of 3 numbers"),
        ("@weather = {gust = {up = 1}}", "'up'; available: north, east, down"),
        ("@recorder = {noise = 0.1}", "noise must be a table of numbers"),
        ("@recorder = {rotor = 'off'}", "rotor must be true or false"),
        ("@envelope = {tilt = -1}", "tilt must be a number above 0 rad"),
        ("@faults = 'gyro:restart@3'", "faults must be a list"),
        ("@faults = ['gyro:stops@3']", "'stops'; available: restart, dropout"),
        ("@faults = [{kind = 'ServoLost'}]", "'ServoLost'; available: ServoStuck"),
        ("@faults = [{kind = 'ServoStuck'}]", "plan.faults[0] needs servo and at"),
        ("@faults = [{kind = 'RecordGap', at = 1, lasts = 1, servo = 'x'}]", "available: at, las"),
        ("@faults = ['gyro:restart@300']", "over at 90 s"),
        ("@faults = [{kind = 'SampleLoss', share = 0.1, burst = 1.5}]", "burst must be an integer"),
    ],
)
def test_a_plan_that_can_not_be_is_refused(tmp_path, text, says):
    """In one line that names the file, what was received, and what there is."""
    path = tmp_path / "plan.toml"
    text = text.replace("@", "excitation = {kind = 'Sweep', axis = 'lat'}\n", 1)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_plan(path)
    assert str(caught.value).startswith(str(path))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_faults_in_a_file_may_be_as_on_the_command_line(tmp_path):
    """Text and table say the same."""
    path = tmp_path / "plan.toml"
    head = "faults = ['servo_tail:stuck@3', {kind = 'RecordGap', at = 1, lasts = 0.5}]\n"
    path.write_text(f"{head}[excitation]\nkind = 'Doublet'\naxis = 'lat'\n", encoding="utf-8")
    stuck, gap = read_plan(path).faults
    assert stuck == ServoStuck(servo="servo_tail", at=3.0)
    assert (gap.at, gap.lasts) == (1.0, 0.5)


def test_a_file_that_is_not_there_or_no_toml(tmp_path):
    """The error names it."""
    (tmp_path / "a.toml").write_text("[excitation", encoding="utf-8")
    for name, says in (("a.toml", "not TOML"), ("b.toml", "no such file")):
        with pytest.raises(StorageError, match=rf"{name}: {says}"):
            read_plan(tmp_path / name)


def test_a_bare_excitation_is_a_plan(jr700):
    """With all else default: the same record, provenance too."""
    (bare,) = fly(jr700, SHORT, seed=3, jobs=1)
    (planned,) = fly(jr700, FlightPlan(excitation=SHORT), seed=3, jobs=1)
    assert planned.values.tobytes() == bare.values.tobytes()
    assert planned.provenance == bare.provenance
    assert FlightPlan.of_record(bare) == FlightPlan(excitation=SHORT).on(jr700)


def earlier(record):
    """Return a record as it was before plans: its envelope is a watch, and it has no digest."""
    kept = dict(record.provenance)
    kept["watch"] = kept.pop("envelope")
    del kept["plan_digest"]
    return replace(record, provenance=kept)


def test_a_record_of_an_earlier_version_is_read_and_identified(jr700, tmp_path):
    """And its plan can be flown again, to the same numbers."""
    (record,) = fly(jr700, Sweep(axis="lat", duration=20.0), seed=3, jobs=1)
    path = tmp_path / "lat.parquet"
    write_record(earlier(record), path)
    old = read_record(path)
    asked = {"inputs": "LAT", "outputs": "p", "band": (10.0, 30.0)}
    found, expected = (frequency_response(one, **asked) for one in (old, record))
    assert found.response.tobytes() == expected.response.tobytes()
    (again,) = fly(jr700, FlightPlan.of_record(old), seed=old.provenance["seed"], jobs=1)
    assert again.values.tobytes() == record.values.tobytes()


def test_a_folder_of_an_earlier_version_is_another_configuration(jr700, tmp_path):
    """The message says which file, why, and what to do; the file stays."""
    (path,) = fly_to(tmp_path, jr700, SHORT, count=1, seed=7, jobs=1).paths
    write_record(earlier(read_record(path)), path)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"lat_0001.* an earlier version .* choose another folder"):
        fly_to(tmp_path, jr700, SHORT, count=1, seed=7, jobs=1)
    assert path.read_bytes() == before


def test_a_record_that_helisim_did_not_fly_has_no_plan(jr700):
    """A log of anyone's."""
    (record,) = fly(jr700, SHORT, seed=3, jobs=1)
    with pytest.raises(InputError, match="helisim didn't fly it"):
        FlightPlan.of_record(replace(record, provenance={}))


OPTIONS = ["--axis", "lat", "--duration", "13", "--turbulence", "light", "--wind", "2"]
OPTIONS += ["--wind-from-deg", "90", "--fault", "p:spikes,size=5", "--envelope", "tilt=off"]


def test_a_printed_plan_flies_the_same(tmp_path, capsys):
    """`--print-plan` flies nothing; `--plan` of what it printed gives the same file."""
    assert main(["fly", *OPTIONS, "--print-plan"]) == 0
    path = tmp_path / "plan.toml"
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    assert main(["fly", "--plan", str(path), "--print-plan"]) == 0
    assert capsys.readouterr().out == path.read_text(encoding="utf-8")
    files = [tmp_path / "options.parquet", tmp_path / "plan.parquet"]
    for asked, out in zip((OPTIONS, ["--plan", str(path)]), files):
        assert main(["fly", *asked, "--quiet", "--out", str(out)]) == 0
    assert files[0].read_bytes() == files[1].read_bytes()
    assert FlightPlan.of_record(read_record(files[1])) == read_plan(path)


def test_options_beside_a_plan_change_it(tmp_path, capsys):
    """Each its own setting; faults are added."""
    path = tmp_path / "plan.toml"
    write_plan(replace(FULL, weather=Weather(wind=3.0), recorder=None), path)
    further = ["--duration", "9", "--amplitude", "0.03", "--turbulence", "4.5"]
    further += ["--envelope", "rate=15", "--fault", "recorder:drift,ppm=50"]
    assert main(["fly", "--plan", str(path), *further, "--print-plan"]) == 0
    plan = FlightPlan.from_dict(tomllib.loads(capsys.readouterr().out))
    assert plan.excitation == replace(FULL.excitation, duration=9.0, amplitude=0.03)
    assert plan.weather == Weather(wind=3.0, turbulence=4.5)
    assert plan.envelope == FlightEnvelope(tilt=0.8, rate=15.0, descent=None, touchdown=1.0)
    assert plan.faults[:-1] == FULL.faults
    assert plan.pilot == FULL.pilot
    assert main(["fly", "--plan", str(path), "--excitation", "sweep", "--print-plan"]) == 0
    plan = FlightPlan.from_dict(tomllib.loads(capsys.readouterr().out))
    assert (type(plan.excitation), plan.excitation.axis) == (Sweep, "ped")


def test_another_axis_does_not_keep_the_amplitude_of_the_first(tmp_path, capsys):
    """It is refused while the plan says it, and the other axis's own where it is left open."""
    path = tmp_path / "plan.toml"
    write_plan(FULL, path)
    assert main(["fly", "--plan", str(path), "--axis", "lat", "--print-plan"]) == 2
    assert "amplitude of the ped axis: take" in capsys.readouterr().err
    write_plan(FlightPlan(excitation=Doublet(axis="ped")), path)
    assert main(["fly", "--plan", str(path), "--axis", "lat", "--print-plan"]) == 0
    printed = tomllib.loads(capsys.readouterr().out)
    assert (printed["excitation"]["axis"], printed["excitation"]["amplitude"]) == ("lat", 0.07)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (
            ["--out", "a.parquet"],
            "--axis col|lon|lat|ped, --excitation KIND, --mission NAME, or --plan FILE",
        ),
        (["--axis", "lat"], "--out FILE, or --out DIR"),
        (["--plan", "none.toml", "--out", "a.parquet"], "none.toml: no such file"),
        (
            ["--axis", "lat", "--excitation", "wobble", "--print-plan"],
            "unknown excitation 'wobble'; available: ",
        ),
        (["--axis", "lat", "--excitation", "sweep,width=1", "--print-plan"], "available: axis, du"),
        (["--axis", "lat", "--excitation", "doublet,width", "--print-plan"], "NAME=VALUE"),
    ],
)
def test_what_is_no_plan_is_one_line(tmp_path, monkeypatch, capsys, arguments, says):
    """Status 2, and nothing is flown or written."""
    monkeypatch.chdir(tmp_path)
    assert main(["fly", *arguments]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
