"""ArduPilot's simulator as a process: started in an empty folder, on ports of its own."""

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from helisim.base.errors import AutopilotError, InputError
from helisim.base.files import atomic_write

PROGRAM = "HELISIM_ARDUPILOT"  # Environment variable that names the simulator's program
# _START_TIME: s since 1970, of its clock
# _LAST_LINES: Printed lines in the message of an ended program
_START_TIME, _LAST_LINES = 1_700_000_000, 5
_OTHER_PORTS = (1, 2, 5, 6, 7, 8)  # Serial ports that would listen on all addresses


def find_program(path: str | os.PathLike[str] | None = None) -> Path:
    """Return ArduPilot's simulator, by default from `HELISIM_ARDUPILOT`. Raises InputError."""
    named = path or os.environ.get(PROGRAM)
    if not named:
        raise InputError(
            f"no ArduCopter-heli to fly: set {PROGRAM} to the program arducopter-heli that "
            "ArduPilot's `waf heli` builds for its board sitl, or name the program",
            remedy="ardupilot",
        )
    found = Path(named).absolute()
    if not (found.is_file() and os.access(found, os.X_OK)):
        raise InputError(f"{named} is not a program; expected ArduPilot's arducopter-heli")
    return found


def _bound() -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", 0))
    return one


class Autopilot:
    """A running simulator of ArduPilot; a context manager that ends it and removes its folder.

    The same parameters and answers give the same frames. `telemetry` is its UDP socket of MAVLink.
    """

    def __init__(
        self,
        program: Path,
        parameters: str,
        port: int = 0,
        *,
        speed: float = 1000.0,
        more: Sequence[str] = (),
    ) -> None:
        """Start `program` with a parameter file's text, at most `speed` times real time."""
        self.folder = Path(tempfile.mkdtemp(prefix="helisim-ardupilot-"))
        (self.folder / "start.parm").write_text(parameters, encoding="utf-8")
        self.telemetry = _bound()
        self.telemetry.setblocking(False)
        with _bound() as frames, _bound() as radio:  # free ports
            listens = [one.getsockname()[1] for one in (frames, radio)]
        options = {
            "model": "JSON:127.0.0.1",
            "defaults": "start.parm",
            "speedup": f"{speed:g}",
            "start-time": f"{_START_TIME}",
            "sim-port-out": f"{port}",
            "sim-port-in": f"{listens[0]}",
            "rc-in-port": f"{listens[1]}",
            "serial0": f"udpclient:127.0.0.1:{self.telemetry.getsockname()[1]}",
            **{f"serial{k}": "none:" for k in _OTHER_PORTS},
        }
        given = [word for name, value in options.items() for word in (f"--{name}", value)]
        try:
            with (self.folder / "printed.txt").open("wb") as printed:
                self._process = subprocess.Popen(
                    [program, "-w", *given, *more],
                    cwd=self.folder,
                    stdin=subprocess.DEVNULL,
                    stdout=printed,
                    stderr=subprocess.STDOUT,
                )
        except OSError as error:
            self.telemetry.close()
            shutil.rmtree(self.folder, ignore_errors=True)
            raise InputError(f"{program} can't be started: {error.strerror}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()  # it hears no milder signal while it waits
        self._process.wait()
        self.telemetry.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def check(self, said: Sequence[str] = ()) -> None:
        """Raise AutopilotError if the process has ended by itself, with the last text it `said`."""
        code = self._process.poll()
        if code is not None:
            how = f"with status {code}" if code >= 0 else f"by signal {-code}"
            printed = (self.folder / "printed.txt").read_text(encoding="utf-8", errors="replace")
            lines = [line for line in printed.splitlines() if line.strip()]
            # its start prints some lines again and again: what is after them is of its end
            again = [k for k, line in enumerate(lines) if line in lines[:k]]
            words = [*said[-1:], *lines[max(again, default=-1) + 1 :][-_LAST_LINES:]]
            raise AutopilotError(
                f"ArduPilot ended {how}; its last words: {' | '.join(words) or 'none'}"
            )

    @property
    def log(self) -> Path | None:
        """The last DataFlash log that it began."""
        return max((self.folder / "logs").glob("*.BIN"), default=None)

    def keep_log(self, path: str | os.PathLike[str]) -> None:
        """Copy the last log to a path, whole or not at all. Raises AutopilotError, StorageError."""
        if self.log is None:
            raise AutopilotError(
                "ArduPilot wrote no log: it does once it is armed, if LOG_BACKEND_TYPE is 1"
            )
        with atomic_write(path) as temporary:
            shutil.copyfile(self.log, temporary)
