"""Frequency responses: conditioning, feedback, flags, and refusals that say what to do."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from helisim.base.errors import IdentificationError, InputError, StorageError
from helisim.base.note import Note
from helisim.ident import (
    ClosedLoopWarning,
    CrossControlWarning,
    FrequencyResponse,
    RecordQualityWarning,
    frequency_response,
    identify,
    structures,
    verify,
)
from helisim.ident.frf import _coherent, _disagreements, excited_sticks, resolved_band, worth_more
from helisim.ident.scatter import LineWeights, LocalScatter
from helisim.records.record import channel
from ident_data import GRID, HEAVE, fitted, record
from tabled import rows, tabled

STEP = 0.05
BAND = (2.0, 20.0)


def two_inputs(seed, coupling=0.0, samples=4000, off=1.0):
    """Return p = 0.3/(1 - 0.7/z) lat + 0.2 lon, with lon partly a copy of lat."""
    random = np.random.default_rng(seed)
    lat = random.standard_normal(samples)
    lon = coupling * lat + off * random.standard_normal(samples)
    return record(lat=lat, lon=lon, p=lfilter([0.3], [1.0, -0.7], lat) + 0.2 * lon)


def estimated(flight, inputs=("lat", "lon"), **more):
    return frequency_response(flight, inputs=inputs, outputs="p", band=BAND, **more)


def truth(frequency):
    return 0.3 / (1.0 - 0.7 * np.exp(-1j * frequency * STEP))


def test_roles_of_inputs_do_not_change_an_estimate():
    flight = two_inputs(5, coupling=0.3)
    both, one = estimated(flight), estimated(flight, "lat", conditioning="lon")
    np.testing.assert_allclose(one.response[0, 0], both.response[0, 0], rtol=1e-9)
    assert one.conditioning == ("lon",)
    joint = estimated(flight, reference=("lat", "lon"))
    np.testing.assert_allclose(joint.response, both.response, rtol=1e-9)
    np.testing.assert_allclose(joint.coherence, both.coherence, rtol=1e-6)


def test_inputs_that_move_together_are_told():
    with pytest.warns(CrossControlWarning, match="'lat' and 'lon'"):
        frf = estimated(two_inputs(7, coupling=1.0, off=0.5))
    assert len(frf.flags) == 1
    assert "add records" in frf.flags[0]
    assert np.mean(frf.cross_control_coherence[0, 1]) > 0.5
    with pytest.raises(IdentificationError, match="can't be told apart; add records"):
        estimated(two_inputs(8, coupling=1.0, off=0.0))


FLIGHT = two_inputs(1)
STILL = record(lat=np.full(4000, 0.25), p=FLIGHT["p"])


@tabled("changes", "error", "message")
def test_bad_input_is_refused_with_advice(changes, error, message):
    good = {"records": FLIGHT, "inputs": "lat", "outputs": "p", "band": BAND}
    with pytest.raises(error, match=message):
        frequency_response(**{**good, **changes})


def test_a_response_checks_its_fields():
    with pytest.raises(InputError, match="expected"):
        FrequencyResponse.exact([1.0, 2.0], np.ones((1, 2)), inputs=["lat"], outputs=["p"])
    for frequency in ([1.0, 1.0, 2.0], [0.0, 1.0, 2.0], [1.0, 3.0, 2.0], []):
        exact = np.ones((1, 1, len(frequency)), dtype=complex)
        with pytest.raises(InputError, match="frequency"):
            FrequencyResponse.exact(frequency, exact, inputs=("col",), outputs=("w",))
    data = FrequencyResponse.exact(
        [1.0, 2.0, 3.0], np.ones((1, 1, 3)), inputs=["lat"], outputs=["p"]
    )
    plain = json.loads(json.dumps(data.to_dict()))
    assert FrequencyResponse.from_dict(plain) == data
    for field, item, message in rows(globals(), "test_a_response_checks_its_fields"):
        with pytest.raises(InputError, match=message):
            FrequencyResponse.from_dict({**plain, field: item})


def test_a_point_is_usable_from_a_coherence_of_six_tenths():
    ones = np.ones((1, 1, GRID.size))
    still = FrequencyResponse.exact(GRID, ones, inputs=["col"], outputs=["w"])
    some = replace(
        still, coherence=np.where(GRID < 1.0, 0.59, np.where(GRID < 2.0, 0.6, 0.61)) * ones
    )
    assert np.array_equal(some.usable()[0, 0], GRID >= 1.0)
    with pytest.raises(IdentificationError) as raised:
        identify(replace(still, coherence=0.34 * ones), structures.heave, band=(1.0, 10.0))
    inside = int(np.sum((GRID >= 1.0) & (GRID <= 10.0)))
    assert f"at most 0.34 at {inside} frequencies" in str(raised.value)
    assert "(frequency response: 0.5 to 20 rad/s)" in str(raised.value)


def noisy(seed, **provenance):
    values = np.random.default_rng(seed).normal(size=(3000, 2))
    return record(0.02, provenance, lat=values[:, 0], p=values[:, 1] + values[:, 0])


def test_coherence_of_half_signal_and_half_noise_is_a_half():
    found = frequency_response(noisy(1), inputs="lat", outputs="p", band=(2.0, 40.0))
    assert np.mean(found.multiple_coherence) == pytest.approx(0.5, abs=0.1)
    assert found.frequency == pytest.approx(np.geomspace(2.0, 40.0, 106))  # 80 a decade
    # 60 s and windows of 20 s and less: the estimate scatters by 0.1 to 0.2 at a frequency
    assert np.mean(found.coherence) == pytest.approx(0.5, abs=0.1)


def test_a_flight_that_was_terminated_early_is_refused_by_default():
    over = noisy(1, ended={"at": 12.0, "why": "p is 30 rad/s", "state": {}})
    asked = {"inputs": "lat", "outputs": "p", "band": (2.0, 40.0)}
    for flights, told in (
        ([noisy(2), over], r"record 2 .*because p is 30 rad/s[^,]*; .*use_ended=True"),
        ([over, over, noisy(2), over], r"record 1 .*, and 2 more such; leave it out"),
    ):
        with pytest.raises(IdentificationError, match=told):
            frequency_response(flights, **asked)
    assert frequency_response(over, use_ended=True, **asked).coherence.size
    heave = fitted(structures.heave, HEAVE)
    flown = replace(over, channels=(channel("col"), channel("w")))
    with pytest.raises(IdentificationError, match="use_ended=True"):
        verify(heave, flown)
    assert verify(heave, flown, use_ended=True)


# Joint and direct estimates side by side

LOOP = {"inputs": "ped", "outputs": "r", "band": BAND, "reference": "PED"}


def loop(seed, gain, disturbance, samples=6000):
    """Return r = 0.3/(1 - 0.7/z) ped + v, ped = PED - gain r one sample ago, v slow noise."""
    random = np.random.default_rng(seed)
    stick = random.standard_normal(samples)
    slow = disturbance * lfilter([0.3], [1.0, -0.7], random.standard_normal(samples))
    ped, r, state = np.zeros(samples), np.zeros(samples), 0.0
    for k in range(samples):
        ped[k] = stick[k] - (gain * r[k - 1] if k else 0.0)
        state = 0.7 * state + 0.3 * ped[k]
        r[k] = state + slow[k]
    return record(PED=stick, ped=ped, r=r)


def test_the_direct_estimate_stands_beside_the_joint_one():
    with pytest.warns(ClosedLoopWarning, match="r/ped disagree beyond their errors"):
        joint = frequency_response(loop(1, 1.0, 1.0), **LOOP)
    assert len(joint.flags) == 1
    assert "use the joint one" in joint.flags[0]
    assert "rad/s" in joint.flags[0]
    alone = frequency_response(loop(1, 1.0, 1.0), **{**LOOP, "reference": None})
    # Rounding: products over four signals are summed in another order than over two.
    np.testing.assert_allclose(joint.direct.response, alone.response, rtol=1e-7)
    assert joint.direct.reference == ()
    assert alone.direct is None
    right, wrong = (
        np.abs(one.response[0, 0] / truth(one.frequency) - 1.0) for one in (joint, joint.direct)
    )
    assert np.mean(right) < 0.5 * np.mean(wrong)
    again = FrequencyResponse.from_dict(json.loads(json.dumps(joint.to_dict())))
    np.testing.assert_array_equal(again.response, joint.response)
    assert again.scatter is None  # what records alone give isn't in the plain data
    with pytest.warns(ClosedLoopWarning, match="r/ped disagree beyond their errors"):
        frequency_response(loop(1, 1.0, 1.0), **LOOP, estimator="windows")


@pytest.mark.parametrize(("gain", "disturbance"), [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize("how", [{}, {"estimator": "windows"}], ids=str)
def test_agreeing_estimates_raise_no_warning(gain, disturbance, how):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert frequency_response(loop(0, gain, disturbance), **LOOP, **how).flags == ()


@tabled("line", "spread", "limit")
def test_estimates_disagree_where_their_gap_is_beyond_chance(line, spread, limit):
    """Half a percent, both variances, twelve times the gap's own; lines in common have none."""
    omega = np.geomspace(1.0, 10.0, 41)
    weight = LineWeights(np.array([0]), np.array([1]), np.full((1, 1, 1, 1), line, np.complex64))
    ones = np.ones((1, 1, 41))
    known = LocalScatter(omega, (weight,) * 41, ones[None], ones.T + 0j, 0 * ones, spread * ones)
    exact = FrequencyResponse.exact(omega, 2.0 * ones, inputs=["lat"], outputs=["p"])
    known = replace(known, noise=4.0 * known.noise, spread=2.0 * known.spread)
    joint = replace(exact, scatter=known)
    for places, factor, coherence, told in (
        ([0, 8], 1.01, 0.2, True),
        ([0, 8], 0.99, 1.0, False),
        ([0, 8], 1.01, 0.19, False),
        ([8], 1.01, 1.0, False),  # one of six is chance
    ):
        gap = np.ones(41)
        gap[places] += factor * limit
        gap[places[-1]] += 1e-4 * told
        direct = replace(joint, response=gap * joint.response)
        found = list(_disagreements(replace(joint, coherence=coherence * ones), direct))
        assert len(found) == told
        text = "p/lat disagree beyond their errors at 2 of 6 frequencies, by "
        text += f"{100.0 * (factor * limit + 1e-4):.0f} % at {omega[8]:.3g} rad/s"
        assert all(text in one for one in found)


