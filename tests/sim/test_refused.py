"""Settings that no flight can have are refused where they are made, in one line that says why."""

import math

import pytest

import helisim as hs
from helisim import sim
from helisim.base.errors import InputError
from helisim.sim import faults, multisine
from helisim.sim.missions import autopilot

NAN, INF = math.nan, math.inf


def four(**settings):
    usual = {"amplitude": (0.03, 0.07, 0.07, 0.01), "band": (0.6, 40.0), "period": 10.0}
    return multisine.Multisine(**{**usual, "duration": 26.0, **settings})


TABLE = r"""
Step(axis="lat", duration=1e20) => must be 0 to 1e\+06 s
Chirp(axis="front", at="servos") => axis at servos 'front'
Step(axis="lat", amplitude=0.6) => amplitude must be in \(0, 0.5\]
Step(axis="lat", amplitude=NAN) => amplitude must be a finite number
Step(axis="p", at="sensors", amplitude=36.0) => \(0, 35\] rad/s
Step(axis="phi", at="sensors", amplitude=4.0) => amplitude must be in \(0, 3.14159\] rad, got 4
Step(axis="lat", at="rotor") => 'rotor'; available: sticks, servos, actuators
Step(axis="lat", at="sensors") => axis at sensors 'lat'; available: p, q, r
Step(axis="front") => axis 'front'; available: col, lon, lat, ped
Step(axis="lat+lon") => a Step moves one axis, got lat.lon: .* Together
Step(axis="lat", duration=2.0) => longer than the trimmed stretch of 2 s
Step(axis="lat", amplitude=(0.1, 0.2)) => Step.amplitude must be a number
Pulse(axis="lat", width=7.0) => width of Pulse must be above 0 and at most 6 s
Doublet(axis="yaw") => 'yaw'; available: col, lon, lat, ped
Doublet(axis="lat", width=0.0) => width of Doublet must be above 0 and at most 6 s
Doublet(axis="lat", width=NAN) => width must be a finite number
ThreeTwoOneOne(axis="lat", unit=1.2) => unit of ThreeTwoOneOne must be above 0 and at most 1.14
ThreeTwoOneOne(axis="lat", amplitude=0.6) => amplitude must be in
Sweep(axis="lat", at="servos") => fly a Chirp at servos
Sweep(axis="lat", band=(1.0, 1.0)) => 0 < w_min < w_max
Sweep(axis="lat", band=(1.0, INF)) => band.* must be a finite number
Sweep(axis="lat", leakage=NAN) => leakage must be a finite number 0 or more and at most 1
Sweep(axis="lat", unsteadiness=-0.1) => unsteadiness must be a number 0 or more
Chirp(axis="lat", band=(3.0, 2.0)) => 0 < w_min < w_max
Chirp(axis="lat", band="3:42") => Chirp.band must be a list of 2 numbers
Chirp(axis="lat", band=(1.0, 2.0, 3.0, 4.0)) => a list of 2 numbers, got
Chirp(axis="lat", fade=None) => Chirp.fade must be a number, got None
Chirp(axis="lat", fade=40.0) => fade must be 0 to 27 s
four(period=None) => Multisine.period must be a number, got None
four(axis="lat+lat") => an axis twice
four(amplitude=(0.1, 0.2)) => amplitude needs 1 number or 4 .* got 2
four(band=(1.0, 2.0, 3.0)) => 0 < w_min < w_max
four(band=(1.0, 1.1)) => no harmonic of .* 2.51 rad/s apart
four(period=30.0) => period must be above 0 and at most 20 s
four(slope=NAN) => slope must be a finite number -8 or more
Sequence(parts=()) => Sequence needs parts
Sequence(parts=("lat",)) => needs an excitation such as
Sequence(parts=(Sweep(axis="lat"),)) => a Sweep is no part of a Sequence
Sequence(parts=(Step(axis="lat"),), pause=-1.0) => pause must be a number 0 or more s
Sequence(parts=(Step(axis="lat"),), duration=3.0) => shorter than its parts: 8 s
Together(parts=(Step(axis="lat"),), duration="9") => Together.duration must be
Together(parts=(Step(axis="lat"),), axis="ped") => those of its parts, lat
Together(parts=(Step(axis="lat"),), at="servos") => those of its parts, lat
History.of([0, 1], ["a", "b"], axis="lat") => values must be an array of numbers
History.of([0, 0.5], [0, 0], axis="lat") => at least 1 s, got 0.5
History.of([0, 1], [0, NAN], axis="lat") => values must hold numbers, each finite
History.of([0, 1, 1], [0, 0, 0], axis="lat") => must rise from 0 s
History.of([1, 2], [0, 0], axis="lat") => must rise from 0 s, got 1
History.of([0], [0], axis="lat") => two times or more
History.of([0, 1], [[0, 0], [0, 0]], axis="lat") => values \(n_time, 1\) for lat
History.of([0, 9], [0, 0], axis="lat", duration=9.5) => shorter than the flight
History.of([0, 9], [0, 0], axis="lat", method="x") => available: linear, hold
Pilot(remnant=-0.1) => remnant must be a number 0 or more and at most 0.5
ServoStuck(servo="rear", at=1.0) => available: servo_front
ServoStuck(servo="servo_tail", at=1.0, position=2.0) => at most 1, got 2
SampleLoss(share=1.0) => share must be a number above 0 and below 1
SampleLoss(share=0.1, burst=0) => an integer 1 or more
RecordGap(at=1.0, lasts=0.0) => lasts must be a number above 0
Ground(slope=-0.1) => slope must be a number 0 or more and below 1.57
Ground(slope=0.1, deck=Deck()) => a slope or a deck, not both
Ground(rotor=0.0) => only a parked flight starts with a slow rotor
Deck(roll=Swing(amplitude=0.6)) => roll must stay below 0.5 rad
Deck(above=1.0, heave=Swing(amplitude=-1.0)) => heave must stay below 1 m
Swing(amplitude=1.0, period=0.0) => period must be a number above 0 s
Weather(turbulence="terrible") => available: light, moderate, severe
Weather(turbulence=-3.0) => wind at 20 ft of 0 to 150 m/s
Weather(turbulence="light", rms=(1.0, 1.0, 1.0)) => exclude each other
Weather(rms=(1.0, 0.0, 1.0)) => rms.* must be a number above 0 m/s
Weather(wind=-1.0) => wind must be a number 0 or more m/s
Weather(height=0.0) => above 0 m
Weather(height=1.0, turbulence="light") => from 3.05 to 305 m
Gust(rise=0.0) => rise must be a number above 0 s
Gust(hold=-1.0) => hold must be a number 0 or more s
Recorder(antialias_hz=50.0) => below half the sample rate
Recorder(latency={"p": -0.001}) => latency.p must be a number 0 or more
Recorder(latency={"roll": 0.01}) => unknown channel 'roll'
Recorder(noise={"phi": 99999999999999999999}) => noise.phi must be .* at most 1e\+06
Recorder(lever_arm=(0.1, NAN, 0.0)) => lever_arm.* must be a finite number
FlightEnvelope(saturation=11.0) => saturation must be a number above 0 and at most 10 s
missions.Autorotation(speed=-5.0) => speed must be a number 0 or more m/s
_glide(3.0, -1.0, 1.0) => a speed and an acceleration above 0, got 3, -1 and 1
_glide(NAN, 1.0, 1.0) => a finite distance
Chirp(axis="lat", band=(1.0, 2000.0)).on(OWN) => up to 2000 rad/s, beyond half .* 1570
Sequence(parts=(Chirp(axis="lat", band=(1.0, 2000.0)),)).on(OWN) => beyond half
four(period=9.999).on(OWN) => whole number .* 0.002 s, got 9.999; 10 is near
Step(axis="lat", at="actuators").on(OWN) => needs its amplitude at actuators
_ramp(0.0, 5.0, 0.0) => acceleration above 0, got 5 and 0
FlightPlan(mission="forward") => got 'forward'
FlightPlan(excitation="lat") => needs an excitation such as
FlightPlan(excitation=Step(axis="lat"), pilot=None) => plan.pilot must be
FlightPlan(excitation=Step(axis="lat"), faults=["stuck"]) => one of ServoStuck
"""
NAMES = {**vars(faults), **vars(autopilot), **vars(sim), **globals()}


