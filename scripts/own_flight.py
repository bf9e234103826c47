"""Fly ArduPilot by a script of your own: up, five seconds to the right by the stick, home, down.

helisim sitl --script scripts/own_flight.py --log flight.bin
"""


def fly(pilot):
    """Fly; each step lets simulated time go by."""
    yield from pilot.take_off(3.0)
    yield from pilot.mode("alt_hold")
    pilot.sticks.roll = 0.1
    yield from pilot.wait(5.0)
    pilot.say(f"{pilot.sensed.velocity[1]:.1f} m/s to the right")
    pilot.sticks.roll = 0.0
    yield from pilot.go_to(0.0, 0.0, 3.0)
    yield from pilot.land()
