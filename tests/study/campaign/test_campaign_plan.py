"""Campaign files: what they can say, and how a mistake is answered."""

import json
import tomllib
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from helisim.base.errors import HelisimError, InputError, StorageError
from helisim.sim import Gust, Weather
from helisim.study.campaign import campaign_from, read_campaign
from helisim.study.models import YAW_BASE
from helisim.vehicle import load
from script import SCRIPTS

CAMPAIGNS = SCRIPTS / "campaigns"

PLAN = """
[campaign]
design = "grid"
replicates = 2
seed = 5
models = ["yaw_base", "heave"]
flights = 4
identified_after = [1, 4]

[set.sweep]
duration = 60
lat.amplitude = 0.05

[vary.recorder]
noise = { values = [1, 4], relative = true }
"noise.p" = [0.001, 0.002]

[vary.vehicle]
main_rotor.hub_stiffness = { low = 0.8, high = 1.2, count = 3, relative = true }
"""


def plan(text):
    return campaign_from(tomllib.loads(text))


def test_a_grid_has_every_combination_and_replicate():
    """Two by two by three points, twice, the first of all points before the second of any."""
    campaign = plan(PLAN)
    assert json.loads(json.dumps(campaign.to_dict()))["replicates"] == 2
    assert len(campaign) == 24
    replicates = list(campaign)
    assert [one.point for one in replicates] == [*range(12), *range(12)]
    assert [one.seed for one in replicates] == list(range(5, 29))
    assert len({tuple(one.values.items()) for one in replicates}) == 12
    assert set(replicates[0].values) == {
        "recorder.noise",
        "recorder.noise.p",
        "vehicle.main_rotor.hub_stiffness",
    }
    assert campaign.axes == ("col", "ped")


def test_common_seeds_pair_the_points():
    campaign = plan(PLAN.replace("seed = 5", 'seed = 5\nseeds = "common"'))
    assert [one.seed for one in campaign] == [5] * 12 + [6] * 12


def test_settings_reach_what_flies(jr700):
    """Values replace, factors multiply, an axis's own setting is of that axis only."""
    settings = plan(PLAN).replicate(11).settings
    nominal = jr700.parameters["main_rotor.hub_stiffness"]
    # the grid ends at 0.8 + 2 (1.2 - 0.8) / 2, exact but for rounding
    assert settings.parameters() == {
        "main_rotor.hub_stiffness": pytest.approx(1.2 * nominal, rel=1e-15)
    }
    recorder = settings.recorder(jr700)
    assert recorder.noise["p"] == 0.002
    assert recorder.noise["w"] == 4 * 0.02
    assert recorder.latency["r"] == jr700.parameters["recorder_latency.r"]
    assert settings.sweep("lat", jr700.parameters).amplitude == 0.05
    assert settings.sweep("ped", jr700.parameters).amplitude == 0.01
    assert {settings.sweep(axis, jr700.parameters).duration for axis in ("col", "lat")} == {60}


def test_a_factor_multiplies_what_the_axis_has_of_its_own(jr700):
    """The sweep's own amplitude and band are there to be multiplied, though not given."""
    campaign = plan("[vary.sweep]\namplitude = { values = [0.5, 2.0], relative = true }")
    sticks = [one.settings.sweep("lat", jr700.parameters).amplitude for one in campaign]
    assert sticks == [0.035, 0.14]
    campaign = plan("[vary.sweep]\nlat.band = [[1.0, 40.0], [2.0, 30.0]]")
    assert [one.settings.sweep("lat", jr700.parameters).band for one in campaign] == [
        (1.0, 40.0),
        (2.0, 30.0),
    ]
    assert campaign.replicate(0).settings.sweep("ped", jr700.parameters).band == (0.3, 30.0)


def test_weather_reaches_what_flies():
    """Calm is a level of turbulence like others; a gust is named field by field."""
    campaign = plan("""
[set.weather]
wind = 2
gust.down = 1.5
gust.rise = { value = 3, relative = true }
[vary.weather]
turbulence = [0, 1.5]
""")
    calm, rough = (one.settings.weather() for one in campaign)
    assert calm.dryden is None
    # MIL-F-8785C, section 3.7.3: a tenth of the wind at 20 ft
    assert rough.dryden.rms[2] == pytest.approx(0.15, rel=1e-12)
    assert {one.wind for one in (calm, rough)} == {2}
    assert calm.gust == Gust(down=1.5, rise=3.0)  # three times the usual second
    assert campaign_from({}).replicate(0).settings.weather() == Weather()


def test_turbulence_goes_by_name_too():
    campaign = plan('[vary.weather]\nturbulence = ["light", "severe"]')
    assert [one.settings.weather().turbulence for one in campaign] == ["light", "severe"]


def test_a_vehicle_is_loaded_with_its_parameters_and_the_integrator():
    text = '[campaign]\nintegrator = "Euler"\n[vary.vehicle]\nmain_rotor.hub_stiffness = [80, 100]'
    vehicle = plan(text).replicate(1).settings.load()
    assert vehicle.model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert vehicle.parameters["main_rotor.hub_stiffness"] == 100
    assert vehicle.derivatives["L_b"] > load().derivatives["L_b"]


