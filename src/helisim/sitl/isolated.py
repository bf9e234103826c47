"""Run a program in a network namespace of its own; it needs nothing but the standard library.

Run as `python isolated.py HANDOVER PROGRAM ARGUMENT...`: HANDOVER is the descriptor of a connected
UNIX socket. Two UDP sockets are bound on the loopback and handed over there, with a line that says
which network they are in; then the program takes this process's place. "{0}" and "{1}" in its
arguments become their ports. A process of its own does this as only one with a single thread may
leave its network without being root, and as its threads' parent keeps the network it has.
"""

import ctypes
import fcntl
import os
import signal
import socket
import struct
import sys

_NEW_USER, _NEW_NETWORK = 0x10000000, 0x40000000
_FLAGS_OF, _SET_FLAGS, _UP = 0x8913, 0x8914, 0x1
_DIES_WITH_PARENT = 1


def leave_network() -> str:
    """Move this process to a network that has a loopback alone.

    Returns:
        "" if that was done, else why it can't be.
    """
    if not sys.platform.startswith("linux"):
        return f"{sys.platform} has no network namespaces"
    system = ctypes.CDLL(None, use_errno=True)
    user, group = os.getuid(), os.getgid()
    if system.unshare(_NEW_NETWORK) != 0:
        if system.unshare(_NEW_USER | _NEW_NETWORK) != 0:
            return f"network namespaces are not permitted: {os.strerror(ctypes.get_errno())}"
        for name, text in (
            ("setgroups", "deny"),
            ("uid_map", f"{user} {user} 1"),
            ("gid_map", f"{group} {group} 1"),
        ):
            with open(f"/proc/self/{name}", "w", encoding="ascii") as file:
                file.write(text)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        asked = struct.pack("16sh14x", b"lo", 0)
        (flags,) = struct.unpack("16xh14x", fcntl.ioctl(probe, _FLAGS_OF, asked))
        fcntl.ioctl(probe, _SET_FLAGS, struct.pack("16sh14x", b"lo", flags | _UP))
    return ""


def main() -> None:
    """Do what the arguments say."""
    handover, program, *arguments = sys.argv[1:]
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(_DIES_WITH_PARENT, signal.SIGKILL)
    try:
        shared = leave_network()
    except OSError as error:
        shared = f"a network namespace has no loopback: {error.strerror}"
    bound = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for one in bound:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in bound]
    with socket.socket(fileno=int(handover)) as parent:
        parent.set_inheritable(False)  # the program's start closes it
        line = (shared or "own").encode()
        socket.send_fds(parent, [line], [one.fileno() for one in bound])
        for one in bound:
            one.close()
        try:
            os.execv(program, [program, *(text.format(*ports) for text in arguments)])
        except OSError as error:
            parent.send(f"{program}: {error.strerror}".encode())
            sys.exit(1)


if __name__ == "__main__":
    main()