def test_sticks_are_the_reference_where_they_move_and_excite_enough():
    """From 0.9 of the direct estimate's coherent points, or 0.25 where gusts go round a loop."""
    omega = np.arange(1.0, 101.0)
    exact = FrequencyResponse.exact(omega, np.ones((1, 1, 100)), inputs=["lat"], outputs=["p"])
    assert worth_more(exact) is exact
    for evidence, enough in (((), 72.0), ((Note("feedback", ""),), 20.0)):
        some = 1.0 * (omega <= 80.0)[None, None]
        direct = replace(exact, coherence=some, evidence=evidence)
        for count, stays in ((enough + 1.0, True), (enough - 1.0, False)):
            joint = replace(exact, coherence=1.0 * (omega <= count)[None, None], direct=direct)
            assert worth_more(joint) is (joint if stays else direct)
    moves = np.sin(np.arange(500.0))
    flown = record(0.02, lat=moves, LAT=0.0 * moves, lon=moves, LON=moves, ped=moves)
    for inputs, sticks in ((["lon"], ("LON",)), (["lat", "lon"], ()), (["lon", "ped"], ())):
        assert excited_sticks([flown, flown], inputs) == sticks
    # a window of half a record and a fifth of all (Tischler and Remple); ten samples a period
    for count, window in ((1, 9.98 / 5.0), (5, 9.98 / 2.0)):
        expected = (2.0 * np.pi / window, 10.0 * np.pi)
        assert resolved_band([flown] * count) == pytest.approx(expected, rel=2e-4)