@pytest.mark.parametrize("line", TABLE.strip().splitlines())
def test_what_can_not_be_is_one_line(jr700, line):
    """Also what depends on the gyro's rate, or on what a vehicle has of its own."""
    make, says = line.split(" => ")
    with pytest.raises(InputError, match=says) as caught:
        eval(make, {**NAMES, "OWN": jr700.parameters})  # the lines above
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [hs.Sweep, hs.Doublet])
@pytest.mark.parametrize("name", ["duration", "trim_time", "amplitude"])
@pytest.mark.parametrize("bad", [-1.0, 0.0, NAN, "1"])
def test_times_and_amplitudes_are_finite_and_fit(kind, name, bad):
    """No trimmed stretch is a stretch of 0 s; it leaves half of the flight at least."""
    if (name, bad) != ("trim_time", 0.0):
        with pytest.raises(InputError, match=name if name == "amplitude" else "duration|trim"):
            kind(axis="lat", **{name: bad})
    with pytest.raises(InputError, match=r"four times the trimmed stretch"):
        kind(axis="lat", duration=3.0, trim_time=1.0)


@pytest.mark.parametrize("name", hs.FlightEnvelope.__dataclass_fields__)
@pytest.mark.parametrize("bad", [NAN, INF, -1.0])
def test_a_limit_is_a_number_or_none(name, bad):
    """None watches none of it."""
    with pytest.raises(InputError, match=name):
        hs.FlightEnvelope(**{name: bad})
