"""What `helisim sitl` does while an autopilot flies: it says where, shows, keeps, and sums up."""

import argparse
import math
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from helisim.base.errors import DivergedError, InputError
from helisim.cli.common import print_written, write_recording

if TYPE_CHECKING:
    from helisim.show.viewer import Watched
    from helisim.sitl import Aircraft, Frame, Link, Sensed

_EACH = 10.0
"""s of the clock between two lines that say where it is."""


def add_kept(command: argparse.ArgumentParser) -> None:
    """Add the options that say what is kept and shown."""
    command.add_argument(
        "--record",
        type=Path,
        metavar="FILE",
        help="write what truly happened, .parquet or .csv; further starts of the autopilot get "
        "a number",
    )
    command.add_argument(
        "--rerun", type=Path, metavar="FILE", help="write a Rerun recording too, .rrd"
    )
    command.add_argument(
        "--view", action="store_true", help="show it in MuJoCo's viewer while it flies"
    )


def check(options: argparse.Namespace) -> None:
    """Refuse what can't be written or shown, before any time is spent."""
    from helisim.base.files import check_destination
    from helisim.show.viewer import check_display

    if not options.wait > 0.0:
        raise InputError(f"--wait must be above 0 s, got {options.wait:g}")
    if options.record is not None:
        check_destination(options.record)
    if options.rerun is not None:
        check_destination(options.rerun, (".rrd",))
    if options.view:
        check_display()


def is_kept(options: argparse.Namespace) -> bool:
    """Return whether the flight is to be kept."""
    return options.record is not None or options.rerun is not None


def serve(
    options: argparse.Namespace, aircraft: "Aircraft", link: "Link", also: Sequence[str] = ()
) -> int:
    """Let an autopilot fly an aircraft until it is over; return the exit status.

    Args:
        options: of the command.
        aircraft: that is flown.
        link: to the autopilot.
        also: further fields of the answers.
    """
    from helisim.sitl.link import Backend

    if not options.quiet:
        _say(_listening(options, link))
    kept = Kept(options, aircraft)
    status = None if options.quiet else _Status(aircraft)
    with ExitStack() as stack:
        stack.enter_context(aircraft)
        watched = stack.enter_context(window(aircraft)) if options.view else None

        def on_frame(frame: "Frame", sensed: "Sensed") -> bool:
            if status is not None:
                status(frame, sensed)
            return watched is not None and watched.on_frame(frame, sensed)

        backend = Backend(
            aircraft,
            link,
            on_frame=on_frame if status or watched else None,
            on_wait=watched.on_wait if watched else None,
            on_restart=kept.write,
            also=also,
        )
        try:
            with _ended_as_by_hand():
                backend.run()
        except KeyboardInterrupt:
            if not backend.served.frames:
                raise
        except DivergedError:
            kept.write()
            raise
    if backend.served.frames:
        kept.write()
    _say(f"Flown: {backend.served}")
    return 0


@contextmanager
def _ended_as_by_hand() -> Iterator[None]:
    """Let a polite end by another program be one by Ctrl-C, so that what was flown is kept."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _listening(options: argparse.Namespace, link: "Link") -> str:
    out = "" if link.port == 9002 else f" --sim-port-out {link.port}"
    host = "127.0.0.1" if link.address in ("127.0.0.1", "0.0.0.0") else link.address
    name = Path(options.vehicle).name
    return (
        f"{name} stands on the ground, rotor stopped. Listening on UDP {link.address}:"
        f"{link.port}{_how_long(options.wait)}; start ArduPilot with\n"
        f"  helisim parm {options.vehicle} --out {name}.parm\n"
        f"  arducopter-heli --model JSON:{host}{out} --defaults {name}.parm\n"
        "and a ground station on its TCP port 5760, for which it waits. Ctrl-C ends."
    )


def _how_long(wait: float) -> str:
    return f", for {wait:g} s" if math.isfinite(wait) else ""


class _Status:
    """Says where the helicopter is, now and then, and that it has crashed."""

    def __init__(self, aircraft: "Aircraft") -> None:
        self._aircraft, self._crashed = aircraft, ""
        self._next = self._clock = time.monotonic()
        self._time = 0.0

    def __call__(self, frame: "Frame", sensed: "Sensed") -> None:
        crashed = self._aircraft.crashed
        if crashed != self._crashed:
            self._crashed = crashed
            if crashed:
                _say(f"{sensed.time:7.1f} s  crashed: {crashed}; start ArduPilot anew to fly on")
        now = time.monotonic()
        if now >= self._next:
            factor = (sensed.time - self._time) / max(now - self._clock, 1e-3)
            north, east, down = sensed.position
            pulses = " ".join(map(str, frame.pulses[:8]))
            _say(
                f"{sensed.time:7.1f} s  north {north:z.2f}, east {east:z.2f}, "
                f"height {-down:z.2f} m  x{max(factor, 0.0):.1f}  pulses {pulses}"
            )
            self._next, self._clock, self._time = now + _EACH, now, sensed.time


class Kept:
    """Writes what was flown since the autopilot started, each time to a file of its own."""

    def __init__(self, options: argparse.Namespace, aircraft: "Aircraft") -> None:
        self._options, self._aircraft, self._number = options, aircraft, 0

    def write(self) -> None:
        """Write the record and the recording that are asked for."""
        from helisim.records.storage import write_record

        options = self._options
        if not is_kept(options):
            return
        self._number += 1
        try:
            record = self._aircraft.record()
        except InputError as error:
            _say(f"Not written: {error}")
            return
        if options.record is not None:
            path = self._numbered(options.record)
            write_record(record, path)
            print_written(
                options, f"{path} ({record.duration:.2f} s, {len(record.names)} channels)"
            )
        if options.rerun is not None:
            path, folder = self._numbered(options.rerun), self._aircraft.vehicle.folder
            write_recording(path, {path.stem: record}, vehicle=folder, quiet=options.quiet)

    def _numbered(self, path: Path) -> Path:
        return path if self._number == 1 else path.with_stem(f"{path.stem}_{self._number}")


@contextmanager
def window(aircraft: "Aircraft") -> "Iterator[Watched]":
    """Show an aircraft in MuJoCo's viewer as long as the block lasts."""
    from helisim.show.viewer import Watched, seen, shown

    flight = seen(aircraft)
    with shown(flight) as window:
        yield Watched(aircraft, flight, window)


def _say(text: str) -> None:
    """Print at once: another program waits for what is said here."""
    print(text, flush=True)
