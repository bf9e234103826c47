"""The loops of an ArduCopter-heli as flown, from logs of its mode SystemID: see `flown_loops`.

Whatever the mode sweeps moves an axis's command in the end, and the law from there to the command
is known from the log's own parameters: so each sweep of an axis is one that was added at its
command, where the loop is cut. RATE's outputs are what goes on behind the cut.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import InputError, LogError
from helisim.base.value import Value
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.handling.loop import axis_of
from helisim.handling.measured.margins import Cut, MeasuredMargins, margins
from helisim.look.systemid.cut_rows import OUTPUTS, PIDS, CutRows
from helisim.look.systemid.reading import opened_log
from helisim.look.systemid.sweeps import FlownSweep, sweeps
from helisim.records.record import FlightRecord

_WIDE = 3.0
"""Ratio of a band's ends that is worth a band."""
_FURTHER = "to see gain margins let the sweeps go on to a higher frequency: SID_F_STOP_HZ"
_BY_HAND = "or name what was injected: --axis, --injected and --total, with --channel"


@dataclass(frozen=True)
class FlownLog:
    """One log of which loops are measured.

    Attributes:
        path: the file.
        version: what wrote it.
        sweeps: that cut a loop, in their order; times after the log's first stamp.
    """

    path: str
    version: str
    sweeps: tuple[FlownSweep, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        sweeps = [one.to_dict() for one in self.sweeps]
        return {"path": self.path, "version": self.version, "sweeps": sweeps}

    def __str__(self) -> str:
        lines = [f"{self.path}: {self.version or 'ArduPilot'}"]
        return "\n".join([*lines, *(f"  {one}" for one in self.sweeps)])


@dataclass(frozen=True, eq=False)
class FlownLoops(Value):
    """What logs say of an autopilot's loops.

    Attributes:
        law: that flew the first sweep; None where the parameters are no helicopter's.
        logs: one each.
        records: one of each sweep, and of sweeps of the pilot's command one more, with the stick.
        cuts: of the records.
        remarks: of sweeps that cut no loop, of rows that a log lost, and of the law.
    """

    law: ArduCopterLaw | None
    logs: tuple[FlownLog, ...]
    records: tuple[FlightRecord, ...]
    cuts: tuple[Cut, ...]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        axes = ", ".join(cut.axis for cut in self.cuts) or "no axis"
        return f"FlownLoops({len(self.sweeps)} sweeps of {axes})"

    def __str__(self) -> str:
        lines = [str(one) for one in self.logs]
        lines.append("cut at the actuators, where 1 is full command of the mixer:")
        lines += [f"  {_said(cut.axis, self.sweeps)}" for cut in self.cuts]
        if self.law is not None:
            lines.append(
                f"law: its parameters in the log, {1.0 / self.law.period:.4g} ticks a second; "
                "what it answers to the pilot's own commands (Des of ANG or ATT) is taken out"
            )
        return "\n".join(lines)

    @property
    def sweeps(self) -> tuple[FlownSweep, ...]:
        """The sweeps of all logs."""
        return tuple(one for log in self.logs for one in log.sweeps)

    @property
    def bands(self) -> dict[str, tuple[float, float]]:
        """What was injected -> the band that all its sweeps have in common, rad/s."""
        found = {}
        for one in self.sweeps:
            axis = axis_of(one.sid_axis.control)
            for name in (f"{axis.name}_disturbance", axis.stick):
                low, high = found.get(name, (0.0, np.inf))
                found[name] = max(low, one.low), min(high, one.high)
        return {name: (low, high) for name, (low, high) in found.items() if high > _WIDE * low}

    def margins(self, **options: Any) -> MeasuredMargins:
        """Return crossover, margins and disturbance rejection with their intervals.

        Args:
            **options: of `helisim.margins`, such as axes, band or draws; by default each loop is
                measured in the band that its sweeps have in common.

        Raises:
            LogError: no sweep cut a loop.
        """
        if not self.records:
            raise LogError("; ".join(self.remarks) or "no sweep of the logs cuts a loop")
        options["band"] = options.get("band") or self.bands
        found = margins(self.records, cuts=self.cuts, **options)
        unseen = any(one.startswith("gain margin") for one in found.remarks)
        return replace(found, remarks=(*found.remarks, _FURTHER)) if unseen else found


def _said(axis: str, flown: Sequence[FlownSweep]) -> str:
    """Return where the signals of an axis's loop come from."""
    places = {one.sid_axis.place for one in flown if one.sid_axis.control == axis}
    total = f"RATE.{OUTPUTS[axis]}"
    if places == {"mixer"}:
        added, back = "SIDD.Targ, a tick later", f"{PIDS[axis]}'s P, I, D, FF, DFF"
    else:
        added, back = f"what {', '.join(sorted(places))} sweeps make of it", "the rest"
    return f"{axis}: goes on = {total}, injected = {added}, comes back = {back}"


def flown_loops(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    *,
    start: float | None = None,
    stop: float | None = None,
) -> FlownLoops:
    """Return the loops that logs with SystemID's sweeps show.

    Args:
        logs: of an ArduCopter-heli, one file or several.
        start: sweeps that begin before are left out, s after a log's first stamp.
        stop: sweeps that end after are left out, s after a log's first stamp.

    Raises:
        LogError: one has no sweeps, or says too seldom what the mixer was commanded.
    """
    paths = [logs] if isinstance(logs, str | PathLike) else list(logs)
    limits = (-np.inf if start is None else start, np.inf if stop is None else stop)
    laws: list[ArduCopterLaw | None] = []
    records: list[FlightRecord] = []
    remarks: list[str] = []
    flown = []
    for path in paths:
        log = opened_log(Path(path))[0].log
        first = min(log.first_stamps.values())
        every = sweeps(log, first, by_hand=_BY_HAND)
        mine = [one for one in every if limits[0] <= one.start and one.stop <= limits[1]]
        remarks += [one for sweep in mine if (one := _cuts_none(sweep))]
        used = tuple(sweep for sweep in mine if not _cuts_none(sweep))
        flown.append(FlownLog(str(path), log.version, used))
        if not used:
            continue
        shifted = [replace(one, start=one.start + first, stop=one.stop + first) for one in used]
        rows = CutRows.of(log, shifted)
        remarks += rows.remarks
        for sweep in shifted:
            law, why = _law(rows, sweep)
            laws.append(law)
            if law is None and sweep.sid_axis.place != "mixer":
                remarks.append(f"{sweep}: not measured, as {why}")
            else:
                records += rows.records(sweep, law)
            if sweep.sid_axis.place == "input" and rows.moved(sweep):
                remarks.append(
                    f"{sweep.sid_axis}: the pilot moved that stick too: his answer is part of "
                    "bandwidth and phase delay"
                )
    if laws and laws[0] is not None:
        remarks += laws[0].remarks
        if any(one is not None and one.rates != laws[0].rates for one in laws):
            remarks.append("gains were changed between sweeps: the loop is a mean of both")
    cuts = tuple(
        Cut(one, "actuators", f"{one}_disturbance", f"{one}_sum", one, alone=True)
        for one in COMMANDS
        if any(f"{one}_sum" in record for record in records)
    )
    said = tuple(dict.fromkeys(remarks))
    return FlownLoops(laws[0] if laws else None, tuple(flown), tuple(records), cuts, said)


def _cuts_none(sweep: FlownSweep) -> str:
    """Return why a sweep cuts no loop, empty if it does."""
    one = sweep.sid_axis
    if one.control == "col":
        return f"{one}: the collective is the pilot's there, no loop is closed through it"
    if not one.identifies:
        return f"{one}: loops of position and velocity are not measured"
    return f"{sweep}: {sweep.unused}" if sweep.unused else ""


def _law(rows: CutRows, sweep: FlownSweep) -> tuple[ArduCopterLaw | None, str]:
    """Return the law that flew a sweep about its steady flight, or why it isn't known."""
    try:
        parameters = rows.log.parameters(at=sweep.start)
        law = ArduCopterLaw.of(parameters, lean=rows.lean(sweep), steady=rows.held(sweep))
        return replace(law, period=rows.tick), ""
    except InputError as error:
        return None, str(error)
