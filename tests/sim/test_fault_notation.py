"""Faults as text."""

import pytest

from helisim.base.errors import InputError
from helisim.sim import FlightPlan, Sweep
from helisim.sim.faults import (
    ClockDrift,
    GyroDropout,
    GyroRestart,
    RecordGap,
    SampleLoss,
    SensorDropout,
    SensorSpikes,
    ServoStuck,
    ServoWeak,
    parse_fault,
)

EXAMPLES = {
    "servo_front:stuck@30": ServoStuck(servo="servo_front", at=30.0),
    "servo_left:stuck@3.5,position=-0.1": ServoStuck(servo="servo_left", at=3.5, position=-0.1),
    "servo_tail:weak@2,rate_limit=1,travel=0.2": ServoWeak(
        servo="servo_tail", at=2.0, rate_limit=1.0, travel=0.2
    ),
    "gyro:restart@30,lasts=0.5,output=held": GyroRestart(at=30.0, lasts=0.5, output="held"),
    "gyro:dropout@30,lasts=0.2,rates=p+q,reads=held": GyroDropout(
        at=30.0, lasts=0.2, rates=("p", "q"), reads="held"
    ),
    "p:spikes,size=5": SensorSpikes(channels="p", size=5.0),
    "servo_tail:spikes,size=0.2,per_minute=2": SensorSpikes(
        channels="servo_tail", size=0.2, per_minute=2.0
    ),
    "u+v+w:dropout@30,lasts=1": SensorDropout(channels=("u", "v", "w"), at=30.0, lasts=1.0),
    "recorder:loss,share=0.01,burst=3": SampleLoss(share=0.01, burst=3),
    "recorder:gap@30,lasts=0.5": RecordGap(at=30.0, lasts=0.5),
    "recorder:drift,ppm=-200": ClockDrift(ppm=-200.0),
    " recorder : drift , ppm = 50 , channels = p + q": ClockDrift(ppm=50.0, channels=("p", "q")),
}


@pytest.mark.parametrize("text", EXAMPLES)
def test_a_text_is_the_fault_it_says(text):
    """Each form of the notation, and back and forth through the plain data of a plan."""
    fault = parse_fault(text)
    assert fault == EXAMPLES[text]
    plan = FlightPlan(excitation=Sweep(axis="lat"), faults=(fault,))
    assert FlightPlan.from_dict(plan.to_dict()) == plan


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a fault is PART:KIND"),
        ("servo_front", "such as servo_front:stuck@30"),
        ("servo_front:", "a fault is PART:KIND"),
        ("servo_rear:stuck@3", "did you mean servo_"),
        ("servo_front:broken@3", "available: stuck, weak, spikes, dropout"),
        ("gyro:stuck@3", "available: restart, dropout"),
        ("p:stuck@3", "available: spikes, dropout"),
        ("recorder:spikes,size=1", "available: loss, gap, drift"),
        ("servo_front:stuck@soon", "at must be a number .*got 'soon'"),
        ("servo_front:stuck", "needs at"),
        ("gyro:dropout@3", "needs lasts"),
        ("p:spikes@3,size=1", "available: channels, size, per_minute"),
        ("gyro:restart@3,for=1", "unknown setting .* 'for'; available: at, lasts, output"),
        ("gyro:restart@3,lasts", "NAME=VALUE"),
        ("gyro:restart@3,lasts=long", "lasts must be a number"),
        ("servo_front:stuck@3,servo=servo_left", "servo is 'servo_front' already"),
        ("servo_front:stuck@3,at=4", "at is given twice"),
        ("recorder:loss,share=0.1,burst=1.5", "burst must be an integer"),
        ("gyro:restart@inf", "got inf"),
    ],
)
def test_a_text_that_is_no_fault_is_refused(text, says):
    """In one line that says which there are."""
    with pytest.raises(InputError, match=says) as caught:
        parse_fault(text)
    assert "\n" not in str(caught.value)
