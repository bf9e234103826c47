"""Models whose servos are known: exact of the vehicle, where a delay in their place is not."""

import numpy as np
import pytest

from helisim.ident import identify
from helisim.sim import Recorder
from helisim.study.models import (
    HEAVE_SERVO,
    KNOWN_MODELS,
    MODELS,
    ROLLPITCH_SERVO,
    SERVOS,
    YAW_BASE_SERVO,
)
from helisim.study.truth import exact_response, true_values


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


def test_known_models_have_names_of_their_own_and_are_given_their_servos():
    """None is a table of the paper; what they are given is what the bench finds."""
    assert not {one.name for one in KNOWN_MODELS} & {one.name for one in MODELS}
    for model in KNOWN_MODELS:
        assert {one.source for one in model.given.values()} <= {SERVOS}
        assert model.servos_known == bool(model.given)
        for name in model.given:
            assert model.structure.parameter(name).fixed
