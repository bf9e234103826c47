"""A closed loop as flight records show it."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

from helisim.base.value import Value
from helisim.handling.loop import BY_NAME, Curve, History, NoResponse, axis_of
from helisim.handling.measured.cut import Cut
from helisim.handling.measured.driven import Complex, Driven, pairs
from helisim.handling.measured.measured_curve import MeasuredCurve

DRAWS = 400
"""How many draws there are: their standard deviation is known to 1 / sqrt(2 x 400), 3.5 %."""

_GAIN, _PHASE = 0.006, 0.002
"""By which a loop's gain, and its phase in rad, may differ in flight from those at trim: standard
deviations. A vehicle that drifts in light turbulence, hands off, isn't the one at trim: the JR700's
tail has 1 % less gain at 1.4 m/s, and 0.25 % less by the size of a proof's sweeps. No scatter shows
that."""


@dataclass(frozen=True, eq=False)
class MeasuredCurves(Value):
    """What was measured, as curves with their draws. Each is made once.

    Attributes:
        driven: responses to each signal that was injected, sticks too.
        cuts: where loops were cut.
        count: of draws.
        seed: of the draws.
    """

    driven: tuple[Driven, ...]
    cuts: tuple[Cut, ...]
    count: int = DRAWS
    seed: int = 1

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of which something was measured."""
        by_stick = {axis.stick: name for name, axis in BY_NAME.items()}
        cut = {one.axis for one in self.cuts if one.injected in self._drives}
        swept = {by_stick[name] for name in self._drives if name in by_stick}
        return tuple(name for name in BY_NAME if name in cut | swept)

    def broken(self, axis: str, at: str = "actuators") -> MeasuredCurve:
        """Return the loop L of one axis, all others closed. Raises NoResponse."""
        return self._at_cut(self._cut(axis, at), "L")

    def disturbance(self, axis: str) -> MeasuredCurve:
        """Return the sensitivity S at the attitude, or where it acts alone. Raises NoResponse."""
        name = axis_of(axis).name
        alone = [one for one in self._used if one.alone and one.axis == name]
        turned = any((one.axis, one.at) == (name, "sensors") for one in self._used)
        return self._at_cut(alone[0] if alone and not turned else self._cut(name, "sensors"), "S")

    def command(self, axis: str, output: str | None = None) -> MeasuredCurve:
        """Return an output over the axis's stick. Raises NoResponse.

        An angle follows from its rate, of which less noise is recorded.
        """
        one = axis_of(axis)
        return self._angle(one.stick, output or one.angle)

    def turned(self, axis: str, by: str) -> MeasuredCurve:
        """Return the axis's angle over what was added to a servo command. Raises NoResponse."""
        return self._angle(self._cut(by, "actuators").injected, axis_of(axis).angle)

    def actuator(self, axis: str, by: str = "stick") -> MeasuredCurve:
        """Return the axis's servo command over its stick or its disturbance. Raises NoResponse."""
        one = axis_of(axis)
        drive = one.stick if by == "stick" else self._cut(one.name, "sensors").injected
        return self._over(drive, one.name)

    def _angle(self, drive: str, wanted: str) -> MeasuredCurve:
        """Return an output over what was moved, an angle by its rate where that is recorded."""
        rate = {one.angle: one.rate for one in BY_NAME.values()}.get(wanted)
        if rate in self._driven(drive).outputs:
            return self._over(drive, str(rate), integrated=True)
        return self._over(drive, wanted)

    @cached_property
    def _drives(self) -> dict[str, Driven]:
        return {one.drive: one for one in self.driven}

    @cached_property
    def _draws(self) -> dict[str, Complex]:
        return {}

    @cached_property
    def _curves(self) -> dict[tuple[str, ...], MeasuredCurve]:
        return {}

    def _driven(self, drive: str) -> Driven:
        if drive not in self._drives:
            there = ", ".join(self._drives) or "nothing"
            raise NoResponse(f"{drive} was not moved on purpose in the records: {there} was")
        return self._drives[drive]

    @cached_property
    def _used(self) -> list[Cut]:
        """The cuts at which something was injected."""
        return [cut for cut in self.cuts if cut.injected in self._drives]

    def _cut(self, axis: str, at: str) -> Cut:
        name = axis_of(axis).name
        for cut in self._used:
            if (cut.axis, cut.at) == (name, at):
                return cut
        there = ", ".join(f"{cut.axis} at {cut.at}" for cut in self._used) or "no cut"
        raise NoResponse(f"nothing was injected into {name} at {at}; there is {there}")

    def _at_cut(self, cut: Cut, kind: str) -> MeasuredCurve:
        """Return L or S at a cut, from what goes on behind it and what comes back."""
        key = (kind, cut.axis, cut.at)
        if key not in self._curves:
            driven = self._driven(cut.injected)
            loop, loops = (
                _broken(cut, driven.outputs, one)
                for one in (driven.response, self._drawn(cut.injected))
            )
            changed = pairs(self.count, 1, self.seed + self.cuts.index(cut) + 1_000_000)
            loops = loops * (1.0 + _GAIN * changed.real + 1j * _PHASE * changed.imag)
            if kind == "S":
                loop, loops = 1.0 / (1.0 + loop), 1.0 / (1.0 + loops)
            name = f"{kind} of {cut.axis} at {cut.at}"
            self._curves[key] = MeasuredCurve.of(name, driven.frequency, loop, loops)
        return self._curves[key]

    def _over(self, drive: str, output: str, *, integrated: bool = False) -> MeasuredCurve:
        driven = self._driven(drive)
        if output not in driven.outputs:
            there = ", ".join(driven.outputs)
            raise NoResponse(
                f"{output} was not recorded while {drive} was moved; there are {there}"
            )
        key = (output, drive, "integrated" if integrated else "")
        if key not in self._curves:
            row = driven.outputs.index(output)
            factor = 1.0 / (1j * driven.frequency) if integrated else 1.0
            one, each = driven.response[row] * factor, self._drawn(drive)[:, row] * factor
            self._curves[key] = MeasuredCurve.of(
                f"{output} over {drive}", driven.frequency, one, each
            )
        return self._curves[key]

    def _drawn(self, drive: str) -> Complex:
        """Return the draws of the responses to what was injected, (n_draw, n_out, n_freq)."""
        if drive not in self._draws:
            seed = self.seed + 1000 * list(self._drives).index(drive)
            self._draws[drive] = self._driven(drive).drawn(self.count, seed)
        return self._draws[drive]


