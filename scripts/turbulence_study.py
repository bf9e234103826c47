"""The base helicopter identified from flights in turbulence: joint and direct estimates.

python scripts/turbulence_study.py [SEEDS] [LEVEL] [FLIGHTS]
"""

import sys
from statistics import mean

from helisim.sim import Weather
from helisim.study.turbulence import SWEEPS, turbulence_study
from helisim.vehicle import load

LIMIT = 10.0
"""Percent of the truth that a joint estimate may be off."""


def main(seeds: int = 3, level: str = "light", flights: int = 20) -> int:
    """Print each parameter's error of truth by seed; return 1 if one is too large."""
    vehicle, weather = load(), Weather(turbulence=level)
    air = weather.dryden
    assert air is not None
    print(
        f"{level} turbulence of MIL-F-8785C at {weather.height:g} m: rms "
        f"{air.rms[0]:.2f} m/s level, {air.rms[2]:.2f} m/s vertical, scale lengths "
        f"{air.lengths[0]:.0f} and {air.lengths[2]:.0f} m, drifting past at {air.speed:.1f} m/s"
    )
    for sweep in (one.on(vehicle.parameters) for one in SWEEPS.values()):
        low, high = sweep.band
        print(
            f"{flights} {sweep.axis} sweeps of {sweep.duration:g} s, amplitude "
            f"{sweep.amplitude:g}, {low:g} to {high:g} rad/s"
        )
    found = [
        turbulence_study(vehicle, weather=weather, flights=flights, seed=seed)
        for seed in range(1, seeds + 1)
    ]
    print("percent: the mean of the air over calm air, and the estimates' errors of that mean")
    heads = "".join(f"{f'seed {seed}':>9}" for seed in range(1, seeds + 1))
    print(f"{'':<8}{'of calm':>9}{heads}{'stated +-':>11}{'direct':>9}")
    for same in zip(*found):
        air = 100.0 * (same[0].truth / same[0].calm - 1.0)
        errors = "".join(f"{one.joint_percent:>+9.1f}" for one in same)
        stated = mean(abs(100.0 * one.joint_error / one.truth) for one in same)
        print(
            f"{same[0].name:<8}{air:>+9.1f}{errors}{stated:>11.1f}"
            f"{mean(one.direct_percent for one in same):>+9.1f}"
        )
    worst = max(abs(one.joint_percent) for study in found for one in study)
    print(f"worst joint estimate: {worst:.1f} % off, {LIMIT:g} % allowed")
    return 0 if worst <= LIMIT else 1


if __name__ == "__main__":
    numbers = sys.argv[1:2], sys.argv[3:4]
    raise SystemExit(main(*map(int, numbers[0]), *sys.argv[2:3], *map(int, numbers[1])))
