"""What the verdict of a fit and a composite's search step rest on."""

from dataclasses import replace

import numpy as np
import pytest

from helisim.errors import IdentificationError, InputError, UnknownNameError
from helisim.ident import (
    FrequencyResponse,
    Parameter,
    frequency_response,
    identify,
    structures,
    verify,
)
from helisim.ident.composite import _COHERENCE_WEIGHT, _Aim, _cost, _step
from helisim.ident.evaluate import response
from helisim.ident.export import rounded
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

GRID = np.geomspace(0.5, 20.0, 40)
TRUE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}


def fitted(structure=structures.heave):
    exact = response(structures.heave, TRUE, GRID)
    data = FrequencyResponse.exact(GRID, exact, inputs=structure.inputs, outputs=structure.outputs)
    return identify(data, structure)


@pytest.fixture(scope="module")
def fit():
    return fitted()


def test_a_fit_is_in_order_only_if_nothing_is_amiss(fit):
    """One complaint is enough: each of the four alone takes the verdict away."""
    assert fit.ok
    name, sound = next(iter(fit.parameters.items()))
    others = {key: one for key, one in fit.parameters.items() if key != name}
    assert not replace(fit, converged=False).ok
    assert not replace(fit, costs=dict.fromkeys(fit.costs, 1e4)).ok
    assert not replace(fit, parameters={name: replace(sound, at_bound=True), **others}).ok
    vague = replace(sound, cramer_rao=abs(sound.value), insensitivity=abs(sound.value))
    assert not replace(fit, parameters={name: vague, **others}).ok


def test_a_parameter_is_at_its_bound_when_the_data_want_it_beyond():
    """Z_w = -0.8 within -2 to 0 is free; within -0.7 to 0, or -2 to -0.9, it ends at the edge."""

    def bounded(low, high):
        old = structures.heave
        new = tuple(
            replace(one, start=0.5 * (low + high), bounds=(low, high)) if one.name == "Z_w" else one
            for one in old.parameters
        )
        return fitted(replace(old, parameters=new))

    assert bounded(-2.0, 0.0).at_bound == ()
    assert bounded(-0.7, 0.0).at_bound == ("Z_w",)
    assert bounded(-2.0, -0.9).at_bound == ("Z_w",)
    # a thousandth of the range inside is not the edge, whose width is a millionth of it
    assert bounded(-0.802, 0.0).at_bound == ()


def test_a_parameters_size_is_its_scale_or_its_start_or_one():
    """The scale counts first, then the size of the start; a start of zero has none."""
    assert Parameter("k", "1", -4.0, scale=3.0).magnitude == 3.0
    assert Parameter("k", "1", -4.0).magnitude == 4.0
    assert Parameter("k", "1", 0.0).magnitude > 0.0
    for scale in (0.0, -1.0, np.inf):
        with pytest.raises(InputError, match="expected > 0"):
            Parameter("k", "1", 1.0, scale=scale)


def test_percent_is_of_the_values_size_and_endless_of_nothing(fit):
    """A bound of 0.5 is 50 % of -1, infinitely much of 0, and none of either if it is 0."""
    one = replace(fit["Z_w"], cramer_rao=0.5, insensitivity=0.25)
    assert replace(one, value=-1.0).cr_percent == 50.0
    assert replace(one, value=-1.0).insensitivity_percent == 25.0
    assert replace(one, value=0.0).cr_percent == np.inf
    assert replace(one, value=0.0, cramer_rao=0.0).cr_percent == 0.0


def test_a_verdict_names_whom_a_parameter_is_correlated_with(fit):
    """In both directions, and nobody where no correlation exceeds nine tenths."""
    names = [parameter.name for parameter in fit.structure.free]
    apart = replace(fit, correlation=np.eye(len(names)))
    assert all("correlated" not in apart.verdict(name) for name in names)
    tied = np.eye(len(names))
    tied[0, 1] = tied[1, 0] = -0.95
    together = replace(fit, correlation=tied)
    for one, other in (names[:2], names[1::-1]):
        assert together.verdict(one) == f"{apart.verdict(one)}, correlated with {other}"


def test_only_signals_of_a_structure_are_renamed():
    """The message names what there is."""
    with pytest.raises(UnknownNameError, match="'ped'; available: col, w"):
        structures.heave.renamed({"ped": "PED"})


