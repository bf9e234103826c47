"""The lock step: each frame of the autopilot is flown and answered once."""

from collections.abc import Callable

from helisim.sitl.aircraft import Aircraft
from helisim.sitl.link import Link
from helisim.sitl.packet import Frame, Sensed, answer


def serve(
    aircraft: Aircraft,
    link: Link,
    *,
    on_frame: Callable[[Frame, Sensed], bool] | None = None,
) -> int:
    """Fly an aircraft by the frames that come, until none comes for long.

    Args:
        aircraft: that is flown.
        link: to the autopilot.
        on_frame: called with each frame and what is sensed after it, while the autopilot waits
            for the answer; True ends the flight. What a script sends to the autopilot in it
            arrives at the same simulated time in each run.

    Returns:
        How many frames were answered.
    """
    answered, last, line = 0, None, b""
    while (frame := link.receive()) is not None:
        if frame.count != last:
            sensed = aircraft.step(frame.pulses)
            line, last = answer(sensed), frame.count
            if on_frame is not None and on_frame(frame, sensed):
                break
        link.answer(line)
        answered += 1
    return answered
