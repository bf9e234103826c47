"""`helisim sitl`: ArduPilot flies the vehicle."""

import argparse
from typing import TYPE_CHECKING, Any

from helisim.cli.common import add_parameters, add_quiet, add_vehicle, names, parameters
from helisim.cli.ground import EPILOG as GROUND
from helisim.cli.ground import add_ground, ground
from helisim.cli.sitl_script import EPILOG as SCRIPTS
from helisim.cli.sitl_script import add_script, check_no_script, check_script, fly
from helisim.cli.sitl_serving import add_kept, check, is_kept, serve
from helisim.cli.weather import add_weather, weather

if TYPE_CHECKING:
    from helisim.sitl import Aircraft

_EPILOG = """\
examples:
  helisim parm jr700 --out jr700.parm
  helisim sitl                               then, elsewhere:
    arducopter-heli --model JSON:127.0.0.1 --defaults jr700.parm
  helisim sitl blade360 --port 9012          for ArduPilot's instance 1, -I 1
  helisim sitl --script sysid --axes roll,pitch,yaw,thrust --log out.bin

ArduPilot begins once a ground station is on its TCP port 5760, and sets the
pace: --speedup N is an option of its own. Ctrl-C ends with a summary.

--send adds fields that an answer may have: airspeed, wind (its vector, read by
newer versions), windvane, rng (a range finder that looks down), no_time_sync
(ArduPilot keeps its own frame rate).

"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "sitl",
        help="let ArduPilot fly the helicopter",
        description="Let an unmodified ArduCopter-heli fly the helicopter: a backend for "
        "ArduPilot's JSON interface, lock step. The helicopter stands on the ground, its rotor "
        "stopped, until the autopilot arms and spins it up.",
        epilog=_EPILOG + SCRIPTS + GROUND,
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
        help="frames a second of simulated time (default: 1000, one sample of ArduPilot's gyro "
        "each; it does not arm below 720)",
    )
    command.add_argument(
        "--seed", type=int, default=1, metavar="N", help="of the turbulence (default: 1)"
    )
    add_weather(command)
    add_ground(command)
    add_parameters(command)
    add_script(command)
    add_kept(command)
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.sitl import Link
    from helisim.sitl.link import check_fields

    check(options)
    also = check_fields(names(options.send))
    if options.script is not None:
        check_script(options)
        return fly(options, _aircraft(options), also)
    check_no_script(options)
    with Link(options.port, address=options.address, timeout=options.wait) as link:
        return serve(options, _aircraft(options), link, also)


def _aircraft(options: argparse.Namespace) -> "Aircraft":
    from helisim.sim import Weather
    from helisim.sitl import Aircraft
    from helisim.vehicle import load

    changed = parameters(options)
    return Aircraft(
        load(options.vehicle, parameters=changed),
        motor=changed.get("drive.governor") != "ideal",
        tail=options.tail,
        rate_hz=options.rate,
        ground=ground(options),
        weather=weather(options, Weather()),
        seed=options.seed,
        recorded=is_kept(options),
    )