@pytest.mark.parametrize("frequency", [[1.0, 1.0, 2.0], [0.0, 1.0, 2.0], [1.0, 3.0, 2.0], []])
def test_frequencies_are_positive_and_increasing(frequency):
    """None twice, none zero, none out of order, and one at least."""
    exact = np.ones((1, 1, len(frequency)), dtype=complex)
    with pytest.raises(InputError, match="frequency"):
        FrequencyResponse.exact(frequency, exact, inputs=("col",), outputs=("w",))


def test_a_value_of_negligible_error_has_seven_digits():
    """An error of a ten-millionth of the value or less isn't stated."""
    assert rounded(1.23456789, 1e-8) == ("1.234568", "")
    assert rounded(1.23456789, 1e-7) == ("1.234568", "")
    assert rounded(1.23456789, 2e-7)[1] != ""


@pytest.mark.parametrize("seed", range(3))
def test_a_composites_step_is_gauss_and_newtons(seed):
    """-(J'J)^-1 J'r of the residuals, with J by differences: rows of the identity and one more."""
    random = np.random.default_rng(seed)
    target = np.array([1.0, 1.0, 0.7, 0.5]) + 0.1 * random.normal(size=4)
    unit, g2, g2_unit = random.uniform(0.5, 2.0, size=4), 0.6, 0.2
    z = target + 0.1 * random.normal(size=4)
    aim = _Aim(target[:, None], unit[:, None], np.array([g2]), np.array([g2_unit]))

    def residuals(at):
        gxx, gyy, real, imaginary = at * unit
        coherence = (real**2 + imaginary**2) / (gxx * gyy)
        misfit = np.sqrt(_COHERENCE_WEIGHT) * (coherence - g2) / g2_unit
        return np.append(at - target, misfit)

    steps = 1e-6 * np.eye(4)
    jacobian = np.array([(residuals(z + d) - residuals(z - d)) / 2e-6 for d in steps]).T
    expected = np.linalg.lstsq(jacobian, -residuals(z), rcond=None)[0]
    # central differences of 1e-6 are good to 1e-9 here
    assert _step(z[:, None], aim)[:, 0] == pytest.approx(expected, abs=1e-7)
    assert _cost(z[:, None], aim)[0] == pytest.approx(np.sum(residuals(z) ** 2), rel=1e-12)


def noisy(seed, **provenance):
    """A record of p that follows lat with as much noise as signal."""
    random = np.random.default_rng(seed)
    values = random.normal(size=(3000, 2))
    values[:, 1] += values[:, 0]
    time = 0.02 * np.arange(len(values))
    return FlightRecord(time, values, (channel("lat"), channel("p")), provenance)


def test_coherence_of_half_signal_and_half_noise_is_a_half():
    """Of one input the multiple coherence is the ordinary one, near 1/2 in the composite too."""
    found = frequency_response(noisy(1), inputs=("lat",), outputs=("p",), band=(2.0, 40.0))
    assert np.mean(found.multiple_coherence) == pytest.approx(0.5, abs=0.1)
    # 60 s and windows of 20 s and less: the estimate scatters by 0.1 to 0.2 at a frequency
    assert np.mean(found.coherence) == pytest.approx(0.5, abs=0.1)


def test_a_flight_that_was_terminated_early_is_refused_by_default():
    """By the frequency response and by the verification."""
    over = noisy(1, ended={"at": 12.0, "why": "p is 30 rad/s", "state": {}})
    asked = {"inputs": ("lat",), "outputs": ("p",), "band": (2.0, 40.0)}
    with pytest.raises(IdentificationError, match="use_ended=True"):
        frequency_response(over, **asked)
    assert frequency_response(over, use_ended=True, **asked).coherence.size
    heave = fitted()
    flown = replace(over, channels=(channel("col"), channel("w")))
    with pytest.raises(IdentificationError, match="use_ended=True"):
        verify(heave, flown)
    assert verify(heave, flown, use_ended=True)


def test_a_structure_keeps_its_own_delays_and_constants():
    """A dictionary that it was made from may change later."""
    delays = dict(structures.heave.input_delays)
    mine = replace(structures.heave, input_delays=delays)
    delays.clear()
    assert mine.input_delays == structures.heave.input_delays
    with pytest.raises(TypeError):
        mine.constants["g"] = 1.0
