"""Ground tests: the helicopter held by a rig, its rotor off, and what its records identify.

The bench and the turntable give the yaw gyro's gains, the suspension the centre of gravity
and with it the IMU's lever arm (Wu and Chen, sections 2 and 3.1).
"""

from helisim.sim.rigs.finding import Finding, RigTest
from helisim.sim.rigs.gains import LoopGains, loop_gains
from helisim.sim.rigs.hold import (
    PedalSteps,
    StickSweep,
    TableSweep,
    hang,
    hold,
    step_pedals,
    suspension_points,
    sweep_stick,
    turn,
)
from helisim.sim.rigs.plumb import PlumbLine, centre_of_gravity, plumb_line
from helisim.sim.rigs.procedures import bench_test, run_rigs, turntable_test
from helisim.sim.rigs.suspension import attitude_sensitivity, suspension_test

__all__ = [
    "Finding",
    "LoopGains",
    "PedalSteps",
    "PlumbLine",
    "RigTest",
    "StickSweep",
    "TableSweep",
    "attitude_sensitivity",
    "bench_test",
    "centre_of_gravity",
    "hang",
    "hold",
    "loop_gains",
    "plumb_line",
    "run_rigs",
    "step_pedals",
    "suspension_points",
    "suspension_test",
    "sweep_stick",
    "turn",
    "turntable_test",
]
