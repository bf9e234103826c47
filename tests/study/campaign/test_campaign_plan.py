"""Campaign files: what they can say, and how a mistake is answered."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pytest

from helisim.base.errors import HelisimError, InputError, StorageError, UnknownNameError
from helisim.sim import Gust, Recorder, Weather
from helisim.study.campaign import campaign_from, read_campaign
from helisim.study.models import YAW_BASE
from helisim.study.replicates import render, summarise
from helisim.vehicle import load
from script import SCRIPTS, loaded
from tabled import tabled

CAMPAIGNS = SCRIPTS / "campaigns"
MISTAKES = Path(__file__).with_name("mistakes.txt").read_text(encoding="utf-8").splitlines()
"""Each a campaign's text and what is said of it."""

PLAN = Path(__file__).with_name("plan.toml").read_text(encoding="utf-8")


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
    settings, name = plan(PLAN).replicate(11), "main_rotor.hub_stiffness"
    assert settings.parameters() == {name: pytest.approx(1.2 * jr700.parameters[name], rel=1e-15)}
    recorder = settings.changed("recorder", Recorder.of(jr700))
    assert recorder.noise["p"] == 0.002
    assert recorder.noise["w"] == 4 * 0.02
    assert recorder.latency["r"] == jr700.parameters["recorder_latency.r"]
    assert settings.sweep("lat", jr700.parameters).amplitude == 0.05
    assert settings.sweep("ped", jr700.parameters).amplitude == 0.01
    assert {settings.sweep(axis, jr700.parameters).duration for axis in ("col", "lat")} == {60}


def test_a_factor_multiplies_what_the_axis_has_of_its_own(jr700):
    campaign = plan("[vary.sweep]\namplitude = { values = [0.5, 2.0], relative = true }")
    sticks = [one.sweep("lat", jr700.parameters).amplitude for one in campaign]
    assert sticks == [0.035, 0.14]
    campaign = plan("[vary.sweep]\nlat.band = [[1.0, 40.0], [2.0, 30.0]]")
    bands = [one.sweep("lat", jr700.parameters).band for one in campaign]
    assert bands == [(1.0, 40.0), (2.0, 30.0)]
    assert campaign.replicate(0).sweep("ped", jr700.parameters).band == (0.3, 30.0)


def test_weather_reaches_what_flies():
    text = "[set.weather]\nwind = 2\ngust.down = 1.5\n[vary.weather]\nturbulence = [0, 1.5]"
    campaign = plan(text)
    calm, rough = (one.changed("weather", Weather()) for one in campaign)
    assert calm.dryden is None
    # MIL-F-8785C, section 3.7.3: a tenth of the wind at 20 ft
    assert rough.dryden.rms[2] == pytest.approx(0.15, rel=1e-12)
    assert {one.wind for one in (calm, rough)} == {2}
    assert calm.gust == Gust(down=1.5)
    assert campaign_from({}).replicate(0).changed("weather", Weather()) == Weather()


def test_a_vehicle_is_loaded_with_its_parameters_and_the_integrator():
    text = '[campaign]\nintegrator = "Euler"\n[vary.vehicle]\nmain_rotor.hub_stiffness = [80, 100]'
    vehicle = plan(text).replicate(1).load()
    assert vehicle.model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert vehicle.parameters["main_rotor.hub_stiffness"] == 100
    assert vehicle.derivatives["L_b"] > load().derivatives["L_b"]


@pytest.mark.parametrize("line", MISTAKES)
def test_a_mistake_is_one_clear_line(line):
    text, says = line.split(" => ")
    with pytest.raises(InputError) as caught:
        plan(text.replace(r"\n", "\n"))
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
    text = path.read_text(encoding="utf-8")
    assert f"helisim study campaign scripts/campaigns/{path.name}" in text


def test_pooled_sweeps_are_the_campaigns():
    content = {"campaign": {"models": ["yaw_base"], "sweeps": {"yaw_base": ["ped", "lat"]}}}
    campaign = campaign_from(content)
    assert campaign.axes == ("lat", "ped")
    (model,) = campaign.chosen
    assert model == replace(YAW_BASE, sweeps=("ped", "lat"))
    assert campaign.to_dict()["sweeps"] == {"yaw_base": ["ped", "lat"]}
    # a campaign that leaves them goes on with the folders that were begun before there were any
    assert "sweeps" not in campaign_from({}).to_dict()


TRUTH = -2.0


def row(truth, error, stated, **more):
    found = {"truth": truth, "estimate": truth + (error or 0.0), "standard_error": stated}
    found |= {"cramer_rao": 3.0 * stated}
    found = dict.fromkeys(found) if error is None else found
    return {**more, "method": "designed", **found, "failure": "none" if error is None else None}


def made(count, *, std, bias=0.0, stated=None, noise=1.0, seed=0):
    errors = np.random.default_rng(seed).normal(bias, std, count)
    what = {"noise": noise, "flights": 10, "model": "heave", "parameter": "Z_w"}
    return [row(TRUTH, error, stated or std, **what) for error in errors]


