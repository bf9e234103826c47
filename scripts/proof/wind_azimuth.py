"""Pedal beyond the calm hover's over the wind's direction, from ahead, then over the right.

python scripts/proof/wind_azimuth.py
"""

import math

from helisim.vehicle import load

AZIMUTHS = range(0, 360, 30)

if __name__ == "__main__":
    for name in ("jr700", "lynx"):
        vehicle = load(name)
        print(f"{name:<6} deg" + "".join(f"{degrees:>7}" for degrees in AZIMUTHS))
        for speed in (5, 10, 15):
            print(f"{speed:>6} m/s", end="")
            for azimuth in map(math.radians, AZIMUTHS):
                wind = (-speed * math.cos(azimuth), -speed * math.sin(azimuth), 0.0)
                pedal = vehicle.trimmed(wind=wind).trim.ped - vehicle.trim.ped
                print(f"{pedal:>7.3f}", end="")
            print()
