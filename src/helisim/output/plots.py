"""Figures of frequency responses, verifications and flights, in one style.

Drawn for a page that is read on a phone and printed in grey: one column wide, curves told
apart by lightness and dashes, units on every axis. Hz and degrees are for people; the value
objects stay in rad/s and rad.
"""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MultipleLocator, NullFormatter
from numpy.typing import NDArray

from helisim.ident import USABLE_COHERENCE, FrequencyResponse, Verification
from helisim.records.channels import ATTITUDES, IN1, RATES
from helisim.records.files import atomic_write
from helisim.records.record import FlightRecord
from helisim.units import decibel
from helisim.vehicle import Vehicle

DATA = "#a6a6a6"
IDENTIFIED = "#0b3c7d"
TRUTH = "#c8460f"

_WIDTH = 4.2
"""Inches: 403 px of a page, so that text of 9 points stays readable on a phone of 390 px."""
_LEFT, _RIGHT, _TOP, _BOTTOM, _BETWEEN = 0.88, 0.12, 0.25, 0.46, 0.14
"""Inches around the axes, and between one and the next."""
_LABEL = 0.56
"""Inches from the axes to the name of what is drawn: five digits, a sign and a point between."""
_DPI = 200

_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titley": 1.0,
    "axes.labelsize": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.edgecolor": "#444444",
    "axes.linewidth": 0.7,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "path",  # the same letters on every machine
    "svg.hashsalt": "helisim",  # the same bytes for the same figure
}

_INKS = (IDENTIFIED, TRUTH, "#5c5c5c", "#4d9a5b")
_DASHES: tuple[tuple[float, ...], ...] = ((), (5.0, 2.0), (1.5, 1.5), (6.0, 1.5, 1.5, 1.5))


@dataclass(frozen=True, eq=False)
class Drawing:
    """One figure, drawn.

    Attributes:
        name: for its files, such as "bode_yaw_base_r_ped".
        title: for people.
        caption: what to see in it.
        svg: text; long time histories in it are pictures.
        png: the same, 200 dots an inch.
    """

    name: str
    title: str
    caption: str
    svg: str
    png: bytes

    def write(self, folder: Path) -> None:
        """Write NAME.svg and NAME.png into a folder that exists. Raises StorageError."""
        with atomic_write(folder / f"{self.name}.svg") as path:
            path.write_text(self.svg, encoding="utf-8")
        with atomic_write(folder / f"{self.name}.png") as path:
            path.write_bytes(self.png)


def draw_bode(
    name: str,
    output: str,
    input_: str,
    *,
    data: FrequencyResponse | None = None,
    identified: FrequencyResponse | None = None,
    truth: FrequencyResponse | None = None,
    used: tuple[float, float] | None = None,
    caption: str = "",
) -> Drawing:
    """Draw one pair: magnitude, phase, and the coherence of the data.

    Args:
        name: of the drawing.
        output: of the pair, in each response that is given.
        input_: of the pair.
        data: estimated from flights; points below the usable coherence are hollow, the band is
            its random error.
        identified: the fitted model's.
        truth: the exact one of the vehicle that flew.
        used: lowest and highest frequency of the fit, rad/s; None if the pair was left out.
        caption: of the drawing.
    """
    title = f"{output} / {input_}"
    count = 3 if data is not None else 2
    with _figure(1.75 * count, count) as (figure, axes):
        magnitude, phase = axes[:2]
        turns = 0.0
        if data is not None:
            turns = _draw_data(data, output, input_, magnitude, phase, axes[2])
        for response, label, colour, dashes in (
            (identified, "identified", IDENTIFIED, ()),
            (truth, "truth", TRUTH, (4.0, 2.5)),
        ):
            if response is None:
                continue
            line = response.response[response.index(output, input_)]
            degrees = _phase(line)
            if data is None and response is identified:
                turns = _mean(degrees)
            degrees += 360.0 * np.round((turns - _mean(degrees)) / 360.0)
            width = 2.0 if label == "identified" else 1.2  # the truth is seen on top of it
            style = {"color": colour, "dashes": dashes, "linewidth": width, "zorder": 3}
            magnitude.semilogx(response.frequency, _decibels(line), label=label, **style)
            phase.semilogx(response.frequency, degrees, **style)
        for ax in axes:
            _shade_unused(ax, used)
        magnitude.set_title(title)
        magnitude.set_ylabel(f"magnitude, dB\n({_ratio_unit(data, output, input_)})")
        phase.set_ylabel("phase, deg")
        low, high = phase.get_ylim()
        phase.yaxis.set_major_locator(MultipleLocator(45.0 if high - low < 270.0 else 90.0))
        axes[-1].xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes[-1].xaxis.set_major_formatter("{x:g}")
        axes[-1].xaxis.set_minor_formatter(NullFormatter())
        axes[-1].set_xlabel("frequency, rad/s")
        magnitude.legend(loc="best")
        return _drawing(figure, name, title, caption)


