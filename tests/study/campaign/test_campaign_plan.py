"""Campaign files: what they can say, and how a mistake is answered."""

import json
import tomllib
from dataclasses import replace

import mujoco
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
main_rotor.hub_stiffness = { values = [0.8, 1, 1.2], relative = true }
"""


def plan(text):
    return campaign_from(tomllib.loads(text))


def test_a_grid_has_every_combination_and_replicate():
    campaign = plan(PLAN)
    assert json.loads(json.dumps(campaign.to_dict()))["replicates"] == 2
    assert len(campaign) == 24
    replicates = list(campaign)
    assert [one.point for one in replicates] == [*range(12), *range(12)]
    assert [one.seed for one in replicates] == list(range(5, 29))
    assert len({tuple(one.values.items()) for one in replicates}) == 12
    varied = {"recorder.noise", "recorder.noise.p", "vehicle.main_rotor.hub_stiffness"}
    assert set(replicates[0].values) == varied
    assert campaign.axes == ("col", "ped")


def test_settings_reach_what_flies(jr700):
    settings, name = plan(PLAN).replicate(11).settings, "main_rotor.hub_stiffness"
    assert settings.parameters() == {name: pytest.approx(1.2 * jr700.parameters[name], rel=1e-15)}
    recorder = settings.recorder(jr700)
    assert recorder.noise["p"] == 0.002
    assert recorder.noise["w"] == 4 * 0.02
    assert recorder.latency["r"] == jr700.parameters["recorder_latency.r"]
    assert settings.sweep("lat", jr700.parameters).amplitude == 0.05
    assert settings.sweep("ped", jr700.parameters).amplitude == 0.01
    assert {settings.sweep(axis, jr700.parameters).duration for axis in ("col", "lat")} == {60}


def test_a_factor_multiplies_what_the_axis_has_of_its_own(jr700):
    campaign = plan("[vary.sweep]\namplitude = { values = [0.5, 2.0], relative = true }")
    sticks = [one.settings.sweep("lat", jr700.parameters).amplitude for one in campaign]
    assert sticks == [0.035, 0.14]
    campaign = plan("[vary.sweep]\nlat.band = [[1.0, 40.0], [2.0, 30.0]]")
    bands = [one.settings.sweep("lat", jr700.parameters).band for one in campaign]
    assert bands == [(1.0, 40.0), (2.0, 30.0)]
    assert campaign.replicate(0).settings.sweep("ped", jr700.parameters).band == (0.3, 30.0)


def test_weather_reaches_what_flies():
    text = "[set.weather]\nwind = 2\ngust.down = 1.5\n[vary.weather]\nturbulence = [0, 1.5]"
    campaign = plan(text)
    calm, rough = (one.settings.weather for one in campaign)
    assert calm.dryden is None
    # MIL-F-8785C, section 3.7.3: a tenth of the wind at 20 ft
    assert rough.dryden.rms[2] == pytest.approx(0.15, rel=1e-12)
    assert {one.wind for one in (calm, rough)} == {2}
    assert calm.gust == Gust(down=1.5)
    assert campaign_from({}).replicate(0).settings.weather == Weather()


def test_a_vehicle_is_loaded_with_its_parameters_and_the_integrator():
    text = '[campaign]\nintegrator = "Euler"\n[vary.vehicle]\nmain_rotor.hub_stiffness = [80, 100]'
    vehicle = plan(text).replicate(1).settings.load()
    assert vehicle.model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert vehicle.parameters["main_rotor.hub_stiffness"] == 100
    assert vehicle.derivatives["L_b"] > load().derivatives["L_b"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[campain]", "unknown section 'campain'; available: campaign, set, vary"),
        ("[campaign]\nreplicate = 3", "unknown key of [campaign] 'replicate'"),
        ("[campaign]\nreplicates = 0", "replicates must be an integer 1 or more, got 0"),
        ('[campaign]\nvehicle = "jr800"', "unknown vehicle 'jr800'; available: "),
        ('[campaign]\nmodels = ["heave", "heave"]', "none twice"),
        ('[campaign]\nmodels = ["yaw_gyro"]', "takes values from yaw_base"),
        ("[campaign]\nflights = 3\nidentified_after = [4]", "must be 1 to 3, got [4]"),
        ("[campaign.sweeps]\nyaw = ['ped']", "unknown model of sweeps 'yaw'"),
        ("[campaign.sweeps]\nheave = []", "sweeps.heave needs one item or more"),
        ("[vary.rotor]\nspeed = [1, 2]", "unknown section of [vary] 'rotor'"),
        ("[vary.sweep]\nlength = [1, 2]", "unknown setting of sweep 'length'; available: duration"),
        ("[vary.sweep]\naxis = ['lat', 'col']", "unknown setting of sweep 'axis'"),
        ("[vary.sweep]\nduration = 30", "expected a value under [set.sweep], two or more under"),
        ("[set.sweep]\nduration = { values = [30, 60] }", "expected a value under [set.sweep]"),
        ("[vary.sweep]\nduration = [30, '60']", "values of two kinds"),
        ("[vary.sweep]\nduration = [30, 30]", "a value twice"),
        ("[vary.sweep]\namplitude = [0.1, 0.7]", "(0, 0.5]"),
        ("[vary.sweep]\nduration.lat = [30, 60]", "duration has no parts"),
        ("[vary.sweep]\nduration = { values = [1, 2], step = 3 }", "unknown key"),
        ("[vary.sweep]\nduration = { values = [1, 2], relative = 1 }", "true or false"),
        ("[set.sweep]\nduration = 30\n[vary.sweep]\nduration = [30, 60]", "both set and varied"),
        ("[set.weather]\ngust.up = 3", "unknown setting of weather.gust 'up'; available: north"),
        ("[set.weather]\nturbulence = { value = 2, relative = true }", "drop relative"),
        ("[vary.recorder]\nnoise = [0.1, 0.2]", "recorder.noise must be a table"),
        ("[vary.recorder]\nnoise.x = [0.1, 0.2]", "unknown channel 'x'"),
        ("[vary.recorder]\nrate_hz = [50, 100]", "anti-alias"),
        ("[vary.vehicle]\nmain_rotor.hub = [1, 2]", "unknown parameter 'main_rotor.hub'"),
    ],
)
def test_a_mistake_is_one_clear_line(text, says):
    with pytest.raises(InputError) as caught:
        plan(text)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_file_is_named_in_its_errors(tmp_path):
    path = tmp_path / "noise.toml"
    for text, error, says in (
        (None, StorageError, "no such file"),
        ("[campaign", HelisimError, "not TOML"),
        ("# nothing yet\n", InputError, r"it is empty; expected \[campaign\]"),
        ("[campaign]\nreplicates = 0", InputError, r"campaign\.replicates"),
    ):
        if text is not None:
            path.write_text(text)
        with pytest.raises(error, match=rf"noise\.toml: {says}"):
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
