"""The experiment's models: tolerances, what they are given, known servos and their bench."""

import numpy as np
import pytest

from helisim.ident import identify
from helisim.sim import Recorder
from helisim.sim.rigs import SWEPT, stick_sweep
from helisim.study.experiment import servo_test
from helisim.study.models import HEAVE_SERVO, MODELS, ROLLPITCH_SERVO, YAW_BASE_SERVO
from helisim.study.truth import exact_response, true_values
from helisim.vehicle import load


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_a_model_is_given_only_what_was_found_before_it(model):
    earlier = [one.name for one in MODELS[: MODELS.index(model)]]
    for name, source in model.given.items():
        assert source.source in (*earlier, "bench", "turntable")
        assert model.structure.parameter(name).fixed
    for name in model.tolerances:
        model.structure.parameter(name)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "percent"),
    # what is left: yaw's small couplings; speeds' smaller derivatives above 6 rad/s; the bank
    # angle, which a response without the conditioning on it still has
    [(YAW_BASE_SERVO, 0.1), (ROLLPITCH_SERVO, 0.15), (HEAVE_SERVO, 0.4)],
    ids=lambda one: getattr(one, "name", ""),
)
def test_the_structure_is_the_vehicle_s(jr700, model, percent):
    """With the servos' true numbers, fitted to the linearised vehicle: every larger parameter."""
    recorder = Recorder.of(jr700)
    servos = {
        f"{which}_{name}": jr700.parameters[f"servo.{which}_{long}"]
        for which in ("swash", "tail")
        for name, long in (("omega", "frequency"), ("zeta", "damping"))
    }
    given = {name: servos[source.name] for name, source in model.given.items()}
    exact = exact_response(jr700, model, recorder, np.geomspace(*model.band, 100))
    found = identify(exact, model.structure.with_fixed(given))
    true = true_values(jr700, model, recorder)
    for name in ("N_r", "N_ped", "tau_f", "L_b", "M_a", "A_lon", "B_lat", "Z_w", "Z_col"):
        if name in found.values:
            assert found.values[name] == pytest.approx(true[name], rel=0.01 * percent)


@pytest.mark.slow
def test_the_servos_are_found_within_their_errors():
    """Of another vehicle's servos than the shipped one's, four numbers within 3.5 errors each."""
    changed = {
        "servo.swash_frequency": 170.0,
        "servo.swash_damping": 0.6,
        "servo.tail_frequency": 190.0,
        "servo.tail_damping": 0.9,
    }
    found = servo_test(load("jr700", parameters=changed), seed=3)
    assert [one.name for one in found.findings] == [
        "swash_omega",
        "swash_zeta",
        "tail_omega",
        "tail_zeta",
    ]
    assert [one.truth for one in found.findings] == list(changed.values())
    for one in found.findings:
        assert abs(one.error) < 3.5 * one.standard_error
        # so that the bench says something at all
        assert one.standard_error < 0.05 * one.value


def test_a_sweep_of_a_stick_rests_before_and_after():
    time = np.linspace(0.0, SWEPT, 12001)
    stick = stick_sweep(time, 0.01)
    assert np.max(np.abs(stick)) == pytest.approx(0.01, rel=0.02)  # it may miss the very crest
    assert not np.any(stick[(time <= 1.0) | (time >= SWEPT - 1.0)])
