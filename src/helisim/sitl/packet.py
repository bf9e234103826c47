"""What goes between ArduPilot and its JSON backend: a frame of pulses, and what was sensed.

Source: ArduPilot, libraries/SITL/examples/JSON/readme.md.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError

_LAYOUTS = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
"""Magic number -> layout of the packet: magic number, frame rate, frame count, pulses."""
_GAZEBO = struct.calcsize("<16f")
_HAIR = 1.0 + 1e-6
"""By which time is told too fast: ArduPilot cuts each difference of two times to whole us, and
loses one wherever rounding leaves it a hair below."""
_STILL = np.zeros(3)
_STILL.flags.writeable = False


@dataclass(frozen=True)
class Frame:
    """What the autopilot sends once a frame.

    Attributes:
        rate_hz: frames a second that it would like.
        count: of frames since it started.
        pulses: of its 16 or 32 outputs, us; 0 where an output is off.
    """

    rate_hz: int
    count: int
    pulses: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Sensed:
    """What the vehicle's sensors say, north-east-down and forward-right-down.

    Attributes:
        time: s, since the vehicle was placed.
        gyro: (3,) rates, rad/s.
        force: (3,) specific force at the IMU, m/s^2; on the ground 0, 0, -g.
        position: (3,) of the IMU, m.
        velocity: (3,) of the IMU over the ground, m/s.
        quaternion: (4,) from body to earth, scalar first.
        wind: (3,) of the air over the ground, m/s.
        clearance: from the IMU straight down to the ground, m; nan if not known.
    """

    time: float
    gyro: NDArray[np.float64]
    force: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    wind: NDArray[np.float64] = field(default_factory=lambda: _STILL)
    clearance: float = math.nan


def read_frame(packet: bytes) -> Frame | None:
    """Return the frame that a packet holds; None if the packet was cut on its way.

    Raises:
        InputError: the packet is of another protocol.
    """
    if len(packet) < 2:
        return None
    magic = int.from_bytes(packet[:2], "little")
    layout = _LAYOUTS.get(magic)
    if layout is None:
        raise InputError(
            f"a packet of {len(packet)} bytes with the magic number {magic}{_sender(packet)}; "
            "expected 18458 or 29569: start ArduPilot with --model JSON"
        )
    if len(packet) != layout.size:
        return None
    _, rate_hz, count, *pulses = layout.unpack(packet)
    return Frame(rate_hz, count, tuple(pulses))


def _sender(packet: bytes) -> str:
    """Return what a packet of another protocol may be."""
    if len(packet) == _GAZEBO:
        return ", as ArduPilot's --model gazebo sends"
    if packet[0] in (0xFD, 0xFE):
        return ", which looks like MAVLink: that is for the autopilot's own port"
    return ""


def answer(sensed: Sensed, also: Sequence[str] = ()) -> bytes:
    """Return what was sensed as a line of JSON without spaces, which ArduPilot's parser needs.

    Args:
        sensed: after the frame.
        also: names of further fields, of `FIELDS`; one that isn't known is left out.
    """
    gx, gy, gz = sensed.gyro.tolist()
    ax, ay, az = sensed.force.tolist()
    x, y, z = sensed.position.tolist()
    u, v, w = sensed.velocity.tolist()
    q1, q2, q3, q4 = sensed.quaternion.tolist()
    further = "".join([FIELDS[name](sensed) for name in also])
    return (
        f'\n{{"timestamp":{sensed.time * _HAIR:.12f},"imu":{{"gyro":[{gx:.9g},{gy:.9g},{gz:.9g}],'
        f'"accel_body":[{ax:.9g},{ay:.9g},{az:.9g}]}},"position":[{x:.12g},{y:.12g},{z:.12g}],'
        f'"velocity":[{u:.9g},{v:.9g},{w:.9g}],'
        f'"quaternion":[{q1:.9g},{q2:.9g},{q3:.9g},{q4:.9g}]{further}}}\n'
    ).encode()


def check_fields(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of further fields of an answer. Raises UnknownNameError."""
    for name in names:
        if name not in FIELDS:
            raise UnknownNameError("field of an answer", name, FIELDS)
    return tuple(names)


def _airspeed(sensed: Sensed) -> str:
    through = (sensed.velocity - sensed.wind).tolist()
    return f',"airspeed":{math.hypot(*through):.9g}'


def _wind(sensed: Sensed) -> str:
    north, east, down = sensed.wind.tolist()
    return f',"velocity_wind":[{north:.9g},{east:.9g},{down:.9g}]'


def _wind_vane(sensed: Sensed) -> str:
    """Return the apparent wind in the horizontal plane, from ahead where the direction is 0."""
    north, east, _ = (sensed.velocity - sensed.wind).tolist()
    a, b, c, d = sensed.quaternion.tolist()
    heading = math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
    speed, direction = math.hypot(north, east), math.atan2(east, north) - heading
    return f',"windvane":{{"direction":{direction % math.tau:.9g},"speed":{speed:.9g}}}'


def _range(sensed: Sensed) -> str:
    """Return what a range finder that looks down along the body's axis says."""
    _, b, c, _ = sensed.quaternion.tolist()
    down = 1.0 - 2.0 * (b * b + c * c)
    far = sensed.clearance / down if down > 0.0 else math.nan
    return "" if math.isnan(far) else f',"rng_1":{far:.9g}'


def _fixed(text: str, _sensed: Sensed) -> str:
    return text


FIELDS: dict[str, Callable[[Sensed], str]] = {
    "airspeed": _airspeed,
    "wind": _wind,
    "windvane": _wind_vane,
    "rng": _range,
    "no_time_sync": partial(_fixed, ',"no_time_sync":1'),
}
"""Name -> what it adds to an answer. Older versions of ArduPilot leave out what they don't know, as
`wind`. To their parser the word true is zero, and the first "velocity" is the velocity."""
