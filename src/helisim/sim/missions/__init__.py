"""Missions: flights by a script, with a pilot that holds position, velocity and heading."""

from helisim.sim.missions.autopilot import Autopilot
from helisim.sim.missions.everyday import Everyday
from helisim.sim.missions.mission import MISSIONS, Mission, Start, check_mission, missions_by_name
from helisim.sim.missions.shipped import Autorotation, Forward, TakeOffHoverLand

__all__ = [
    "MISSIONS",
    "Autopilot",
    "Autorotation",
    "Everyday",
    "Forward",
    "Mission",
    "Start",
    "TakeOffHoverLand",
    "check_mission",
    "missions_by_name",
]
