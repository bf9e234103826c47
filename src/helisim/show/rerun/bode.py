"""A Bode plot as Rerun's own shapes: it has no logarithmic axes, so the axes are drawn too.

Three panels below one another, as on the page of the report: magnitude, phase, coherence. A
point or line that is pointed at says its frequency and values. Drawn for the viewer's dark theme.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from helisim.base.units import decibel
from helisim.ident import USABLE_COHERENCE, FrequencyResponse
from helisim.show.bode import DEGREES, beside, decibels, phase_degrees, ratio_unit
from helisim.show.bode_drawing import SURE
from helisim.show.figure import Scale, extent

_ALONE = (1240.0, 1110.0)
"""Width and height of a drawing that has a tab for itself, in its own units.

A viewer scales a drawing but not its letters, which are some 20 units high, as they are in
one of four drawings of the size `_TOGETHER`.
"""
_TOGETHER = (640.0, 560.0)

_LEFT, _RIGHT, _BELOW = 62.0, 18.0, 62.0
"""Units around the panels: for the numbers of the axes, and the name of the frequency."""
_BETWEEN = 53.0
"""Units above each panel."""
_SHARES = (0.42, 0.38, 0.20)
"""Of the height: magnitude, phase, coherence."""
_ABOVE = 35.0
"""From the top of a panel up to where its name and its legend hang."""

_FRAME = (92, 99, 110)
_GRID = (43, 48, 55)
_TEXT = (200, 206, 214)
_DATA = (176, 184, 196)
_WEAK = (96, 103, 114)
_BAND = (66, 73, 84)
_IDENTIFIED = (72, 166, 255)
_TRUTH = (255, 152, 56)
_PARTIAL = (94, 210, 160)
_MULTIPLE = (150, 158, 170)
_UNUSED = (30, 33, 38)

# radii below zero are pixels, however a drawing is scaled
_HATCH = 2.0
"""Units between the lines that shade what the fit did not use."""
_DASH = (9.0, 6.0)
"""Units of a dash, and from one to the next."""


_TICK_ABOVE = 17.0
"""Units by which a number hangs above its line."""

_COHERENCE = Scale(0.0, 1.0, (0.0, USABLE_COHERENCE, 1.0), ("0", f"{USABLE_COHERENCE:g}", "1"))


@dataclass(frozen=True, eq=False)
class _Axis:
    """A scale in its place: from where it starts to where it ends, in units of the drawing."""

    scale: Scale
    start: float
    end: float

    def places(self, values: ArrayLike) -> NDArray[np.float64]:
        """Return where values (n_value,) are drawn; those outside at the edge."""
        inside = np.clip(np.asarray(values, dtype=float), self.scale.low, self.scale.high)
        return self.start + self.scale.share(inside) * (self.end - self.start)

    def holds(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which values are on the axis, (n_value,) each."""
        return (values >= self.scale.low) & (values <= self.scale.high)


def bode_size(pairs: int) -> tuple[float, float]:
    """Return width and height of the drawing of each of a model's pairs."""
    return _ALONE if pairs == 1 else _TOGETHER


def log_bode(
    recording: rr.RecordingStream,
    entity: str,
    output: str,
    input_: str,
    *,
    data: FrequencyResponse,
    identified: FrequencyResponse,
    truth: FrequencyResponse | None = None,
    used: tuple[float, float] | None = None,
    size: tuple[float, float],
) -> None:
    """Draw one pair below an entity: magnitude, phase, and the coherence of the data.

    Args:
        recording: that is drawn into.
        entity: above the drawing's parts.
        output: of the pair, in each response that is given.
        input_: of the pair.
        data: estimated from flights; points below a coherence of 0.6 are dim and have no bars of
            two random errors.
        identified: the fitted model's.
        truth: the exact one of the vehicle that flew; None for a real one.
        used: lowest and highest frequency of the fit, rad/s; None if the pair was left out.
        size: width and height of the drawing.
    """
    models = {"identified": identified, "exact": truth}
    drawn = _Drawing(recording, entity, (output, input_), data, models, size)
    drawn.log_axes(used)
    drawn.log_data()
    drawn.log_models()
    drawn.log_coherence()
    drawn.log_legend()