def test_inputs_are_coherent_beyond_a_half_and_one_beyond_098():
    omega = np.array([1.0, 2.0, 3.0])
    for mean, told in ((0.5, False), (0.51, True), (0.98, True)):
        cross = np.ones((2, 2, 3))
        cross[0, 1] = cross[1, 0] = mean + np.array([-0.01, 0.02, -0.01])
        found = list(_coherent(cross, ["lat", "lon"], omega))
        assert len(found) == told
        assert all(f"of {mean:.2f} (largest at 2 rad/s), expected at most 0.5" in x for x in found)
    with pytest.raises(IdentificationError, match=r"'lat' and 'lon' have .* 0\.99"):
        list(_coherent(0.0 * cross + 0.99, ["lat", "lon"], omega))


# Records with spikes, frozen runs, or inputs at their stops


def lagged(seed, spike=False, dead=False, stop=0.0, output="p", least=-0.5):
    stick = np.convolve(np.random.default_rng(seed).standard_normal(6001), np.ones(5) / 5.0, "same")
    if stop:
        stick = np.clip(0.1 * stick, -0.49, 0.49)
        stick[2000 : 2000 + round(100 * stop)] = -0.5
        stick[3000:3200] = np.where(least < -0.5, least, stick[3000:3200])
    rate = np.zeros(stick.size)
    for k in range(1, stick.size):
        rate[k] = rate[k - 1] + 0.05 * (stick[k - 1] - rate[k - 1])
    if spike:
        rate[3000] += 5.0
    if dead:
        rate[4000:4100] = rate[4000]
    return record(0.01, **{"lat": stick, output: rate})