def _draw_data(
    data: FrequencyResponse,
    output: str,
    input_: str,
    magnitude: Axes,
    phase: Axes,
    coherence: Axes,
) -> float:
    """Draw the estimate and return its mean phase, degrees."""
    o, i = data.index(output, input_)
    omega, line, error = data.frequency, data.response[o, i], data.random_error[o, i]
    decibels, degrees = _decibels(line), _phase(line)
    good = data.usable()[o, i]
    spread = decibel(1.0 + error)
    for ax, middle, half in (
        (magnitude, decibels, spread),
        (phase, degrees, np.rad2deg(np.minimum(error, np.pi))),
    ):
        ax.fill_between(
            omega, middle - half, middle + half, where=good, color="#dedede", linewidth=0.0
        )
        label = "flight data" if ax is magnitude else None
        dots = {"linestyle": "none", "marker": "o", "markersize": 2.6, "zorder": 2}
        ax.semilogx(omega[good], middle[good], color=DATA, label=label, **dots)
        if not good.all():
            label = f"coherence below {USABLE_COHERENCE}" if ax is magnitude else None
            hollow = {"markerfacecolor": "none", "markeredgewidth": 0.5, "color": DATA}
            ax.semilogx(omega[~good], middle[~good], label=label, **(dots | hollow))
    coherence.semilogx(omega, data.coherence[o, i], color=IDENTIFIED, label="partial")
    coherence.semilogx(
        omega, data.multiple_coherence[o], color="#8c8c8c", dashes=(4.0, 1.5), label="multiple"
    )
    coherence.axhline(USABLE_COHERENCE, color="#444444", linewidth=0.7, linestyle=":")
    coherence.set_ylim(0.0, 1.04)
    coherence.set_ylabel("coherence")
    coherence.legend(loc="lower center", ncols=2)
    return _mean(degrees)


def draw_verification(
    name: str, verification: Verification, inputs: Sequence[str], trace: int, flight: str
) -> Drawing:
    """Draw one flight, measured and predicted, below the inputs that drove it."""
    shown = verification.traces[trace]
    count = 1 + len(verification.outputs)
    with _figure(0.5 + 1.45 * count, count) as (figure, axes):
        for k, input_ in enumerate(inputs):
            axes[0].plot(shown.time, shown.inputs[:, k], label=input_, **_ink(k))
        axes[0].set_ylabel("input")
        axes[0].legend(loc="upper right", ncols=2)
        for k, (ax, output, unit) in enumerate(
            zip(axes[1:], verification.outputs, verification.units)
        ):
            ax.plot(shown.time, shown.measured[:, k], color=DATA, linewidth=2.2, label="flight")
            ax.plot(shown.time, shown.predicted[:, k], color=IDENTIFIED, label="identified model")
            ax.set_ylabel(_labelled(output, unit))
        axes[1].legend(loc="upper right", ncols=2)
        axes[0].set_title(f"{flight}: {', '.join(verification.outputs)} predicted")
        axes[-1].set_xlabel("time, s")
        tics = ", ".join(
            f"{output} {tic:.3g}" for output, tic in zip(verification.outputs, shown.tic)
        )
        return _drawing(figure, name, f"{flight}, predicted", f"{flight}: TIC {tics}")


def draw_flight(name: str, title: str, record: FlightRecord, channels: Sequence[str]) -> Drawing:
    """Draw time histories of some channels of a record, one below the other."""
    with _figure(0.5 + 1.0 * len(channels), len(channels)) as (figure, axes):
        for ax, channel in zip(axes, channels):
            degrees = channel in (*RATES, *ATTITUDES)
            unit = record.unit(channel).replace("rad", "deg") if degrees else record.unit(channel)
            values = np.rad2deg(record[channel]) if degrees else record[channel]
            # thousands of samples: a picture is smaller than their path
            ax.plot(record.time, values, color=IDENTIFIED, linewidth=0.7, rasterized=True)
            ax.set_ylabel(_labelled(channel, unit))
            ax.margins(x=0.0)
        axes[0].set_title(title)
        axes[-1].set_xlabel("time, s")
        return _drawing(figure, name, title, f"{title}, {record.duration:g} s")