class _Drawing:
    """One pair on its way into a recording."""

    def __init__(
        self,
        recording: rr.RecordingStream,
        entity: str,
        pair: tuple[str, str],
        data: FrequencyResponse,
        models: Mapping[str, FrequencyResponse | None],
        size: tuple[float, float],
    ) -> None:
        self.recording, self.entity = recording, entity
        self.unit = ratio_unit(data, *pair)
        self.omega = data.frequency
        o, i = data.index(*pair)
        self.coherence = data.coherence[o, i]
        self.multiple = data.multiple_coherence[o]
        self.error = data.random_error[o, i]
        self.good = data.usable()[o, i]
        line = data.response[o, i]
        self.gain, self.phase = decibels(line), phase_degrees(line, self.good)
        self.lines: list[tuple[str, FrequencyResponse, NDArray, NDArray]] = []
        for name, response in models.items():
            if response is not None:
                values = response.response[response.index(*pair)]
                sure = self.omega[self.good], self.phase[self.good]
                phase = beside(response.frequency, values, *sure)
                self.lines.append((name, response, decibels(values), phase))
        shared = Scale.decades(float(self.omega[0]) / 1.08, float(self.omega[-1]) * 1.08)
        self.axis = _Axis(shared, _LEFT, size[0] - _RIGHT)
        places = _places(size[1])
        gains = [self.gain[self.good], *(gain for _, _, gain, _ in self.lines)]
        phases = [self.phase[self.good], *(phase for _, _, _, phase in self.lines)]
        self.panels = (
            _Axis(_around(gains, ()), *places[0]),
            _Axis(_around(phases, DEGREES), *places[1]),
            _Axis(_COHERENCE, *places[2]),
        )

    def log_axes(self, used: tuple[float, float] | None) -> None:
        """Draw frames, lines across, ticks and what is on each axis."""
        self._shade_unused(used)
        grid, frames, places, texts = [], [], [], []
        left, right = self.axis.start, self.axis.end
        across = self.axis.places(self.axis.scale.ticks)
        for panel in self.panels:
            for x in across:
                grid.append([[x, panel.end], [x, panel.start]])
            for y, text in zip(panel.places(panel.scale.ticks), panel.scale.texts):
                grid.append([[left, y], [right, y]])
                places.append([left - 24.0, y - _TICK_ABOVE])
                texts.append(text)
            corners = ((left, panel.end), (right, panel.end))
            below = ((right, panel.start), (left, panel.start))
            frames.append([*corners, *below, corners[0]])
        for x, text in zip(across, self.axis.scale.texts):
            places.append([x, self.panels[-1].start + 1.0])
            texts.append(text)
        self._strips("axes/grid", grid, _GRID, 0.5, 1.0)
        self._strips("axes/frame", frames, _FRAME, 0.7, 2.0)
        self._texts("axes/ticks", places, texts)
        names = (f"magnitude, dB ({self.unit})", "phase, deg", "coherence")
        at = [
            [_LEFT + 4.0 * len(name) + 6.0, p.end - _ABOVE] for name, p in zip(names, self.panels)
        ]
        at.append([0.5 * (left + right), self.panels[-1].start + 27.0])
        self._texts("axes/names", at, [*names, "frequency, rad/s"])

    def _shade_unused(self, used: tuple[float, float] | None) -> None:
        if used is None:
            return
        low, high = self.axis.places(used)
        left, right = self.axis.start, self.axis.end
        strips = [
            [[x, panel.end], [x, panel.start]]
            for panel in self.panels
            for start, stop in ((left, low), (high, right))
            for x in np.arange(start + _HATCH, stop - _HATCH, _HATCH)
        ]
        if strips:
            self._strips("axes/unused", strips, _UNUSED, 1.2, 0.0)

    def log_data(self) -> None:
        """Draw the estimate, and two random errors around it."""
        x = self.axis.places(self.omega)
        spread = decibel(1.0 + SURE * self.error)
        turn = np.rad2deg(np.minimum(SURE * self.error, np.pi))
        bars, inside, weak, said, doubted = [], [], [], [], []
        for panel, values, half in (
            (self.panels[0], self.gain, spread),
            (self.panels[1], self.phase, turn),
        ):
            y = panel.places(values)
            low, high = panel.places(values - half), panel.places(values + half)
            for k in np.flatnonzero(panel.holds(values)).tolist():
                point = [x[k], y[k]]
                (inside if self.good[k] else weak).append(point)
                (said if self.good[k] else doubted).append(self._value(k))
                if self.good[k]:
                    bars.append([[x[k], low[k]], [x[k], high[k]]])
        self._strips("random_error", bars, _BAND, 2.2, 3.0)
        self._points("data", inside, said, _DATA, 3.0, 5.0)
        self._points("below_usable_coherence", weak, doubted, _WEAK, 2.2, 4.0)

    def _value(self, k: int) -> str:
        return (
            f"{self.omega[k]:.4g} rad/s: {self.gain[k]:.2f} dB, {self.phase[k]:.1f} deg, "
            f"coherence {self.coherence[k]:.3f}"
        )

    def log_models(self) -> None:
        """Draw the identified model, and the truth dashed above it."""
        for name, response, gain, phase in self.lines:
            inside = self.axis.holds(response.frequency)
            x = self.axis.places(response.frequency[inside])
            strips = []
            for panel, values in ((self.panels[0], gain), (self.panels[1], phase)):
                strip = np.column_stack([x, panel.places(values[inside])])
                strips += [strip] if name == "identified" else list(_dashes(strip))
            colour, radius, order = (
                (_IDENTIFIED, 1.1, 6.0) if name == "identified" else (_TRUTH, 0.9, 7.0)
            )
            self._strips(name, strips, colour, radius, order)

    def log_coherence(self) -> None:
        """Draw partial and multiple coherence."""
        x, panel = self.axis.places(self.omega), self.panels[2]
        multiple = np.column_stack([x, panel.places(self.multiple)])
        partial = np.column_stack([x, panel.places(self.coherence)])
        self._strips("coherence/multiple", list(_dashes(multiple)), _MULTIPLE, 0.7, 5.0)
        self._strips("coherence/partial", [partial], _PARTIAL, 1.0, 6.0)

    def log_legend(self) -> None:
        """Name what is drawn, each in its colour."""
        top = [("flight data", _DATA)]
        top += [(name, _IDENTIFIED if name == "identified" else _TRUTH) for name, *_ in self.lines]
        below = [("partial", _PARTIAL), ("multiple", _MULTIPLE)]
        if not self.good.all():
            below.insert(0, (f"data below {USABLE_COHERENCE}", _WEAK))
        for part, entries, y in (
            ("models", top, self.panels[0].end - _ABOVE),
            ("coherence", below, self.panels[2].end - _ABOVE),
        ):
            right = self.axis.end
            places, colours = [], []
            for text, colour in reversed(entries):
                width = 8.0 * len(text)
                places.append([right - 0.5 * width, y])
                colours.append(colour)
                right -= width + 22.0
            texts = [text for text, _ in reversed(entries)]
            self._texts(f"legend/{part}", places, texts, colours)

    def _strips(
        self,
        part: str,
        strips: Sequence,
        colour: tuple[int, int, int],
        radius: float,
        order: float,
    ) -> None:
        radii = [-radius]
        self._log(part, rr.LineStrips2D(strips, colors=[colour], radii=radii, draw_order=order))

    def _points(
        self,
        part: str,
        places: Sequence,
        said: Sequence[str],
        colour: tuple[int, int, int],
        radius: float,
        order: float,
    ) -> None:
        if places:
            points = rr.Points2D(
                places,
                colors=[colour],
                radii=[-radius],
                labels=said,
                show_labels=False,
                draw_order=order,
            )
            self._log(part, points)

    def _texts(
        self,
        part: str,
        places: Sequence,
        texts: Sequence[str],
        colours: Sequence[tuple[int, int, int]] = (_TEXT,),
    ) -> None:
        self._log(
            part,
            rr.Points2D(
                places,
                labels=texts,
                colors=list(colours),
                radii=[0.0],
                show_labels=True,
                draw_order=9.0,
            ),
        )

    def _log(self, part: str, archetype: rr.AsComponents) -> None:
        self.recording.log(f"{self.entity}/{part}", archetype, static=True)


def _places(height: float) -> list[tuple[float, float]]:
    """Return bottom and top of the three panels of a drawing; down is positive."""
    free, top, places = height - 3.0 * _BETWEEN - _BELOW, 0.0, []
    for share in _SHARES:
        bottom = top + _BETWEEN + share * free
        places.append((bottom, top + _BETWEEN))
        top = bottom
    return places


def _around(values: Sequence[NDArray[np.float64]], steps: Sequence[float]) -> Scale:
    """Return a scale that holds all values, (n_value,) each, with a margin."""
    low, high = extent(values)
    room = 0.08 * (high - low)
    return Scale.of(low - room, high + room, most=6, steps=steps)


def _dashes(strip: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Cut a line (n, 2) into dashes, each (m, 2)."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(strip, axis=0), axis=1))])
    for start in np.arange(0.0, along[-1], sum(_DASH)):
        stop = min(start + _DASH[0], along[-1])
        at = np.concatenate([[start], along[(along > start) & (along < stop)], [stop]])
        yield np.column_stack([np.interp(at, along, strip[:, k]) for k in range(2)])
