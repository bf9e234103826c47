"""Reads the sweeps of an ArduPilot log as flight records, one each."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from helisim.base.unit_names import unit
from helisim.logs.assembly import from_source
from helisim.logs.dataflash.source import DataFlashLog, open_dataflash
from helisim.logs.log import Log
from helisim.logs.mapping import Column, Map
from helisim.logs.parts import Options
from helisim.logs.report import Findings
from helisim.logs.source import file_digest
from helisim.look.systemid.axes import SidAxis
from helisim.look.systemid.channels import INJECTED, TakenChannel
from helisim.look.systemid.sent import SentSource, tail_servo
from helisim.look.systemid.sweeps import FlownSweep
from helisim.records.channels import Channel
from helisim.records.record import FlightRecord

_INJECTED = "injected"
_REPAIRS = frozenset({"gaps", "duplicates"})
"""What a logger that is pressed does: it drops messages, and writes some twice."""


class Sampling(NamedTuple):
    """How the sweeps of logs become records.

    Attributes:
        rate: of the records, Hz.
        max_gap: the longest time without a message that is interpolated, s.
        repairs: besides those that a logger that drops messages needs.
        shortest: parts are left out that last less, s.
    """

    rate: float
    max_gap: float
    repairs: frozenset[str]
    shortest: float


def read_sweeps(
    path: Path,
    channels: Sequence[TakenChannel],
    sweeps: Sequence[FlownSweep],
    injected: Sequence[SidAxis],
    sampling: Sampling,
) -> tuple[Log, ...]:
    """Return what a log holds of each sweep, with a channel of each axis that was injected.

    Args:
        path: of the log.
        channels: to read.
        sweeps: of this log.
        injected: axes of all logs' sweeps; that of another sweep is zero.
        sampling: of the records.

    Raises:
        LogError: what is wrong with the log.
    """
    source, digest = opened_log(path)
    travel = tail_servo(source.log.parameters())
    if travel is not None:
        source = SentSource(source, travel)
    found = []
    for sweep in sweeps:
        columns = {one.name: one.column for one in channels}
        columns[_INJECTED] = Column(INJECTED, sweep.sid_axis.unit, meaning="injected")
        options = Options(
            sampling.rate,
            _REPAIRS | sampling.repairs,
            sampling.max_gap,
            sampling.shortest,
            (sweep.start, sweep.stop),
        )
        part = from_source(source, Map(columns), digest, options, {}, Findings())
        records = tuple(_named(one, sweep, injected) for one in part.records)
        found.append(replace(part, records=records))
    return tuple(found)


def opened_log(path: Path) -> tuple[DataFlashLog, str]:
    """Return a log, and its file's digest. Raises StorageError."""
    digest = file_digest(path)
    return open_dataflash(path, digest), digest


def _named(record: FlightRecord, sweep: FlownSweep, injected: Sequence[SidAxis]) -> FlightRecord:
    """Return a record with what was injected under its axis's name, and none on the others."""
    here = record.names.index(_INJECTED)
    added = np.zeros((len(record), len(injected)))
    for k, axis in enumerate(injected):
        if axis.number == sweep.axis:
            added[:, k] = record.values[:, here]
    keep = [k for k in range(len(record.names)) if k != here]
    channels = [record.channels[k] for k in keep]
    channels += [
        Channel(axis.name, unit(axis.unit).si, "OTHER", f"injected by SID_AXIS {axis.number}")
        for axis in injected
    ]
    return FlightRecord(
        record.time,
        np.column_stack([record.values[:, keep], added]),
        tuple(channels),
        {**record.provenance, "sweep": sweep.to_dict()},
    )
