"""Swashplates that several tests use."""

from helisim.vehicle.parameters import Parameters, completed
from helisim.vehicle.swashplate import Swashplate

H3_120 = Swashplate.of(completed(Parameters({})))
"""What a vehicle has that doesn't say: three servos at 120 degrees, one at the nose."""
