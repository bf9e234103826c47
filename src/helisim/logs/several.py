"""Reads several logs, and says at once all that is wrong with them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from helisim.base.errors import HelisimError, InputError
from helisim.logs.log import Log
from helisim.logs.mapping import Clock, Column, Map
from helisim.logs.read import check_repairs, read_log
from helisim.logs.report import Findings
from helisim.logs.terms import REPAIRS

_NO_MOVE = 1e-12
"""Of a channel's largest value: it is constant if it varies by less, which is rounding."""


def read_logs(
    paths: Iterable[str | Path],
    *,
    channels: Map | Mapping[str, Column | str] | Sequence[str] | None = None,
    wanted: Sequence[str] = (),
    moving: bool = False,
    time: Clock | str | None = None,
    resample_hz: float | None = None,
    repair: Iterable[str] = (),
    max_gap: float | None = None,
    min_duration: float = 0.0,
    start: float | None = None,
    stop: float | None = None,
    use_ended: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> tuple[Log, ...]:
    """Read logs that are to be used together: uniform, with the channels that are wanted.

    Args:
        paths: the files.
        channels: as for `read_log`, and so are all options that aren't below.
        wanted: channels that every log must have.
        moving: whether each of these must move in one of the logs.
        time: see `read_log`.
        resample_hz: Hz.
        repair: see `REPAIRS`.
        max_gap: s.
        min_duration: s.
        start: s.
        stop: s.
        use_ended: take logs of simulated flights that were terminated early, too.
        on_progress: called with each file's name.

    Raises:
        LogError: all that is wrong with any of them; `findings` has it item by item.
        InputError: an option doesn't exist, and nothing else is wrong.
    """
    asked = (repair,) if isinstance(repair, str) else tuple(repair)
    known = [name for name in asked if name in REPAIRS]
    findings, unknown = Findings(), _unknown(asked)
    logs = []
    for path in map(Path, paths):
        try:
            log = read_log(
                path,
                channels=channels,
                time=time,
                resample_hz=resample_hz,
                repair=known,
                max_gap=max_gap,
                min_duration=min_duration,
                start=start,
                stop=stop,
            )
        except HelisimError as error:
            if isinstance(error, InputError) and not str(error).count(str(path)):
                raise  # an option, which is the same for all
            findings.refuse_error(path, error)
            continue
        _check_usable(log, wanted, use_ended, findings)
        log.refuse_uneven(findings)
        logs.append(log)
        if on_progress is not None:
            on_progress(path.name)
    if unknown is not None:
        if not findings.refused:
            raise unknown
        findings.refuse_error("", unknown)
    _check_moving(logs, wanted if moving else (), findings)
    findings.check()
    return tuple(logs)


def _unknown(repairs: Sequence[str]) -> InputError | None:
    """Return what is wrong with the names of repairs, or None."""
    try:
        check_repairs(repairs)
    except InputError as error:
        return error
    return None


def _check_usable(log: Log, wanted: Sequence[str], use_ended: bool, findings: Findings) -> None:
    """Refuse a log that lacks a channel, or whose flight was terminated early."""
    path, names = log.report.path, log.records[0].names
    for name in wanted:
        if name not in names:
            findings.refuse(
                "no such channel",
                f"{path}: has no channel {name!r}; available: {', '.join(names)}",
            )
    if log.records[0].ended and not use_ended:
        findings.refuse(
            "ended",
            f"{path}: of a flight that was terminated early, because {log.records[0].ended}; leave "
            "it out, or use it as it is, with use_ended=True (--use-ended)",
            option="--use-ended",
        )


def _check_moving(logs: Sequence[Log], channels: Sequence[str], findings: Findings) -> None:
    """Refuse channels that are constant in every log that has them."""
    for name in channels:
        have = [log for log in logs if name in log.records[0]]
        columns = [record[name] for log in have for record in log.records]
        if columns and all(np.ptp(one) <= _NO_MOVE * np.max(np.abs(one)) for one in columns):
            places = "; ".join(log.where(name) for log in have)
            findings.refuse(
                "constant",
                f"{places}: channel {name!r} is constant, so nothing can be identified from it; "
                "map it to another column, or leave it out",
            )
