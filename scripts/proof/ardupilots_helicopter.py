"""Fly ArduPilot's own simulated helicopter through sweeps of SystemID, and keep its log.

No model of ours flies here: what `helisim identify` finds in the log is held against the
coefficients that ArduPilot's public source states, by `scripts/sitl_study.py --heli LOG`.

    python scripts/proof/ardupilots_helicopter.py LOG [heli|heli-blade360] [PROGRAM]

PROGRAM is ArduCopter-heli; `HELISIM_ARDUPILOT` names it otherwise. Its own default parameters,
copter-heli.parm, are read from the folder in which it is.
"""

import select
from collections.abc import Callable
from pathlib import Path

import common
import numpy as np

from helisim.base.errors import AutopilotError, InputError, check_known
from helisim.sim.weather import Weather
from helisim.sitl import Sensed
from helisim.sitl.pilot import Pilot, Steps, Telemetry
from helisim.sitl.process import Autopilot, find_program
from helisim.sitl.systemid import fly_sweep, sweeps

AXES = ("roll", "pitch", "yaw", "thrust")
SPEED = 3.0  # Times real time: its log's writer follows, and a busy machine holds the place.
HEIGHT = 100.0  # m above the ground where sweeps are flown.
SWEPT = {"heli": (0.3, 12.0), "heli-blade360": (0.5, 18.0)}
"""Hz: past the rotor's mode, which is at 10 and at 11 Hz; that of a smaller one is faster."""
_OWN = {"LOG_BITMASK": 3, "LOG_DISARMED": 0, "LOG_FILE_BUFSIZE": 30_000, "FLTMODE_CH": 0}
_OWN["RC_OVERRIDE_TIME"] = -1  # it doesn't wait for us: sticks stay where they were put
_STICKS, _STEP, _SILENCE = 0.05, 0.02, 20.0
"""s of simulated time between two messages of the sticks, and steps; s of the clock in silence."""


class Seen:
    """The helicopter as its own autopilot sees it, in the place of one that flies here."""

    def __init__(self, heard: Telemetry) -> None:
        self._heard, self.rotor_speed = heard, 0.0
        self.weather = Weather()  # its own is its parameters'

    @property
    def stands(self) -> bool:
        return self.sensed.position[2] > -0.5

    @property
    def sensed(self) -> Sensed:
        position, velocity = (
            np.nan_to_num(self._heard.numbers("LOCAL_POSITION_NED", *names))
            for names in (("x", "y", "z"), ("vx", "vy", "vz"))
        )
        still, upright = np.zeros(3), np.array((1.0, 0.0, 0.0, 0.0))
        return Sensed(time_of(self._heard), still, still, position, velocity, upright)


def time_of(heard: Telemetry) -> float:
    return 1e-3 * float(np.nan_to_num(heard.numbers("ATTITUDE", "time_boot_ms")[0]))


def swept(pilot: Pilot, low: float, high: float, axes: tuple[str, ...] = AXES) -> Steps:
    yield from pilot.take_off(HEIGHT)
    for sweep in sweeps(axes, start_hz=low, stop_hz=high, magnitude=0.06):
        yield from pilot.go_to(0.0, 0.0, HEIGHT)
        pilot.say(str(sweep))
        yield from fly_sweep(pilot, sweep)
    yield from pilot.go_to(0.0, 0.0, 5.0)
    yield from pilot.land()


def listen(autopilot: Autopilot, pilot: Pilot) -> None:
    heard, told = pilot.telemetry, len(pilot.telemetry.said)
    if not select.select([autopilot.telemetry], [], [], _SILENCE)[0]:
        autopilot.check()
        raise AutopilotError(f"ArduPilot says nothing for {_SILENCE:g} s")
    heard.hear()
    for one in heard.said[told:]:
        pilot.say(f"ArduPilot: {one}")
    if not time_of(heard):
        heard.ask_for_messages()  # which tell the time
    pilot.aircraft.rotor_speed = float(pilot.sticks.rotor)
    pilot.sensed = pilot.aircraft.sensed


def fly(
    log: Path, model: str, script: Callable[[Pilot], Steps], parameters: str = "", program: str = ""
) -> None:
    """Fly a script with ArduPilot's own parameters and further ones, and keep the log."""
    check_known("helicopter of ArduPilot's", [model], SWEPT)
    path = find_program(program or None)
    beside = path.parent / "copter-heli.parm"
    if not beside.is_file():
        raise InputError(
            f"{beside}: no such file; copy it from Tools/autotest/default_params of ArduPilot"
        )
    own = "".join(f"\n{name} {value}" for name, value in _OWN.items())
    text = f"{beside.read_text(encoding='ascii')}{own}\n{parameters}\n"
    with Autopilot(path, text, speed=SPEED, more=("--model", model)) as autopilot:
        heard = Telemetry(autopilot.telemetry)
        pilot = Pilot(Seen(heard), heard, lambda said: print(f"{time_of(heard):7.1f} s  {said}"))
        steps = script(pilot)
        sticks = step = 0.0
        while True:
            listen(autopilot, pilot)
            now = time_of(heard)
            if now >= step:
                step = now + _STEP
                if next(steps, "done") == "done":
                    break
            if now >= sticks:
                sticks = now + _STICKS
                heard.speak(pilot.sticks.pulses)
        autopilot.keep_log(log)
    print(f"Written: {log}")


def main(log: Path, model: str = "heli", program: str = "") -> None:
    fly(log, model, lambda pilot: swept(pilot, *SWEPT[model]), program=program)


if __name__ == "__main__":
    common.run(main)
