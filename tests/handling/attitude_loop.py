"""One axis in closed form: K/s^2 with a lag, rate and attitude feedback, a delay."""

from dataclasses import dataclass

import numpy as np

from helisim.handling.loop import GRID, Curve, History, axis_of


@dataclass(frozen=True)
class AttitudeLoop:
    """A `Loop` of one axis; the other attitude follows by a share.

    The law is u = k (s - angle) - k_rate rate, the plant angle / u = b / (s^2 (lag s + 1)), with
    a delay where responses are asked for.
    """

    axis: str = "lat"
    b: float = 40.0
    lag: float = 0.03
    k: float = 0.4
    k_rate: float = 0.12
    delay: float = 0.0
    share: float = 0.1
    frequency: tuple = tuple(GRID)

    @property
    def axes(self):
        return (axis_of(self.axis).name,)

    def curve(self, given=None):
        """Return what an input to the loop gives, closed; by default L, of s, plant and law."""
        omega = np.array(self.frequency)
        s, back = 1j * omega, self.k + 1j * omega * self.k_rate
        plant = self.b / (s**2 * (self.lag * s + 1.0)) * np.exp(-s * self.delay)
        around = plant * back
        return Curve(omega, given(plant, back) / (1.0 + around) if given else around)

    def broken(self, axis, at="actuators"):
        return self.curve()

    def disturbance(self, axis):
        return self.curve(lambda plant, back: 1.0)

    def command(self, axis, output=None):
        return self.curve(lambda plant, back: self.k * plant)

    def turned(self, axis, by):
        return self.curve(lambda plant, back: plant)

    def actuator(self, axis, by="stick"):
        return self.curve(lambda plant, back: self.k if by == "stick" else -back)

    @property
    def poles(self):
        return np.roots(self.closed)

    @property
    def closed(self):
        """Its denominator, the delay left out."""
        return [self.lag, 1.0, self.b * self.k_rate, self.b * self.k]

    def step(self, axis, *, size, duration):
        time = np.linspace(0.0, duration, 501)
        poles = self.poles
        residues = self.b * self.k / (poles * np.polyval(np.polyder(self.closed), poles))
        angle = size * (1.0 + (residues @ np.exp(poles[:, None] * time)).real)
        one = axis_of(axis)
        other = {"lat": "theta", "lon": "phi", "ped": "phi"}[one.name]
        rate = np.gradient(angle, time)
        return History(time, {one.angle: angle, one.rate: rate, other: self.share * angle})
