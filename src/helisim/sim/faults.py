"""What can fail: servos and gyro in flight, the recorder's sensors, samples and clock."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import check, from_plain, read_settings, setting
from helisim.physics.layout import NEVER, PARAM, READS_HELD, READS_ZERO
from helisim.records.record import CHANNELS, RATES, SERVOS, FlightRecord, channel

_READS = {"zero": READS_ZERO, "held": READS_HELD}


class _Checked:
    """Base of faults: settings are checked, and one name of several may stand alone."""

    def __post_init__(self) -> None:
        for name in ("channels", "rates"):
            given = getattr(self, name, None)
            if isinstance(given, str):
                object.__setattr__(self, name, (given,) if name == "channels" else tuple(given))
        check(self)
        for name in getattr(self, "channels", None) or ():
            channel(name)
        if getattr(self, "channels", None) == () or getattr(self, "rates", None) == ():
            raise InputError(f"{type(self).__name__} needs at least one name, got none")

    @property
    def part(self) -> str:
        """What fails, of which a flight has one fault; "" where any number is possible."""
        return getattr(self, "servo", "")


@dataclass(frozen=True, kw_only=True)
class ServoStuck(_Checked):
    """A servo that moves no more. Its command is recorded as ever.

    Attributes:
        servo: "servo_front", "servo_left", "servo_right" or "servo_tail".
        at: s.
        position: where it sticks, unitised: it runs there as fast as it can. None: where it is.
    """

    servo: str = setting(choices=SERVOS)
    at: float = setting(unit="s", low=0.0)
    position: float | None = setting(None, low=-1.0, high=1.0)

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        if self.position is None:
            _limit(par, self.servo, self.at, 0.0, -NEVER, NEVER)
        else:
            _limit(par, self.servo, self.at, NEVER, self.position, self.position)


@dataclass(frozen=True, kw_only=True)
class ServoWeak(_Checked):
    """A servo that is slow, or that lost some of its travel.

    Attributes:
        servo: as for `ServoStuck`.
        at: s.
        rate_limit: its greatest speed from then on, 1/s; None for no change.
        travel: the greatest `abs(command)` that it follows from then on, unitised; None likewise.
    """

    servo: str = setting(choices=SERVOS)
    at: float = setting(unit="s", low=0.0)
    rate_limit: float | None = setting(None, unit="1/s", above=0.0)
    travel: float | None = setting(None, above=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rate_limit is None and self.travel is None:
            raise InputError(f"{self.servo}: a weak servo needs rate_limit, travel or both")

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        rate_limit = NEVER if self.rate_limit is None else self.rate_limit
        travel = NEVER if self.travel is None else self.travel
        _limit(par, self.servo, self.at, rate_limit, -travel, travel)


def _limit(par: NDArray[np.float64], servo: str, *limits: float) -> None:
    """Write from when on, how fast and from where to where a servo can move."""
    first = PARAM.front_fault_at + 4 * SERVOS.index(servo)
    par[first : first + 4] = limits


@dataclass(frozen=True, kw_only=True)
class GyroRestart(_Checked):
    """The gyro starts anew: its integrators and filters go to zero, sticks do nothing meanwhile.

    Attributes:
        at: s.
        lasts: s, until the gyro is back.
        output: "neutral" sends all four servos to their middle meanwhile, the collective too;
            "held" leaves their last commands.
    """

    at: float = setting(unit="s", low=0.0)
    lasts: float = setting(0.3, unit="s", above=0.0)
    output: Literal["neutral", "held"] = "neutral"

    part: ClassVar[str] = "restarting gyro"  # pyright: ignore[reportIncompatibleMethodOverride]

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        par[PARAM.restart_at], par[PARAM.restart_until] = self.at, self.at + self.lasts
        par[PARAM.restart_neutral] = float(self.output == "neutral")


@dataclass(frozen=True, kw_only=True)
class GyroDropout(_Checked):
    """The gyro's own rate sensors freeze, or read zero, for a while; the recorder's go on.

    Attributes:
        at: s.
        lasts: s.
        rates: which of "p", "q", "r".
        reads: "zero", or "held" for what the gyro's filters hold at that moment.
    """

    at: float = setting(unit="s", low=0.0)
    lasts: float = setting(unit="s", above=0.0)
    rates: str | Sequence[str] = setting(RATES, choices=RATES)
    reads: Literal["zero", "held"] = "zero"

    part: ClassVar[str] = "gyro's sensors"  # pyright: ignore[reportIncompatibleMethodOverride]

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        par[PARAM.dropout_at], par[PARAM.dropout_until] = self.at, self.at + self.lasts
        for name in self.rates:
            par[PARAM.dropout_p + RATES.index(name)] = _READS[self.reads]


@dataclass(frozen=True, kw_only=True)
class SensorDropout(_Checked):
    """Channels that freeze, or read zero, for a while.

    Attributes:
        channels: names, one or several.
        at: s.
        lasts: s.
        reads: "held" for the last number before, or "zero".
    """

    channels: str | Sequence[str]
    at: float = setting(unit="s", low=0.0)
    lasts: float = setting(unit="s", above=0.0)
    reads: Literal["held", "zero"] = "held"

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        del rng
        values = record.values.copy()
        out = (record.time >= self.at) & (record.time < self.at + self.lasts)
        last = max(int(np.argmax(out)) - 1, 0)
        for k in _columns(record, self.channels):
            values[out, k] = values[last, k] if self.reads == "held" else 0.0
        return replace(record, values=values)


@dataclass(frozen=True, kw_only=True)
class SensorSpikes(_Checked):
    """Single samples that are far off.

    Attributes:
        channels: names, one or several; each has spikes of its own.
        size: by which a spike is off, up or down, in the channel's unit.
        per_minute: how many there are on average.
    """

    channels: str | Sequence[str]
    size: float = setting(above=0.0)
    per_minute: float = setting(6.0, above=0.0)

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        values = record.values.copy()
        chance = self.per_minute / 60.0 * record.duration / (len(record) - 1)
        for k in _columns(record, self.channels):
            hit = rng.random(len(record)) < chance
            sign = rng.choice([-1.0, 1.0], size=len(record))
            values[:, k] += self.size * np.where(hit, sign, 0.0)
        return replace(record, values=values)


@dataclass(frozen=True, kw_only=True)
class SampleLoss(_Checked):
    """A recorder that now and then writes nothing.

    Attributes:
        share: of all samples that is lost, on average.
        burst: samples that are lost in a row.
    """

    share: float = setting(above=0.0, below=1.0)
    burst: int = setting(1, low=1)

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        # bursts may overlap: a sample stays if none of the `burst` places before it starts one
        starts = rng.random(len(record)) < 1.0 - (1.0 - self.share) ** (1.0 / self.burst)
        return _without(record, np.convolve(starts, np.ones(self.burst))[: len(record)] > 0.0)


@dataclass(frozen=True, kw_only=True)
class RecordGap(_Checked):
    """A recorder that writes nothing for a while.

    Attributes:
        at: s.
        lasts: s.
    """

    at: float = setting(unit="s", low=0.0)
    lasts: float = setting(unit="s", above=0.0)

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        del rng
        return _without(record, (record.time >= self.at) & (record.time < self.at + self.lasts))


@dataclass(frozen=True, kw_only=True)
class ClockDrift(_Checked):
    """A clock that goes wrong by a constant rate.

    Attributes:
        ppm: by how many parts in a million it is fast; negative is slow.
        channels: those that a second computer took by this clock and that were then put beside
            the others by their stamps, so that they slip against them. None: the recorder's
            own clock, so all stamps are wrong alike.
    """

    ppm: float = setting(low=-1e5, high=1e5)
    channels: str | Sequence[str] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ppm == 0.0:
            raise InputError("ClockDrift.ppm must be other than 0, got 0")

    def apply(self, record: FlightRecord, rng: np.random.Generator) -> FlightRecord:
        """Return the record as it is with this fault."""
        del rng
        fast, start = 1.0 + 1e-6 * self.ppm, record.time[0]
        if self.channels is None:
            return replace(record, time=start + fast * (record.time - start))
        true = np.minimum(start + (record.time - start) / fast, record.time[-1])
        values = record.values.copy()
        for k in _columns(record, self.channels):
            values[:, k] = CubicSpline(record.time, record.values[:, k])(true)
        return replace(record, values=values)


def _columns(record: FlightRecord, names: Sequence[str]) -> list[int]:
    """Return the columns of channels. Raises UnknownNameError: the record lacks one."""
    return [record.names.index(name) for name in names if record.unit(name) is not None]


def _without(record: FlightRecord, lost: NDArray[np.bool_]) -> FlightRecord:
    if np.count_nonzero(~lost) < 2:
        raise InputError("the recorder loses every sample: lose less")
    return replace(record, time=record.time[~lost], values=record.values[~lost])


FlightFault = ServoStuck | ServoWeak | GyroRestart | GyroDropout
RecorderFault = SensorDropout | SensorSpikes | SampleLoss | RecordGap | ClockDrift
Fault = FlightFault | RecorderFault

_WORDS: dict[str, dict[str, type[Fault]]] = {
    "servo": {"stuck": ServoStuck, "weak": ServoWeak},
    "gyro": {"restart": GyroRestart, "dropout": GyroDropout},
    "recorder": {"loss": SampleLoss, "gap": RecordGap, "drift": ClockDrift},
    "channel": {"spikes": SensorSpikes, "dropout": SensorDropout},
}
"""What fails -> the word of its fault -> the kind of fault."""


def check_faults(faults: Sequence[Fault], duration: float) -> None:
    """Check that all faults can come in one flight of that many seconds.

    Raises:
        InputError: one is no fault, or comes after the flight, or two are of the same part.
    """
    for fault in faults:
        if not isinstance(fault, Fault):
            raise InputError(f"faults must be such as ServoStuck or SampleLoss, got {fault!r:.80}")
        at = getattr(fault, "at", 0.0)
        if at >= duration:
            raise InputError(
                f"{type(fault).__name__} at {at:g} s: the flight is over at {duration:g} s"
            )
    parts = [fault.part for fault in faults]
    for part in filter(None, parts):
        if parts.count(part) > 1:
            raise InputError(f"{part}: a flight has one fault of a part, got {parts.count(part)}")


def write_faults(par: NDArray[np.float64], faults: Sequence[FlightFault]) -> None:
    """Put all faults of a flight into a vehicle's parameters (n_param,) for the force laws."""
    par[PARAM.faults] = float(bool(faults))
    par[PARAM.faults + 1 : PARAM.dropout_p] = NEVER
    par[PARAM.dropout_p : PARAM.dropout_r + 1] = 0.0
    for fault in faults:
        fault.write(par)