def test_honest_errors_are_found_honest():
    (one,) = summarise(pa.Table.from_pylist(made(4000, std=0.1)))
    assert one.covered == pytest.approx(0.95, abs=4 * (0.95 * 0.05 / 4000) ** 0.5)
    assert one.covered_by_cr == pytest.approx(0.9973, abs=0.004)  # three standard deviations
    assert one.scatter == pytest.approx(0.05, rel=4 / 8000**0.5)
    assert one.stated == pytest.approx(0.05, rel=1e-12)
    assert one.cramer_rao == pytest.approx(0.15, rel=1e-12)
    assert abs(one.bias) < 4 * one.scatter / 4000**0.5
    assert (one.count, one.failed) == (4000, 0)


def test_bias_and_overconfidence_show():
    (one,) = summarise(pa.Table.from_pylist(made(4000, std=0.1, bias=-0.2, stated=0.05)))
    # the truth is -2: an error of -0.2 makes it larger, but the error is signed as the value
    assert one.bias == pytest.approx(-0.1, abs=4 * 0.05 / 4000**0.5)
    assert one.covered < 0.2


def test_groups_are_kept_apart():
    rows = made(50, std=0.1, noise=1.0) + made(70, std=0.4, noise=4.0, seed=1)
    table = pa.Table.from_pylist(rows)
    one, other = summarise(table, by=("noise",))
    assert (one.group["noise"], other.group["noise"]) == (1.0, 4.0)
    assert (one.count, other.count) == (50, 70)
    assert other.scatter > 2.0 * one.scatter
    assert [both.count for both in summarise(table)] == [120]
    with pytest.raises(UnknownNameError, match="available: noise"):
        summarise(table, by=("weather",))


def test_failures_are_counted_not_judged():
    rows = made(50, std=0.1)
    failed = [{**rows[0], **row(TRUTH, None, 0.1)}] * 3
    (clean,) = summarise(pa.Table.from_pylist(rows))
    (one,) = summarise(pa.Table.from_pylist(rows + failed))
    assert (one.count, one.failed) == (50, 3)
    assert (one.bias, one.scatter, one.covered) == (clean.bias, clean.scatter, clean.covered)
    (none,) = summarise(pa.Table.from_pylist(failed))
    assert (none.count, none.failed) == (0, 3)
    assert "nan" in render([none])


@pytest.fixture(scope="module")
def study():
    return loaded("proof/campaign_study")


def rows_of(errors, *, duration=90, flights=1, turbulence=0.0):
    what = {"sweep.duration": duration, "weather.turbulence": turbulence, "flights": flights}
    what |= {"model": "yaw_base", "parameter": "N_r"}
    times = [None if error is None else float(duration * flights) for error in errors]
    return [
        row(-1.0, error, 0.01, replicate=number, flight_time=time, **what)
        for number, (error, time) in enumerate(zip(errors, times))
    ]


KEY = ("yaw_base", "N_r")
GOOD, BAD = [0.04, -0.04] * 10, [0.04] * 18 + [0.06, -0.06]


@tabled("flown", "least")
def test_the_shortest_flight_is_the_least_from_which_on_all_suffice(study, flown, least):
    rows = [
        row
        for (duration, flights), errors in flown.items()
        for row in rows_of(errors, duration=duration, flights=flights)
    ]
    assert study.need(rows, KEY, 0.05) == least


def test_intervals_may_hold_the_mean_and_miss_the_truth(study, capsys):
    """Errors of 10 and 13 % with 1 % of standard error: off the truth, near their mean."""
    rows = rows_of([0.10, 0.13] * 10, turbulence=0.0) + rows_of([-0.01, 0.01] * 10, turbulence=3.0)
    study.apart(rows, ("weather.turbulence",), {KEY: -0.95})
    *_, line = capsys.readouterr().out.splitlines()
    # half of all within 1.96 % of the truth, all within 1.96 % of their condition's mean;
    # the bias is the mean of 11.5 % and none, the structure's -0.95 against -1
    assert line.split() == ["yaw_base", "N_r", "50.0", "100.0", "5.75", "5.00"]


def test_coverage_is_judged_at_each_number_and_length_of_sweeps(study, capsys):
    """In 90 % of 20 replicates with a standard error of 1 %; no estimate holds no truth."""
    near, far = [0.015] * 18, [0.03] * 2
    rows = rows_of(near + far, flights=3) + rows_of(near + far[1:] + [None], duration=30, flights=3)
    study.verdict(rows + rows_of(near[1:] + far + [None], flights=10))
    *_, line, short, few, many = capsys.readouterr().out.splitlines()
    assert line.split() == ["yaw_base", "N_r", "90", "90", "85"]
    assert (short, few) == ("3 x 30 s: pass", "3 x 90 s: pass")
    assert many == "10 x 90 s: fail, below 90%: yaw_base N_r"


def test_the_papers_bounds_are_the_limits(study):
    """Cramér-Rao bounds of its Table 3; 5 % for N_r, for which it has none."""
    # Wu and Chen, Table 3, IN1: CR of L_b 13.9 % and of M_a 7.54 %
    found = [100.0 * study.bound(model, name) for model, name in study.WANTED]
    assert found == pytest.approx([5.0, 13.9, 7.54], rel=1e-12)