def _broken(cut: Cut, outputs: tuple[str, ...], response: Complex) -> Complex:
    """Return L, (..., n_freq), from responses (..., n_out, n_freq) to what was injected."""
    side = {name: response[..., row, :] for row, name in enumerate(outputs)}
    if cut.returned is None:
        return 1.0 / side[str(cut.total)] - 1.0
    back = side[cut.returned]
    return -back / (1.0 + back if cut.total is None else side[cut.total])


@dataclass(frozen=True, eq=False)
class MeasuredLoop(Value):
    """A `Loop` measured in flight, or one of the draws of it that are as likely.

    Attributes:
        curves: what was measured.
        draw: which of the draws this is; None for the measurement itself.
    """

    curves: MeasuredCurves = field(repr=False)
    draw: int | None = None

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of which something was measured."""
        return self.curves.axes

    @property
    def draws(self) -> "Iterator[MeasuredLoop]":
        """Loops as likely as this one, all errors belonging together as they were measured."""
        return (MeasuredLoop(self.curves, number) for number in range(self.curves.count))

    def broken(self, axis: str, at: str = "actuators") -> Curve:
        """Return the loop L of one axis, all others closed; see `Loop`."""
        return self.curves.broken(axis, at).curve(self.draw)

    def disturbance(self, axis: str) -> Curve:
        """Return the sensed angle over a disturbance of it; see `Loop`."""
        return self.curves.disturbance(axis).curve(self.draw)

    def command(self, axis: str, output: str | None = None) -> Curve:
        """Return an output over the axis's stick; see `Loop`."""
        return self.curves.command(axis, output).curve(self.draw)

    def turned(self, axis: str, by: str) -> Curve:
        """Return the axis's angle over what is added to a servo command; see `Loop`."""
        return self.curves.turned(axis, by).curve(self.draw)

    def actuator(self, axis: str, by: str = "stick") -> Curve:
        """Return the axis's servo command over its stick or its disturbance; see `Loop`."""
        return self.curves.actuator(axis, by).curve(self.draw)

    @property
    def poles(self) -> Complex:
        """The poles: not known from responses alone."""
        raise NoResponse("responses that were measured have no poles")

    def step(self, axis: str, *, size: float, duration: float) -> History:
        """Not known: a step is flown."""
        raise NoResponse(f"no step of {axis} follows from responses that were measured; fly one")
