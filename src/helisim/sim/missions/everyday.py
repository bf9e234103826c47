"""Ordinary flying: what a pilot of a model helicopter does in a few minutes, in random order."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from helisim.base.settings import setting
from helisim.records.record import AXES
from helisim.sim.missions.autopilot import Autopilot
from helisim.sim.missions.mission import Mission

_FAR = 12.0  # m, of the field in which it stays, north and east


@dataclass(frozen=True, kw_only=True)
class Everyday(Mission):
    """Hover with corrections, circuits, hard stops, pirouettes, pitch pumps, rolls; in turns.

    All is drawn from the flight's seed. `size` multiplies stick movements and accelerations;
    `speed` is the highest.
    """

    duration: float = setting(120.0, unit="s", low=1.0)
    size: float = setting(1.0, above=0.0, high=3.0)
    speed: float = setting(4.0, unit="m/s", above=1.0, high=30.0)

    def fly(self, pilot: Autopilot) -> Iterator[None]:
        """Fly one after the other until the time is over."""
        for _ in self._flown(pilot):
            yield
            if pilot.seen.time > self.duration - 1.5 * pilot.seconds:
                return

    def _flown(self, pilot: Autopilot) -> Iterator[None]:
        parts: tuple[tuple[str, Callable[[Autopilot], Iterator[None]]], ...] = (
            ("corrections", self._corrections),
            ("circuit", self._circuit),
            ("hard stop", self._stop),
            ("pirouette", self._pirouette),
            ("pitch pump", self._pump),
            ("roll", self._roll),
        )
        yield from pilot.hold(2.0)
        while True:
            for name, part in (parts[k] for k in pilot.rng.permutation(len(parts))):
                pilot.say(name)
                yield from part(pilot)
                yield from pilot.hold(pilot.rng.uniform(0.5, 2.0))

    def _corrections(self, pilot: Autopilot) -> Iterator[None]:
        for _ in range(int(pilot.rng.integers(4, 10))):
            axis, left = str(pilot.rng.choice(AXES)), pilot.rng.choice((-1.0, 1.0))
            push = left * self.size * pilot.rng.uniform(0.02, 0.08)
            yield from pilot.push(axis, push, pilot.rng.uniform(0.1, 0.4))
            yield from pilot.hold(pilot.rng.uniform(0.1, 0.8))

    def _circuit(self, pilot: Autopilot) -> Iterator[None]:
        for north, east in pilot.rng.uniform(-_FAR, _FAR, (2, 2)):
            course = math.atan2(east - pilot.wanted.east, north - pilot.wanted.north)
            yield from self._face(pilot, course)
            yield from pilot.go(
                north,
                east,
                speed=pilot.rng.uniform(0.5, 1.0) * self.speed,
                acceleration=self._hurry(pilot),
            )

    def _stop(self, pilot: Autopilot) -> Iterator[None]:
        wanted = pilot.wanted
        yield from self._face(pilot, math.atan2(-wanted.east, -wanted.north))
        speed = pilot.rng.uniform(0.6, 1.0) * self.speed
        yield from pilot.accelerate(speed, acceleration=self._hurry(pilot))
        yield from pilot.accelerate(0.0, acceleration=1.5 * self._hurry(pilot))

    def _pirouette(self, pilot: Autopilot) -> Iterator[None]:
        push = pilot.rng.choice((-1.0, 1.0)) * self.size * pilot.rng.uniform(0.15, 0.4)
        yield from pilot.push("ped", push, pilot.rng.uniform(0.5, 2.0))

    def _pump(self, pilot: Autopilot) -> Iterator[None]:
        yield from self._to_and_fro(pilot, "col", pilot.rng.uniform(0.08, 0.2))

    def _roll(self, pilot: Autopilot) -> Iterator[None]:
        yield from self._to_and_fro(pilot, str(pilot.rng.choice(("lat", "lon"))), 0.3)

    def _to_and_fro(self, pilot: Autopilot, axis: str, most: float) -> Iterator[None]:
        first = pilot.rng.choice((-1.0, 1.0)) * self.size * most
        for _ in range(int(pilot.rng.integers(1, 4))):
            lasts = pilot.rng.uniform(0.15, 0.35)
            for push in (first, -first):
                yield from pilot.push(axis, pilot.rng.uniform(0.6, 1.0) * push, lasts)

    def _face(self, pilot: Autopilot, course: float) -> Iterator[None]:
        turn = math.remainder(course - pilot.wanted.heading, 2.0 * math.pi)
        yield from pilot.turn(turn, rate=pilot.rng.uniform(0.8, 2.0))

    def _hurry(self, pilot: Autopilot) -> float:
        return self.size * pilot.rng.uniform(1.5, 3.0)
