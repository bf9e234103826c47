"""Likely causes of a fit that fails, as the data and the logs show them."""

import argparse
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from helisim.base.errors import HelisimError
from helisim.cli.common import names, worded_note, wrapped
from helisim.cli.logs import given_columns

if TYPE_CHECKING:
    from helisim.ident import Fit
    from helisim.logs import Log

_IMPLAUSIBLE = ("unit", "sign", "axes", "scale", "unit of time")


def print_suspicions(options: argparse.Namespace, fit: "Fit", logs: "Sequence[Log]") -> None:
    """Print what may be wrong where a fit isn't acceptable: by the data, and by the logs."""
    if fit.acceptable and not fit.dropped:
        return
    from helisim.ident.fitting.suspicion import suspicions

    known = set(fit.remarks)
    lines = [one.text for one in suspicions(fit) if one.text not in known]
    lines += [line for line in dict.fromkeys(_of_logs(options, logs)) if line not in lines]
    if lines:
        print("likely causes, by what the data show:")
        print(wrapped("\n".join(f"  {line}" for line in lines), indent=4))


def _of_logs(options: argparse.Namespace, logs: "Sequence[Log]") -> Iterator[str]:
    """Yield what is implausible in the logs, also by channels that weren't asked for."""
    if not logs:
        return
    from helisim.look import look

    channels, time = given_columns(options)
    try:
        found = look(
            options.logs,
            channels=channels,
            time=time,
            repair=[name for item in options.repair for name in names(item)],
            max_gap=options.max_gap,
            start=options.from_time,
            stop=options.to_time,
        )
    except HelisimError:
        return
    for log in found.logs:
        for finding in log.findings:
            if finding.kind in _IMPLAUSIBLE:
                yield f"{log.path}: {worded_note(finding)}"
