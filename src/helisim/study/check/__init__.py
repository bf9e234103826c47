"""What is wrong with a vehicle's folder: every problem at once, with its line and the remedy."""

from helisim.study.check.problem import Problem
from helisim.study.check.vehicle_check import VehicleCheck, check_vehicle

__all__ = ["Problem", "VehicleCheck", "check_vehicle"]
