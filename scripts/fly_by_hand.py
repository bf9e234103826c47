"""Move the sticks from a program while the flight goes on; record it, and identify the yaw.

    python scripts/fly_by_hand.py [RECORD]

The hand here wiggles the pedals ever faster; put your own there, or fly with keys or a joystick:
helisim view --keyboard.
"""

import math
import sys

import helisim as hs

path = sys.argv[1] if len(sys.argv) > 1 else "by_hand.parquet"

flight = hs.HandFlight(hs.load("jr700"), assist="hover", height=10.0)
flight.start_recording()
for k in range(4500):  # 90 s from 1 to 20 rad/s, looked at 50 times a second
    flight.fly(0.02, ped=0.1 * math.sin(30.0 * math.expm1(k / 1500.0)))
record = flight.stop_recording()
hs.write_record(record, path)
print(
    f"Written: {path}, {record.duration:.1f} s, flown with {record.provenance['by_hand']['with']}"
)

response = hs.frequency_response([record], inputs=["PED"], outputs=["r"], band=(2.0, 15.0))
print(f"coherence of r / PED: {response.coherence.mean():.2f}")

landing = hs.HandFlight(flight.vehicle)
landing.fly(6.0, col=-0.4)
print(f"landed: {landing.crashed or 'upright'}")