def parse_fault(text: str) -> Fault:
    """Return the fault that a text such as "gyro:restart@30,lasts=0.3" says.

    Raises:
        InputError: it is no fault; the message says which there are.
    """
    head, *items = text.split(",")
    part, colon, tail = (one.strip() for one in head.partition(":"))
    word, when, at = (one.strip() for one in tail.partition("@"))
    if not colon or not word:
        raise InputError(
            "a fault is PART:KIND[@SECONDS][,NAME=VALUE...], such as servo_front:stuck@30, got "
            f"{text!r:.80}"
        )
    channels, own = tuple(name.strip() for name in part.split("+")), {}
    if part in ("gyro", "recorder"):
        kinds = _WORDS[part]
    elif all(name in CHANNELS for name in channels):
        # a servo moves by the first kinds; by the others its recorded command is wrong
        kinds = {**(_WORDS["servo"] if part in SERVOS else {}), **_WORDS["channel"]}
        own = {"servo": part} if word in _WORDS["servo"] else {"channels": channels}
    else:
        raise UnknownNameError("part", part, ("gyro", "recorder", *CHANNELS))
    if word not in kinds:
        raise UnknownNameError(f"fault of {part}", word, kinds)
    given = read_settings(kinds[word], [*([f"at={at}"] if when else []), *items], text)
    if taken := own.keys() & given.keys():
        raise InputError(f"fault {text!r:.60}: {taken.pop()} is {part!r} already")
    return from_plain(kinds[word], {**own, **given}, f"fault {text!r:.60}")
