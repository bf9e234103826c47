"""`helisim sitl`: ArduPilot flies the vehicle."""

import argparse
import time
from typing import TYPE_CHECKING, Any

from helisim.cli.common import add_parameters, add_quiet, add_vehicle, names, parameters
from helisim.cli.ground import add_ground, ground
from helisim.cli.weather import add_weather, weather
from helisim.errors import InputError

if TYPE_CHECKING:
    from helisim.sitl import Aircraft, Frame, Link, Sensed

_EPILOG = """\
examples:
  helisim sitl                               then, elsewhere:
    arducopter-heli --model JSON:127.0.0.1 --defaults copter-heli.parm
  helisim sitl blade360 --port 9012          for ArduPilot's instance 1, -I 1

ArduPilot begins once a ground station is on its TCP port 5760, and sets the
pace: --speedup N is an option of its own. Ctrl-C ends with a summary.

--send adds fields that an answer may have: airspeed, wind (its vector, read by
newer versions), windvane, rng (a range finder that looks down), no_time_sync
(ArduPilot keeps its own frame rate).
"""
_EACH = 10.0
"""s of the clock between two lines that say where it is."""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "sitl",
        help="let ArduPilot fly the helicopter",
        description="Let an unmodified ArduCopter-heli fly the helicopter: a backend for "
        "ArduPilot's JSON interface, lock step. The helicopter stands on the ground, its rotor "
        "stopped, until the autopilot arms and spins it up.",
        epilog=_EPILOG,
    )
    add_vehicle(command)
    command.add_argument(
        "--port", type=int, default=9002, metavar="N", help="UDP, to listen on (default: 9002)"
    )
    command.add_argument(
        "--address",
        default="127.0.0.1",
        metavar="IP",
        help="of this machine, to listen on (default: 127.0.0.1; 0.0.0.0 hears other machines)",
    )
    command.add_argument(
        "--wait",
        type=float,
        default=60.0,
        metavar="S",
        help="for the first frame, and after the last, s (default: 60; inf: on and on)",
    )
    command.add_argument(
        "--send", default="", metavar="FIELD,...", help="further fields of the answers, see below"
    )
    command.add_argument(
        "--tail",
        default="direct",
        metavar="direct|gyro",
        help="direct: ArduPilot moves the tail servo (default); gyro: the helicopter's own yaw "
        "gyro does, and ArduPilot's output is its pedals (H_TAIL_TYPE 1)",
    )
    command.add_argument(
        "--rate",
        type=float,
        default=1000.0,
        metavar="HZ",
        help="frames a second of simulated time (default: 1000, one sample of its gyro each)",
    )
    command.add_argument(
        "--seed", type=int, default=1, metavar="N", help="of the turbulence (default: 1)"
    )
    add_weather(command)
    add_ground(command)
    add_parameters(command)
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.sim import Weather
    from helisim.sitl import Aircraft, Backend, Link
    from helisim.sitl.packet import check_fields
    from helisim.vehicle import load

    if not options.wait > 0.0:
        raise InputError(f"--wait must be above 0 s, got {options.wait:g}")
    also = check_fields(names(options.send))
    with Link(options.port, address=options.address, timeout=options.wait) as link:
        changed = parameters(options)
        aircraft = Aircraft(
            load(options.vehicle, parameters=changed),
            motor=changed.get("drive.governor") != "ideal",
            tail=options.tail,
            rate_hz=options.rate,
            ground=ground(options),
            weather=weather(options, Weather()),
            seed=options.seed,
        )
        if not options.quiet:
            _say(_listening(options, link))
        status = None if options.quiet else _Status(aircraft)
        backend = Backend(aircraft, link, on_frame=status, also=also)
        try:
            with aircraft:
                backend.run()
        except KeyboardInterrupt:
            if not backend.served.frames:
                raise
    _say(f"Flown: {backend.served}")
    return 0


def _listening(options: argparse.Namespace, link: "Link") -> str:
    out = "" if link.port == 9002 else f" --sim-port-out {link.port}"
    host = "127.0.0.1" if link.address in ("127.0.0.1", "0.0.0.0") else link.address
    return (
        f"{options.vehicle} stands on the ground, rotor stopped. Listening on UDP {link.address}:"
        f"{link.port}, for {options.wait:g} s; start ArduPilot with\n"
        f"  arducopter-heli --model JSON:{host}{out} --defaults copter-heli.parm\n"
        "and a ground station on its TCP port 5760, for which it waits. Ctrl-C ends."
    )


class _Status:
    """Says where the helicopter is, now and then, and that it has crashed."""

    def __init__(self, aircraft: "Aircraft") -> None:
        self._aircraft, self._crashed = aircraft, ""
        self._next = self._clock = time.monotonic()
        self._time = 0.0

    def __call__(self, frame: "Frame", sensed: "Sensed") -> bool:
        crashed = self._aircraft.crashed
        if crashed != self._crashed:
            self._crashed = crashed
            if crashed:
                _say(f"{sensed.time:7.1f} s  crashed: {crashed}; start ArduPilot anew to fly on")
        now = time.monotonic()
        if now >= self._next:
            factor = (sensed.time - self._time) / max(now - self._clock, 1e-3)
            north, east, down = sensed.position
            pulses = " ".join(map(str, frame.pulses[:8]))
            _say(
                f"{sensed.time:7.1f} s  north {north:.2f}, east {east:.2f}, height {-down:.2f} m  "
                f"x{max(factor, 0.0):.1f}  pulses {pulses}"
            )
            self._next, self._clock, self._time = now + _EACH, now, sensed.time
        return False


def _say(text: str) -> None:
    """Print at once: another program waits for what is said here."""
    print(text, flush=True)
