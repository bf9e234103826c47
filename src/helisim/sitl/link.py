"""The UDP link to the autopilot: a frame comes, its answer goes back to where it came from."""

import math
import select
import socket
import time

from helisim.base.errors import InputError
from helisim.sitl.packet import Frame, read_frame

PORT = 9002
"""Where ArduPilot's --model JSON sends to; of its instance I ten times I more."""
SILENT = 1.0
"""s without a frame after which another autopilot may take over: one that waits sends each s."""


class Link:
    """A bound port that hears one autopilot at a time; a context manager.

    Attributes:
        port: UDP.
        address: that it is bound to.
        peer: (address, port) of the autopilot; None as long as there is none.
        cut: how many of its packets were cut short on their way.
        strangers: how many packets came from others meanwhile.
    """

    def __init__(
        self, port: int = PORT, *, address: str = "127.0.0.1", timeout: float = 60.0
    ) -> None:
        """Bind the port.

        Args:
            port: UDP, 1 to 65535; 0 takes any that is free.
            address: of this machine; 0.0.0.0 hears other machines too.
            timeout: s, to wait for a frame; inf waits on.

        Raises:
            InputError: the port is taken, or there is no such port or address.
        """
        if not 0 <= port <= 65535:
            raise InputError(f"a UDP port is 1 to 65535, got {port}")
        bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            bound.bind((address, port))
        except OSError as error:
            bound.close()
            raise InputError(
                f"UDP port {port} of {address} can't be bound: {error.strerror or error}; another "
                "backend may run: end it, or take another port and give ArduPilot --sim-port-out"
            ) from None
        self._over(bound, timeout)

    @classmethod
    def over(cls, bound: socket.socket, *, timeout: float = 60.0) -> "Link":
        """Return a link over a UDP socket that is bound already, which it closes at its end."""
        link = cls.__new__(cls)
        link._over(bound, timeout)
        return link

    def _over(self, bound: socket.socket, timeout: float) -> None:
        if not timeout > 0.0:
            bound.close()
            raise InputError(f"timeout must be above 0 s, got {timeout:g}")
        bound.setblocking(False)
        self._socket = bound
        self.address, self.port = bound.getsockname()
        self.timeout = timeout
        self.peer: tuple[str, int] | None = None
        self.cut = self.strangers = 0
        self._heard = -math.inf

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def receive(self, timeout: float | None = None) -> Frame | None:
        """Return the autopilot's next frame; None if none came in time.

        Args:
            timeout: s; that of the link if None.

        Raises:
            InputError: before there is an autopilot, a packet of another protocol came.
        """
        end = time.monotonic() + (self.timeout if timeout is None else timeout)
        while (left := end - time.monotonic()) > 0.0:
            ready, _, _ = select.select([self._socket], [], [], min(left, _LONGEST))
            if ready and (frame := self.waiting()) is not None:
                return frame
        return None

    def waiting(self) -> Frame | None:
        """Return the next frame if one is here already, else None. Raises InputError."""
        while True:
            try:
                packet, peer = self._socket.recvfrom(1024)
            except BlockingIOError:
                return None
            except ConnectionResetError:  # Windows: an answer found no one
                continue
            frame = self._taken(packet, peer)
            if frame is not None:
                return frame

    def answer(self, line: bytes) -> None:
        """Send an answer to where the last frame came from."""
        if self.peer is not None:
            try:
                self._socket.sendto(line, self.peer)
            except OSError:  # it has gone, or its network: it will ask again
                return

    def _taken(self, packet: bytes, peer: tuple[str, int]) -> Frame | None:
        """Return the frame of a packet; None if it is cut, or not of the autopilot that flies."""
        now = time.monotonic()
        stranger = self.peer is not None and peer != self.peer
        if stranger and now - self._heard < SILENT:
            self.strangers += 1
            return None
        try:
            frame = read_frame(packet)
        except InputError:
            if self.peer is None:
                raise
            frame = None
        if frame is not None:
            self.peer, self._heard = peer, now
        elif stranger:
            self.strangers += 1
        else:
            self.cut += 1
        return frame


_LONGEST = 3600.0
"""s that the system is asked to wait at once."""
