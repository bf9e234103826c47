"""The UDP link to the autopilot: a frame comes, its answer goes back to where it came from."""

import socket

from helisim.errors import InputError
from helisim.sitl.packet import Frame, read_frame

PORT = 9002
"""Where ArduPilot's --model JSON sends to."""


class Link:
    """A bound port; a context manager."""

    def __init__(self, port: int = PORT, *, timeout: float = 60.0) -> None:
        """Bind the port.

        Args:
            port: UDP, on the loopback.
            timeout: s, to wait for a frame.

        Raises:
            InputError: the port is taken.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", port))
        except OSError as error:
            self._socket.close()
            raise InputError(f"UDP port {port} can't be bound: {error.strerror}") from None
        self._socket.settimeout(timeout)
        self._peer: tuple[str, int] | None = None

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def receive(self) -> Frame | None:
        """Return the next frame; None if none came in time. Raises InputError."""
        try:
            packet, self._peer = self._socket.recvfrom(1024)
        except TimeoutError:
            return None
        return read_frame(packet)

    def answer(self, line: bytes) -> None:
        """Send an answer to where the last frame came from."""
        if self._peer is not None:
            self._socket.sendto(line, self._peer)
