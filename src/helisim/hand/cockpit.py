"""A pilot's seat without a window: keys and sticks in, a flight that goes on, words out."""

import math
from dataclasses import dataclass

from helisim.base.errors import InputError, StorageError
from helisim.hand import ASSISTS, HandFlight, Inputs, Logbook, StickDevice
from helisim.hand.panel import Panel, legend

_SHOWN = 4.0
"""s, for which a message stays that tells what was done."""
CAMERAS = ("behind", "pad", "around")
"""From behind, with its heading; from where a pilot stands; around it, heading nowhere."""


@dataclass
class Cockpit:
    """Does what keys say, moves the sticks, and keeps every recording.

    Attributes:
        flight: that is flown.
        device: that moves its sticks.
        logbook: where the recordings go.
        paused: whether time stands still.
        camera: one of `CAMERAS`.
        closed: whether the pilot has left.
    """

    flight: HandFlight
    device: StickDevice
    logbook: Logbook
    paused: bool = False
    camera: str = CAMERAS[0]
    closed: bool = False
    _legend: bool = True
    _said: str = ""
    _said_for: float = 0.0

    def __post_init__(self) -> None:
        self._keys = {
            "p": self._pause,
            "r": self._record,
            "backspace": self.reset,
            "h": self._next_assist,
            "g": self._switch_gyro,
            "c": self._next_camera,
            "f1": self._switch_legend,
            "escape": self._close,
        }
        self.device.take_up(2.0 * float(self.flight.sticks[0]))

    def turn(self, inputs: Inputs, seconds: float) -> None:
        """Do what the inputs say; seconds have passed since the last time."""
        self._said_for += seconds
        for key in inputs.pressed:
            if key in self._keys:
                self._keys[key]()
        climbs = self.flight.assist == "hover"
        deflection = self.device.deflection(inputs, 0.0 if self.paused else seconds, climbs=climbs)
        if deflection is not None:
            self.flight.deflection = deflection
        elif not self.paused:
            self.paused = True
            self.say(f"{self.device.name} is gone: plug it in, then press P")

    def land(self) -> None:
        """Keep a recording that runs where the helicopter has crashed."""
        if self.flight.crashed and self.flight.recorded is not None:
            self._stop_recording()

    def leave(self) -> None:
        """Write what is recorded and not written yet. Raises StorageError."""
        if self.flight.recorded is not None:
            self._stop_recording()
        self.logbook.flush()

    def say(self, text: str) -> None:
        """Show a message for a while."""
        self._said, self._said_for = text, 0.0

    def reset(self) -> None:
        """Hover above the pad again; a recording that runs is written first."""
        if self.flight.recorded is not None:
            self._stop_recording()
        self.flight.reset()
        self.device.take_up(2.0 * float(self.flight.sticks[0]))

    @property
    def panel(self) -> Panel:
        """What is to be shown."""
        flight, now = self.flight, self.flight.motion
        return Panel(
            deflection=flight.deflection,
            hover_collective=2.0 * float(flight.hover_collective),
            mode=self.device.mode,
            readout=(
                ("time", f"{flight.time:.1f} s"),
                ("height", f"{flight.clearance:.1f} m"),
                ("speed", f"{math.hypot(now.u, now.v):.1f} m/s"),
                ("climb", f"{float(flight.data.qvel[2]):+.1f} m/s".replace("-0.0", "+0.0")),
                ("heading", f"{round(math.degrees(now.psi)) % 360:03d} deg"),
                ("assist", flight.assist),
                ("gyro", "on" if flight.gyro else "off"),
            ),
            legend=legend(self.device) if self._legend else (("F1", "keys"),),
            message=self._message,
            recorded=flight.recorded,
        )

    @property
    def _message(self) -> str:
        if self.flight.crashed:
            return f"{self.flight.crashed}: Backspace starts again"
        if self._said and self._said_for < _SHOWN:
            return self._said
        return "paused: P goes on" if self.paused else ""

    def _pause(self) -> None:
        self.paused = not self.paused

    def _record(self) -> None:
        if self.flight.recorded is not None:
            self._stop_recording()
        elif not self.flight.crashed:
            self.flight.start_recording()

    def _stop_recording(self) -> None:
        try:
            record = self.flight.stop_recording()
            path = self.logbook.write(record)
        except (InputError, StorageError) as error:
            self.say(str(error))
            return
        ended = f", but {record.ended}" if record.ended else ""
        self.say(f"written: {path} ({record.duration:.1f} s){ended}")

    def _next_assist(self) -> None:
        self.flight.assist = ASSISTS[(ASSISTS.index(self.flight.assist) + 1) % len(ASSISTS)]
        self.device.take_up(2.0 * float(self.flight.sticks[0]))
        self.say(f"assist {self.flight.assist}: {_MEANING[self.flight.assist]}")

    def _switch_gyro(self) -> None:
        self.flight.gyro = not self.flight.gyro
        self.say("gyro on" if self.flight.gyro else "gyro off: the sticks move the servos")

    def _next_camera(self) -> None:
        self.camera = CAMERAS[(CAMERAS.index(self.camera) + 1) % len(CAMERAS)]

    def _switch_legend(self) -> None:
        self._legend = not self._legend

    def _close(self) -> None:
        self.closed = True


_MEANING = {
    "hover": "the sticks command velocities; let go, and it stays",
    "level": "the cyclic stick commands tilt; let go, and it levels",
    "none": "all sticks go to the gyro as they are",
}
