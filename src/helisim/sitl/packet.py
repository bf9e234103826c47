"""What goes between ArduPilot and its JSON backend: a frame of pulses, and what was sensed.

Source: ArduPilot, libraries/SITL/examples/JSON/readme.md.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.errors import InputError

_CHANNELS = {18458: 16, 29569: 32}
"""Magic number -> how many channels the packet has."""


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
    """

    time: float
    gyro: NDArray[np.float64]
    force: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    quaternion: NDArray[np.float64]


def read_frame(packet: bytes) -> Frame:
    """Return the frame that a packet holds. Raises InputError for one of another protocol."""
    magic = int.from_bytes(packet[:2], "little")
    channels = _CHANNELS.get(magic)
    if channels is None or len(packet) != 8 + 2 * channels:
        raise InputError(
            f"a packet of {len(packet)} bytes with the magic number {magic}; expected 18458 with "
            "40 bytes or 29569 with 72, as ArduPilot's --model JSON sends"
        )
    _, rate_hz, count, *pulses = struct.unpack(f"<HHI{channels}H", packet)
    return Frame(rate_hz, count, tuple(pulses))


def answer(sensed: Sensed) -> bytes:
    """Return what was sensed as a line of JSON without spaces, which ArduPilot's parser needs."""
    fields = (
        f'"timestamp":{sensed.time:.9f}',
        f'"imu":{{"gyro":{_vector(sensed.gyro)},"accel_body":{_vector(sensed.force)}}}',
        f'"position":{_vector(sensed.position)}',
        f'"velocity":{_vector(sensed.velocity)}',
        f'"quaternion":{_vector(sensed.quaternion)}',
    )
    return f"\n{{{','.join(fields)}}}\n".encode()


def _vector(numbers: NDArray[np.float64]) -> str:
    return f"[{','.join(f'{x:.9g}' for x in numbers)}]"
