"""What rotors, gears and motor shake into the gyros and accelerometers that an autopilot reads.

Tones are sampled at the frames, so those above half of their rate appear below it, as in a log.
Sources: Bramwell, Done and Balmford, Helicopter Dynamics, ch. 8 (of hub loads that are alike on
each of n blades the fuselage feels n/rev and 2n/rev; what differs between blades, 1/rev).
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from helisim.base.errors import ModelError
from helisim.base.units import STANDARD_GRAVITY
from helisim.sitl.link import Sensed
from helisim.vehicle.parameters import glossary

# Shares of a tone's rate in p, q, r and of its force in x, y, z: a hub turns the fuselage most
# about the axis of least inertia, a tail rotor pushes to the side.
_SHARES = {
    "main": (1.0, 0.5, 0.1, 1.0, 1.0, 0.1),  # imbalance and tracking: turns with the hub
    "blade": (1.0, 0.5, 0.2, 0.3, 0.3, 1.0),
    "twice": (1.0, 0.5, 0.2, 0.3, 0.3, 1.0),
    "tail": (0.3, 0.3, 1.0, 0.1, 1.0, 0.3),
    "tail_blade": (0.2, 0.2, 1.0, 0.1, 1.0, 0.1),
    "motor": (0.5, 0.5, 0.5, 0.5, 0.5, 1.0),
}


class Vibration:
    """A vehicle's vibration, frame by frame from its start; the same with the same seed."""

    def __init__(self, parameters: Mapping[str, float], period: float, seed: int = 1) -> None:
        """Take [vibration] of a vehicle, and the frames' period, s. Raises ModelError without."""
        known = [name for name in glossary() if name.startswith("vibration.")]
        if missing := [name for name in known if name not in parameters]:
            raise ModelError(
                f"the vehicle has no numbers of its vibration: expected {', '.join(missing)} in "
                "its parameters.toml, as the JR700 has them; add them, or fly without vibration"
            )
        own = {name.partition(".")[2]: parameters[name] for name in known}
        blades, radius, speed = (
            parameters[f"main_rotor.{one}"] for one in ("blades", "radius", "speed")
        )
        tail, passing = parameters["tail_rotor.speed"] / speed, parameters["tail_rotor.blades"]
        turns = 1.0, blades, 2.0 * blades, tail, passing * tail, parameters.get("drive.gear", 1.0)
        sizes = [3 * [own[f"{name}_rate"]] + 3 * [own[f"{name}_force"]] for name in _SHARES]
        self._turns, self._sizes = np.array(turns), np.array(sizes) * [*_SHARES.values()]
        self._passes = [name in ("blade", "twice", "tail_blade") for name in _SHARES]
        self._noise = np.array(3 * [own["noise_rate"]] + 3 * [own["noise_force"]])
        self._ahead, self._step = own["growth"] / (speed * radius), speed * period
        self._keeps = math.exp(-period / own["drift_time"])
        self._drifts = own["drift"] * math.sqrt(1.0 - self._keeps**2)
        self._random = np.random.default_rng(seed)
        self._phases = self._random.uniform(0.0, 2.0 * math.pi, self._sizes.shape)
        self._angle = self._drift = 0.0

    def shaken(self, sensed: Sensed, speed: float) -> Sensed:
        """Return readings after one more frame, shaken; `speed` is the rotor's over the nominal.

        All grow with its square, blade passing with load factor and advance ratio, too.
        """
        random = self._random.standard_normal(7)
        self._drift = self._keeps * self._drift + self._drifts * float(random[6])
        self._angle += self._step * speed * (1.0 + self._drift)
        load = math.hypot(*sensed.force) / STANDARD_GRAVITY
        grown = load * (1.0 + self._ahead * math.hypot(*sensed.velocity[:2]))
        tones = np.sin(self._angle * self._turns[:, None] + self._phases) * self._sizes
        added = speed**2 * (np.where(self._passes, grown, 1.0) @ tones + self._noise * random[:6])
        return replace(sensed, gyro=sensed.gyro + added[:3], force=sensed.force + added[3:])