@pytest.mark.parametrize("design", ["latin hypercube", "monte carlo"])
@pytest.mark.slow
def test_drawn_points_repeat_and_follow_their_laws(design):
    """A seed gives the same points; they have the laws' means, spreads and limits."""
    text = f"""
[campaign]
design = "{design}"
points = 400
seed = 3
[vary.vehicle]
airframe.ixx = {{ low = 0.1, high = 0.3 }}
air.density = {{ mean = 1.2, std = 0.05 }}
[vary.recorder]
noise = {{ low = 0.1, high = 10.0, scale = "log", relative = true }}
rate_hz = [100, 200]
"""
    campaign = plan(text)
    assert [one.values for one in campaign] == [one.values for one in plan(text)]
    other = plan(text.replace("seed = 3", "seed = 4"))
    assert campaign.replicate(0).values != other.replicate(0).values
    draws = {
        key: np.array([one.values[key] for one in campaign]) for key in campaign.replicate(0).values
    }
    ixx, noise = draws["vehicle.airframe.ixx"], np.log10(draws["recorder.noise"])
    # 400 draws: means within 4 standard errors, spreads within 4 of theirs
    for found, mean, std in (
        (ixx, 0.2, 0.2 / 12**0.5),
        (noise, 0.0, 2.0 / 12**0.5),
        (draws["vehicle.air.density"], 1.2, 0.05),
    ):
        assert found.mean() == pytest.approx(mean, abs=4 * std / 20)
        assert found.std() == pytest.approx(std, rel=4 / 800**0.5)
    assert 0.1 <= ixx.min() < ixx.max() <= 0.3
    assert abs(np.mean(draws["recorder.rate_hz"] == 100) - 0.5) < 4 * 0.5 / 20
    if design == "latin hypercube":  # each of 400 strata holds one
        assert sorted((400 * (ixx - 0.1) / 0.2).astype(int)) == list(range(400))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[campain]", "unknown section 'campain'; available: campaign, set, vary"),
        ("campaign = 3", "campaign must be a section"),
        ("[campaign]\nreplicate = 3", "unknown key of [campaign] 'replicate'"),
        ("[campaign]\nreplicates = 0", "replicates must be an integer 1 or more, got 0"),
        ("[campaign]\nreplicates = 2.5", "2.5"),
        ("[campaign]\nreplicates = true", "True"),
        ('[campaign]\nseed = "a"', "seed must be"),
        ('[campaign]\ndesign = "sobol"', "available: grid, latin hypercube, monte carlo"),
        ('[campaign]\nvehicle = "jr800"', "unknown vehicle 'jr800'; available: "),
        ('[campaign]\nintegrator = "RK5"', "available: RK4, Euler"),
        ('[campaign]\nmodels = ["yaw"]', "available: yaw_base"),
        ('[campaign]\nmodels = "heave"', "models must be a list"),
        ("[campaign]\nmodels = []", "models must be a list"),
        ('[campaign]\nmodels = ["heave", "heave"]', "twice"),
        ('[campaign]\nmodels = ["yaw_gyro"]', "takes values from yaw_base"),
        ('[campaign]\nmethods = ["indirect"]', "available: designed, direct, joint"),
        ("[campaign]\nflights = 3\nidentified_after = [4]", "must be 1 to 3 flights, got 4"),
        ("[campaign]\nidentified_after = 4", "identified_after must be a list"),
        ("[campaign]\nsweeps = ['ped']", "campaign.sweeps must be a table"),
        (
            "[campaign.sweeps]\nyaw = ['ped']",
            "unknown model of sweeps 'yaw'; available: yaw_base",
        ),
        ("[campaign.sweeps]\nheave = []", "sweeps.heave must be a list with one item or more"),
        ("[campaign.sweeps]\nheave = ['up']", "'up'; available: col, "),
        ("[campaign.sweeps]\nheave = ['col', 'col']", "sweeps.heave names something twice"),
        ("[campaign]\nkind = {}", "unknown key of [campaign] 'kind'"),
        ("[campaign]\nmodels = {}", "campaign.models must be a list of names, got {}"),
        ("[vary.sweep]\nkind = {}", "vary.sweep.kind is empty; expected { value"),
        ("[vary.sweep]\nduration = { value = {} }", "sweep.duration must be"),
        ("[vary.sweep]\nduration = { low = {}, high = 1 }", "sweep.duration.low must be a number"),
        ("[campaign]\npoints = 4", "leave out points"),
        ('[campaign]\ndesign = "monte carlo"', "needs points"),
        ('[campaign]\ndesign = "monte carlo"\npoints = 3', "needs something that varies"),
        ("[vary.rotor]\nspeed = [1, 2]", "unknown section of [vary] 'rotor'"),
        ("[vary]\nsweep = 3", "vary.sweep must be a section"),
        ("[vary.sweep]\nlength = [1, 2]", "unknown setting of sweep 'length'; available: duration"),
        ("[vary.sweep]\naxis = ['lat', 'col']", "unknown setting of sweep 'axis'"),
        ("[vary.sweep]\nduration = 30", "it belongs under [set.sweep]"),
        ("[set.sweep]\nduration = { values = [30, 60] }", "it belongs under [vary.sweep]"),
        ("[vary.sweep]\nduration = [30, '60']", "mixes numbers and text"),
        ("[vary.sweep]\nduration = ['30', '60']", "sweep.duration must be a number"),
        ("[vary.sweep]\nduration = [30, 30]", "twice"),
        ("[vary.sweep]\nduration = []", "no values"),
        ("[vary.sweep]\nduration = [30, nan]", "duration must be a finite number, got nan"),
        ("[vary.sweep]\nduration = [30, true]", "mixes"),
        ("[vary.sweep]\namplitude = [0.1, 0.7]", "(0, 0.5]"),
        (
            "[vary.sweep]\nduration.lat = [30, 60]",
            "sweep has no duration.lat: duration has no parts",
        ),
        ("[vary.sweep]\nband = [[1, 2, 3], [1, 2, 4]]", "a list of 2 numbers"),
        ("[vary.sweep]\nduration = { low = 30 }", "expected { value"),
        ("[vary.sweep]\nduration = { low = 30, high = 60 }", "needs levels"),
        ("[vary.sweep]\nduration = { low = 60, high = 30, count = 2 }", "low < high"),
        ("[vary.sweep]\nduration = { low = 30, high = 60, count = 1 }", "count must be"),
        ("[vary.sweep]\nduration = { low = 30, high = 60, step = 3 }", "unknown key"),
        ("[vary.sweep]\nduration = { low = 0, high = 60, scale = 'log' }", "0 < low < high"),
        (
            "[vary.sweep]\nduration = { low = 1, high = 60, scale = 'dB' }",
            "unknown sweep.duration.scale 'dB'; available: linear, log",
        ),
        ("[vary.sweep]\nduration = { mean = 60, std = 0 }", "std must be a number above 0"),
        ("[vary.sweep]\nduration = { values = [1, 2], relative = 1 }", "true or false"),
        ("[set.sweep]\nduration = 30\n[vary.sweep]\nduration = [30, 60]", "both set and varied"),
        ("[vary.weather]\nturbulence = [0, -1]", "wind at 20 ft of 0 to 150 m/s"),
        ("[vary.weather]\nturbulence = ['light', 'rough']", "available: light, moderate, severe"),
        ("[vary.weather]\nturbulence = [0, 'light']", "mixes numbers and text"),
        (
            "[set.weather]\ngust = 3",
            "weather.gust must be a table (Gust), got 3",
        ),
        ("[set.weather]\ngust.up = 3", "unknown setting of weather.gust 'up'; available: north"),
        ("[set.weather]\ngust.rise = 0", "weather.gust.rise must be a number above 0 s, got 0"),
        ("[set.weather]\nturbulence = { value = 2, relative = true }", "drop relative"),
        ("[vary.recorder]\nnoise = [0.1, 0.2]", "recorder.noise.p"),
        ("[vary.recorder]\nnoise.x = [0.1, 0.2]", "unknown channel 'x'"),
        ("[vary.recorder]\nrate_hz = [50, 100]", "anti-alias"),
        ("[set.recorder]\nlever_arm_corrected = 1", "true or false"),
        ("[set.recorder]\nrotor = { value = 2, relative = true }", "drop relative"),
        ("[vary.vehicle]\nmain_rotor.hub = [1, 2]", "unknown parameter 'main_rotor.hub'"),
        ("[vary.vehicle]\nmain_rotor.chord = ['a', 'b']", "must be a number"),
    ],
)
def test_a_mistake_is_one_clear_line(text, says):
    with pytest.raises(InputError) as caught:
        plan(text)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_file_is_named_in_its_errors(tmp_path):
    path = tmp_path / "noise.toml"
    with pytest.raises(StorageError, match=r"noise\.toml: no such file"):
        read_campaign(path)
    path.write_text("[campaign")
    with pytest.raises(HelisimError, match=r"noise\.toml: not TOML"):
        read_campaign(path)
    path.write_text("[campaign]\nreplicates = 0")
    with pytest.raises(InputError, match=r"noise\.toml: campaign\.replicates"):
        read_campaign(path)
    path.write_text(PLAN)
    assert len(read_campaign(path)) == 24


@pytest.mark.parametrize("path", sorted(CAMPAIGNS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_file_is_a_campaign(path):
    assert len(read_campaign(path)) >= 1
    assert f"helisim campaign scripts/campaigns/{path.name}" in path.read_text(encoding="utf-8")


def test_pooled_sweeps_are_the_campaigns():
    content = {"campaign": {"models": ["yaw_base"], "sweeps": {"yaw_base": ["ped", "lat"]}}}
    campaign = campaign_from(content)
    assert campaign.axes == ("lat", "ped")
    (model,) = campaign.chosen
    assert model == replace(YAW_BASE, sweeps=("ped", "lat"))
    assert campaign.to_dict()["sweeps"] == {"yaw_base": ["ped", "lat"]}
    # a campaign that leaves them goes on with the folders that were begun before there were any
    assert "sweeps" not in campaign_from({}).to_dict()
