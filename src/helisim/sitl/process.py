"""ArduPilot's simulator as a process: started in an empty folder and a network of its own."""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from helisim.base.errors import AutopilotError, InputError
from helisim.base.files import atomic_write
from helisim.sitl import isolated

PROGRAM = "HELISIM_ARDUPILOT"
"""Environment variable that names the simulator's program."""
_START_TIME = 1_700_000_000
"""Of its clock, s since 1970: each flight is of the same day."""
_LAST_LINES = 5
"""Of what the program printed, told when it has ended."""
_OTHER_PORTS = (1, 2, 5, 6, 7, 8)
"""Serial ports that would listen on all addresses."""


def find_program(path: str | os.PathLike[str] | None = None) -> Path:
    """Return the program of ArduPilot's simulator.

    Args:
        path: of it; what `HELISIM_ARDUPILOT` names if None.

    Raises:
        InputError: none is named, or there is no program.
    """
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


class Autopilot:
    """A running simulator of ArduPilot; a context manager that ends it and removes its folder.

    It waits for the answer to its first frame. The same parameters and the same answers give the
    same frames in each run: its clock begins at the same date, its memory is empty.

    Attributes:
        folder: in which it runs and writes.
        frames: UDP socket to which it sends its frames.
        telemetry: UDP socket to which it sends MAVLink.
        shared: why it has no network of its own, "" if it has: its other ports are then open.
    """

    def __init__(
        self,
        program: Path,
        parameters: str,
        *,
        speed: float = 1000.0,
        more: Sequence[str] = (),
    ) -> None:
        """Start the program.

        Args:
            program: ArduPilot's arducopter-heli.
            parameters: text of its parameter file.
            speed: times real time that it does not exceed.
            more: arguments of the program, to these.

        Raises:
            InputError: the program can't be run.
        """
        if not hasattr(socket, "send_fds"):
            raise InputError(f"ArduPilot can't be started on {sys.platform}: use Linux or WSL")
        self.folder = Path(tempfile.mkdtemp(prefix="helisim-ardupilot-"))
        (self.folder / "start.parm").write_text(parameters, encoding="ascii")
        options = {
            "model": "JSON:127.0.0.1",
            "defaults": "start.parm",
            "speedup": f"{speed:g}",
            "start-time": f"{_START_TIME}",
            "sim-port-out": "{0}",
            "serial0": "udpclient:127.0.0.1:{1}",
            **{f"serial{k}": "none:" for k in _OTHER_PORTS},
        }
        given = (word for name, value in options.items() for word in (f"--{name}", value))
        arguments = ["-w", *given, *more]
        try:
            self._start(program, arguments)
        except BaseException:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def _start(self, program: Path, arguments: list[str]) -> None:
        ours, theirs = socket.socketpair()
        with ours, theirs, (self.folder / "printed.txt").open("wb") as printed:
            self._process = subprocess.Popen(
                [
                    sys.executable,
                    "-I",
                    isolated.__file__,
                    f"{theirs.fileno()}",
                    program,
                    *arguments,
                ],
                cwd=self.folder,
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=printed,
                stderr=subprocess.STDOUT,
            )
            theirs.close()
            line, handed, *_ = socket.recv_fds(ours, 4096, 2)
            refused = ours.recv(4096) if len(handed) == 2 else b"it ended at once"
        sockets = [socket.socket(fileno=one) for one in handed]
        if refused:
            for one in sockets:
                one.close()
            self._process.wait()
            said = refused.decode(errors="replace")
            raise InputError(f"ArduPilot can't be started: {said}{self._last_words()}")
        self.shared = "" if line == b"own" else line.decode()
        self.frames, self.telemetry = sockets
        self.telemetry.setblocking(False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()
        shutil.rmtree(self.folder, ignore_errors=True)

    def end(self) -> None:
        """End the process; it hears no milder signal while it waits for an answer."""
        self._process.kill()
        self._process.wait()
        self.frames.close()
        self.telemetry.close()

    def check(self) -> None:
        """Raise AutopilotError if the process has ended by itself."""
        code = self._process.poll()
        if code is not None:
            how = f"with status {code}" if code >= 0 else f"by signal {-code}"
            raise AutopilotError(f"ArduPilot ended {how}{self._last_words()}")

    @property
    def log(self) -> Path | None:
        """The last DataFlash log that it began."""
        logs = sorted((self.folder / "logs").glob("*.BIN"))
        return logs[-1] if logs else None

    def keep_log(self, path: str | os.PathLike[str]) -> None:
        """Copy the last log to a path, whole or not at all.

        Raises:
            AutopilotError: there is none.
            StorageError: it can't be written there.
        """
        log = self.log
        if log is None:
            raise AutopilotError(
                "ArduPilot wrote no log: it does once it is armed, if LOG_BACKEND_TYPE is 1"
            )
        with atomic_write(path) as temporary:
            shutil.copyfile(log, temporary)

    def _last_words(self) -> str:
        printed = (self.folder / "printed.txt").read_text(encoding="utf-8", errors="replace")
        said = [line for line in printed.splitlines() if line.strip()]
        lines = list(dict.fromkeys(reversed(said)))[_LAST_LINES - 1 :: -1]  # each once, the last
        return "; its last words: " + " | ".join(lines) if lines else ""
