"""Faults as text, such as "servo_front:stuck@30"."""

from typing import Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.records.channels import CHANNELS, SERVOS
from helisim.sim.faults import flight, recorder
from helisim.sim.faults.flight import FlightFault
from helisim.sim.faults.recorder import RecorderFault
from helisim.sim.plain import from_plain

Fault = FlightFault | RecorderFault

_SERVO: dict[str, type[Fault]] = {"stuck": flight.ServoStuck, "weak": flight.ServoWeak}
_GYRO: dict[str, type[Fault]] = {"restart": flight.GyroRestart, "dropout": flight.GyroDropout}
_RECORDER: dict[str, type[Fault]] = {
    "loss": recorder.SampleLoss,
    "gap": recorder.RecordGap,
    "drift": recorder.ClockDrift,
}
_CHANNEL: dict[str, type[Fault]] = {
    "spikes": recorder.SensorSpikes,
    "dropout": recorder.SensorDropout,
}

FAULTS = {
    kind.__name__: kind for kinds in (_SERVO, _GYRO, _RECORDER, _CHANNEL) for kind in kinds.values()
}
"""Every kind of fault by its name."""

FORM = "PART:KIND[@SECONDS][,NAME=VALUE...]"


def parse_fault(text: str) -> Fault:
    """Return the fault that a text such as "gyro:restart@30,lasts=0.3" says.

    Raises:
        InputError: it is no fault; the message says which there are.
    """
    head, *rest = text.split(",")
    part, colon, tail = head.partition(":")
    word, when, at = tail.partition("@")
    if not colon or not word:
        raise InputError(f"a fault is {FORM}, such as servo_front:stuck@30, got {text!r}")
    kind, given = _kind(part.strip(), word.strip())
    if when:
        given["at"] = _number("at", at, text)
    for item in rest:
        name, equals, value = item.partition("=")
        if not equals or name.strip() in given:
            raise InputError(f"fault {text!r}: expected a new NAME=VALUE, got {item!r}")
        given[name.strip()] = _value(name.strip(), value.strip(), text)
    return from_plain(kind, given, f"the fault {text!r}")


def _kind(part: str, word: str) -> tuple[type[Fault], dict[str, Any]]:
    """Return the kind of fault that a part's fault is, and what the part's name says of it."""
    channels = tuple(name.strip() for name in part.split("+"))
    kinds = {"gyro": _GYRO, "recorder": _RECORDER}.get(part)
    if kinds is None and all(name in CHANNELS for name in channels):
        # a servo moves by the first kinds; by the others its recorded command is wrong
        kinds = {**_SERVO, **_CHANNEL} if part in SERVOS else _CHANNEL
    if kinds is None:
        raise UnknownNameError("part", part, ("gyro", "recorder", *CHANNELS))
    if word not in kinds:
        raise UnknownNameError(f"fault of {part}", word, kinds)
    if word in _SERVO:
        return kinds[word], {"servo": part}
    return kinds[word], {"channels": channels} if kinds[word] in _CHANNEL.values() else {}


def _value(key: str, value: str, text: str) -> float | int | str | tuple[str, ...]:
    if key in ("output", "reads"):
        return value
    if key in ("rates", "channels"):
        return tuple(one.strip() for one in value.split("+"))
    number = _number(key, value, text)
    return int(number) if number.is_integer() and key == "burst" else number


def _number(key: str, value: str, text: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise InputError(f"fault {text!r}: {key} must be a number, got {value!r}") from None
