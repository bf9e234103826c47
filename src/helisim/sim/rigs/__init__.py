"""Ground tests: the helicopter held by a rig, its rotor off, and what its records identify.

The bench and the turntable give the yaw gyro's gains, the suspension the centre of gravity
and with it the IMU's lever arm (Wu and Chen, sections 2 and 3.1).
"""

from helisim.sim.rigs.bench import PedalSteps as PedalSteps
from helisim.sim.rigs.bench import StickSweep as StickSweep
from helisim.sim.rigs.bench import TableSweep as TableSweep
from helisim.sim.rigs.bench import hang as hang
from helisim.sim.rigs.bench import hold as hold
from helisim.sim.rigs.bench import step_pedals as step_pedals
from helisim.sim.rigs.bench import suspension_points as suspension_points
from helisim.sim.rigs.bench import sweep_stick as sweep_stick
from helisim.sim.rigs.bench import turn as turn
from helisim.sim.rigs.found import LoopGains as LoopGains
from helisim.sim.rigs.found import PlumbLine as PlumbLine
from helisim.sim.rigs.found import attitude_sensitivity as attitude_sensitivity
from helisim.sim.rigs.found import centre_of_gravity as centre_of_gravity
from helisim.sim.rigs.found import loop_gains as loop_gains
from helisim.sim.rigs.found import plumb_line as plumb_line
from helisim.sim.rigs.procedures import Finding as Finding
from helisim.sim.rigs.procedures import RigTest as RigTest
from helisim.sim.rigs.procedures import bench_test as bench_test
from helisim.sim.rigs.procedures import run_rigs as run_rigs
from helisim.sim.rigs.procedures import suspension_test as suspension_test
from helisim.sim.rigs.procedures import turntable_test as turntable_test