def draw_trims(flights: Sequence[Vehicle]) -> Drawing:
    """Draw level flight over speed: power, controls, attitude."""
    speeds = [flight.trim.speed for flight in flights]
    with _figure(6.0, 3) as (figure, (power, controls, attitude)):
        power.plot(speeds, [flight.power for flight in flights], marker=".", color=IDENTIFIED)
        power.set_ylabel("main rotor power, W")
        for k, name in enumerate(IN1):
            values = [getattr(flight.trim, name) for flight in flights]
            controls.plot(speeds, values, label=name, **_ink(k))
        controls.set_ylabel("controls, unitised")
        for k, name in enumerate(("theta", "phi")):
            values = [np.rad2deg(getattr(flight.trim, name)) for flight in flights]
            attitude.plot(speeds, values, label=name, **_ink(k))
        attitude.set_ylabel("attitude, deg")
        for axes in (controls, attitude):
            axes.margins(y=0.2)
            axes.legend(loc="lower left", ncols=4)
        title = f"{flights[0].name} in level flight"
        power.set_title(title)
        attitude.set_xlabel("speed, m/s")
        return _drawing(figure, "trim", title, f"{title}: power, controls and attitude over speed")


@contextmanager
def _figure(height: float, rows: int) -> Iterator[tuple[Figure, list[Axes]]]:
    """Give the axes of a figure; where they are, and their labels, is the same for all figures.

    To let matplotlib find room for the labels takes as long as two drawings.
    """
    wide, high = _WIDTH - _LEFT - _RIGHT, height - _TOP - _BOTTOM
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH, height), dpi=_DPI)
        each = (high - (rows - 1) * _BETWEEN) / rows
        axes: list[Axes] = []
        for row in range(rows):
            bottom = _BOTTOM + (rows - 1 - row) * (each + _BETWEEN)
            place = (_LEFT / _WIDTH, bottom / height, wide / _WIDTH, each / height)
            ax = figure.add_axes(place, sharex=axes[0] if axes else None)
            ax.tick_params(labelbottom=row == rows - 1)
            ax.yaxis.set_label_coords(-_LABEL / wide, 0.5)
            axes.append(ax)
        yield figure, axes


def _drawing(figure: Figure, name: str, title: str, caption: str) -> Drawing:
    picture, text = io.BytesIO(), io.StringIO()
    # by the canvases themselves: `Figure.savefig` draws everything once more before
    FigureCanvasAgg(figure).print_png(picture, metadata={"Software": None})
    FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None, "Title": title})
    return Drawing(name, title, caption, text.getvalue(), picture.getvalue())


def _labelled(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name}, {unit}"


def _ink(k: int) -> dict[str, Any]:
    return {"color": _INKS[k % len(_INKS)], "dashes": _DASHES[k % len(_DASHES)]}


def _shade_unused(ax: Axes, used: tuple[float, float] | None) -> None:
    """Grey what the fit did not use, within what is drawn."""
    if used is None:
        return
    low, high = ax.get_xlim()
    for start, stop in ((low, used[0] * 0.99), (used[1] * 1.01, high)):
        if stop > start:
            ax.axvspan(start, stop, color="#f3f3f3", linewidth=0.0, zorder=0)
    ax.set_xlim(low, high)


def _ratio_unit(data: FrequencyResponse | None, output: str, input_: str) -> str:
    if data is None:
        return "SI"
    o, i = data.index(output, input_)
    over, under = data.output_units[o] or "1", data.input_units[i] or "1"
    return over if under == "1" else f"{over} / {under}"


def _decibels(line: NDArray[np.complex128]) -> NDArray[np.float64]:
    return decibel(np.maximum(np.abs(line), 1e-12))


def _phase(line: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.rad2deg(np.unwrap(np.angle(line)))


def _mean(degrees: NDArray[np.float64]) -> float:
    return float(np.median(degrees))