SPIKES = "record 2: 'p' has 1 samples that are spikes, the first at 30 s"
FROZEN = "record 3: 'p' is frozen, in 1 places, first from 40 to 40.99 s"
STOPPED = "record 2: 'lat' is at its stop for 4 s, first at 20 s"


@tabled("flights", "output", "flags")
def test_faults_of_records_are_flagged(flights, output, flags, recwarn):
    found = frequency_response(flights, inputs="lat", outputs=output, band=(1.0, 20.0)).flags
    assert len(found) == len(recwarn) == len(flags)
    assert all(one.category is RecordQualityWarning for one in recwarn)
    assert all("leave that out" in flag or "helisim.screen" in flag for flag in found)
    assert all(told in flag for told, flag in zip(flags, found))


def test_csv_is_for_other_programs(tmp_path):
    heave = frequency_response(noisy(3), inputs="lat", outputs="p", band=(2.0, 20.0))
    heave.save(tmp_path / "heave.csv")
    first, heading, *rows = (tmp_path / "heave.csv").read_text().splitlines()
    assert json.loads(first.removeprefix("# provenance: "))["records"] == list(heave.sources)
    assert heading.startswith("frequency [rad/s],p/lat magnitude [dB],p/lat phase [deg],")
    frequency, size, phase, coherence, error = np.loadtxt(rows, delimiter=",").T
    response = 10 ** (size / 20) * np.exp(1j * np.radians(phase))
    assert response == pytest.approx(heave.response[0, 0], rel=1e-12)
    assert np.array_equal(frequency, heave.frequency)
    assert np.array_equal([coherence, error], [heave.coherence[0, 0], heave.random_error[0, 0]])
    with pytest.raises(StorageError, match=r"available: \.json, \.csv"):
        heave.save(tmp_path / "heave.txt")
