"""An LQG law of an identified plant: the model it is made of, predicted and flown."""

import mujoco
import numpy as np
import pytest

import helisim as hs
from exact_fits import OMEGA, ROLL, ROLLPITCH, found
from helisim import ident
from helisim.design.lqg import lqg_model
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins
from helisim.sim import Recorder
from helisim.study.experiment import fly_sweeps
from helisim.vehicle.addresses import addresses

YAW = {"N_r": -0.8, "N_ped": 48.0, "tau_r_base": 0.014}
TRACKED = (
    hs.Tracked(output="theta", stick="LON", gain=0.6, frequency=6.0),
    hs.Tracked(output="phi", stick="LAT", gain=0.6, frequency=6.0),
    hs.Tracked(output="r", stick="PED", gain=3.0, frequency=6.0, error=0.3),
)
WEIGHTS = hs.LqgWeights(output={"p": 1.0, "q": 1.0})
STICKS = {"lat": ("phi", 2), "lon": ("theta", 1), "ped": ("r", 3)}


@pytest.fixture(scope="module")
def plant():
    """The JR700 about as it is, as three models say it, leaning by 4 degrees."""
    heave = {"Z_w": -0.9, "Z_col": -40.0, "tau_col": 0.01}
    return hs.Plant(
        (
            found(ident.structures.yaw_base, **YAW),
            found(ROLLPITCH, **ROLL, tau_lat=0.004, tau_lon=0.004),
            found(ident.structures.heave, **heave),
        ),
        tilt=(0.067, 0.0),
    )


def test_model_is_the_plant_without_speeds_and_collective(plant):
    """Above the speeds' frequencies it has the plant's responses; 10 to 60 rad/s."""
    model = lqg_model(plant)
    assert model.inputs == ("lon", "lat", "ped")
    assert model.outputs == ("p", "q", "r", "phi", "theta")
    fast = OMEGA[OMEGA > 10.0]
    whole = plant.response(fast)
    rows = [plant.outputs.index(name) for name in model.outputs[:3]]
    columns = [plant.inputs.index(name) for name in model.inputs]
    held = np.sinc(fast * plant.period / (2.0 * np.pi))
    own = model.response(fast)[:3]
    # g A_u / w^2 of the moments' answer to a tilt is what the speeds do: 5e-3 at 10 rad/s
    assert np.abs(own - held * whole[np.ix_(rows, columns)]).max() < 5e-3 * np.abs(whole).max()


def test_model_has_no_mode_that_a_law_could_not_stabilise(plant):
    """The law of the plant's own model is stable with the whole plant, speeds and all."""
    law = hs.lqg(plant, TRACKED, WEIGHTS)
    poles = ClosedLoop(plant, law.linear(plant.period)).poles
    # heading and collective are nobody's: two poles at 0, and w's own
    assert np.sort(poles.real)[-1] < 1e-3


def stepped(vehicle, column, size, seconds):
    """Return phi, theta and r after a step of a stick, sticks alone at work, (n_time, 3)."""
    data, where = vehicle.hovering(), addresses(vehicle.model)
    rows = []
    with hs.installed():
        mujoco.mj_step(vehicle.model, data)  # a law starts where its servos and sticks stand
        data.ctrl[where.control + column] += size
        for _ in range(round(seconds / vehicle.model.opt.timestep)):
            w, x, y, z = data.qpos[3:7]
            roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
            rows.append((roll, -np.arcsin(2.0 * (w * y - z * x)), -data.qvel[5]))
            mujoco.mj_step(vehicle.model, data)
    return np.array(rows)


@pytest.mark.study
def test_law_of_an_identified_plant_flies_as_predicted(jr700):
    flights = fly_sweeps(jr700, 3, 2, 2, Recorder.of(jr700), None, lambda _: None)[0]
    plant = hs.identify_for_design(flights)
    law = hs.lqg(plant, TRACKED, WEIGHTS)
    predicted = ClosedLoop(plant, law.linear(plant.period))
    flying = jr700.with_controller(law)
    exact = hs.exact_loop(flying)
    for axis, (output, column) in STICKS.items():
        said, true = (margins(loop.broken(axis)) for loop in (predicted, exact))
        assert said.crossover == pytest.approx(true.crossover, rel=0.02)
        assert said.least_phase == pytest.approx(true.least_phase, abs=np.radians(1.5))
        history = predicted.step(axis, size=0.2, duration=1.5)
        flown = stepped(flying, column, 0.2, 1.5)
        every = round(plant.period / jr700.model.opt.timestep)
        own = ("phi", "theta", "r").index(output)
        moved = flown[::every, own] - flown[0, own]
        wanted = history.signals[output][: moved.size]
        # 7 degrees and 0.6 rad/s, nonlinear and with speed that grows: 1.2 % off at most, of
        # which a quarter is left in steps of a quarter
        assert np.max(np.abs(moved - wanted)) < 0.02 * np.max(np.abs(wanted))
