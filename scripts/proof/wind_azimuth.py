"""Pedal beyond the calm hover's over the wind's direction, from ahead, then over the right.

python scripts/proof/wind_azimuth.py
"""

import math

import common

from helisim.vehicle import load

AZIMUTHS = range(0, 360, 30)


def main() -> None:
    for name in ("jr700", "lynx"):
        vehicle, rows = load(name), []
        for speed in (5, 10, 15):
            ways = [
                (-speed * math.cos(a), -speed * math.sin(a)) for a in map(math.radians, AZIMUTHS)
            ]
            pedals = [vehicle.trimmed(wind=(*way, 0.0)).trim.ped for way in ways]
            rows.append((f"{speed:>6} m/s", *(pedal - vehicle.trim.ped for pedal in pedals)))
        common.table("|".join([f"{name:<6} deg:<10", *(f"{one}:7.3f" for one in AZIMUTHS)]), rows)


if __name__ == "__main__":
    common.run(main)
