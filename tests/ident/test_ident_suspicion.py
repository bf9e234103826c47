"""A fit that fails says what its data show: units, signs, columns, delays, bands."""

from dataclasses import replace

import numpy as np
import pytest

from helisim.ident import FrequencyResponse, Parameter, Structure, identify, suspicions
from helisim.ident.structures import transfer_function

OMEGA = np.geomspace(1.0, 20.0, 60)
DAMPING, GAIN, DELAY = 6.0, 90.0, 0.04


def roll(gains=None):
    """Return the structure of rate and angle over one control: the angle is the rate's integral."""
    return Structure(
        name="roll",
        meaning="roll rate and angle over lateral control",
        parameters=(
            Parameter("L_p", "1/s", -3.0, (-100.0, -0.01), "damping"),
            Parameter("L_lat", "1/s^2", 50.0, gains, "effectiveness"),
            Parameter("tau", "s", 0.02, (0.0, 0.3), "delay"),
        ),
        states=("p", "phi"),
        inputs=("lat",),
        outputs=("p", "phi"),
        F=(("L_p", 0), (1, 0)),
        G=(("L_lat",), (0,)),
        input_delays={"lat": "tau"},
    )


def data(p=1.0, phi=1.0, delay=DELAY, coherence=1.0, swapped=False):
    """Return the roll's exact response in closed form, each output times a factor."""
    rate = GAIN * np.exp(-1j * OMEGA * delay) / (1j * OMEGA + DAMPING)
    rows = [p * rate, phi * rate / (1j * OMEGA)]
    frf = FrequencyResponse.exact(
        OMEGA,
        np.array(rows[::-1] if swapped else rows)[:, None],
        inputs=("lat",),
        outputs=("p", "phi"),
        output_units=("rad/s", "rad"),
    )
    return replace(frf, coherence=np.full_like(frf.coherence, coherence))


def causes(frf, structure):
    """Return kind and option of what is suspected of a fit that must fail."""
    fit = identify(frf, structure)
    assert not fit.acceptable
    return [(one.kind, *(f"--{x.name} {x.value}" for x in one.remedy)) for one in suspicions(fit)]


def test_an_acceptable_fit_is_not_suspected():
    """Nor is one whose factor a free gain takes up."""
    for fit in (identify(data(), roll()), identify(data(p=57.3, phi=57.3), roll())):
        assert fit.acceptable
        assert suspicions(fit) == fit.shapes == ()
        assert not any(note.remedy for note in fit.notes)


@pytest.mark.slow
def test_degrees_taken_for_radians_are_told():
    """The rate in deg/s, or the angle in rad: either would make them fit, and both are told."""
    found = causes(data(p=180.0 / np.pi), roll())
    assert set(found) == {
        ("unit", "--channel p=COLUMN:deg/s"),
        ("unit", "--channel phi=COLUMN:rad"),
    }


@pytest.mark.slow
def test_a_wrong_sign_is_told():
    """Of one output against the other; of the control, where its effectiveness has bounds."""
    found = causes(data(phi=-1.0), roll())
    assert {kind for kind, *_ in found} == {"sign"}
    assert ("sign", "--channel phi=COLUMN:UNIT:sign=-1") in found
    found = causes(data(p=-1.0, phi=-1.0), roll(gains=(1.0, 1e4)))
    assert found[0] == ("sign", "--channel lat=COLUMN:UNIT:sign=-1")


@pytest.mark.slow
def test_swapped_columns_are_told():
    """The angle where the rate should be, with the cost that it would have."""
    fit = identify(data(swapped=True), roll())
    (one,) = suspicions(fit)
    assert one.kind == "columns"
    assert "the columns of p and phi swapped: J would be" in one.text
    assert [x.value for x in one.remedy] == ["p=COLUMN_OF_phi", "phi=COLUMN_OF_p"]


@pytest.mark.slow
def test_a_delay_that_is_held_too_short_is_told():
    """Fixed, or with none in the structure: by about how much, and the option."""
    found = causes(data(delay=0.22), roll().with_fixed({"tau": 0.02}))
    assert found[0] == ("delay", "--fix tau=0.22")
    without = replace(roll(), parameters=roll().parameters[:2], input_delays={})
    (one, *_) = suspicions(identify(data(delay=0.2), without))
    assert one.kind == "delay"
    assert "longer by about 0.2 s; the structure has none there" in one.text


@pytest.mark.slow
def test_an_edge_of_the_band_is_told():
    """A sensor's high-pass filter below 2 rad/s: the band without its strongest part."""
    frf = data()
    filtered = frf.response * np.where(OMEGA < 2.0, (OMEGA / 2.0) ** 4, 1.0)
    fit = identify(
        replace(frf, response=filtered),
        transfer_function(input="lat", output="p", zeros=0, poles=1),
    )
    (one,) = suspicions(fit)
    assert one.kind == "band"
    # a third of the band, in decades, counts as its edge: to 2.8 rad/s, and the next point is kept
    assert 2.0 <= float(one.option.value.split()[0]) <= 3.0
    assert one.text in fit.remarks


@pytest.mark.slow
def test_low_coherence_is_told():
    """A response that something else moves is doubted, not the structure."""
    frf = data(coherence=0.65)
    random = np.random.default_rng(0)
    wild = frf.response * np.exp(0.7 * random.standard_normal(frf.response.shape))
    fit = identify(replace(frf, response=wild), roll())
    kinds = {one.kind for one in suspicions(fit)}
    assert kinds == {"coherence"}


def test_a_transfer_function_that_is_too_small_is_told():
    """An oscillation with a zero, fitted by a lag: the order that would follow it."""
    s = 1j * OMEGA
    response = (-20.0 * s - 40.0) / (s**2 + 2.0 * s + 25.0) * np.exp(-0.03 * s)
    frf = FrequencyResponse.exact(OMEGA, response[None, None], inputs=("lon",), outputs=("q",))
    fit = identify(frf, transfer_function(input="lon", output="q", zeros=0, poles=1))
    found = suspicions(fit)
    assert (found[0].kind, found[0].option.value) == ("order", "tf:1/2")
