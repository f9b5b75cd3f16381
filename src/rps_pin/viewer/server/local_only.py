"""Who may ask a server of this machine: pages of its own, by the names of this machine.

Another site can make its own name lead to 127.0.0.1 (DNS rebinding), and any page can open a
WebSocket to another server, but no page can change what the browser sends as Host and Origin.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Sequence

from rps_pin.errors import InputError, shown

HOST = "127.0.0.1"
"""The address that servers of this package listen on."""
REFUSAL = "This viewer answers to this machine only."
"""What others are told, with status 403."""


def local_hosts(port: int) -> frozenset[str]:
    """Return the values of Host that lead here: the names of this machine, with the port."""
    names = (HOST, "localhost")
    # A browser leaves the port out of Host where it is HTTP's own.
    return frozenset(f"{name}:{port}" for name in names) | frozenset(names if port == 80 else ())


def checked_port(port: int) -> int:
    """Return a port that there is, 1 to 65535; raise an `InputError` for others."""
    whole = isinstance(port, int) and not isinstance(port, bool)
    if not (whole and 1 <= port <= 65535):
        raise InputError(f"port = {shown(port)}: it must be between 1 and 65535")
    return port


def listener(port: int | None) -> socket.socket:
    """Return a socket that listens on a port of this machine; default: a free one.

    Raises
    ------
    InputError
        If there is no such port, or it cannot be used.
    """
    try:
        return socket.create_server((HOST, 0 if port is None else checked_port(port)))
    except OSError as error:
        raise InputError(
            f"port {port} of {HOST} cannot be used ({os.strerror(error.errno or 0)}): "
            "choose another, or none for a free one"
        ) from error


def is_foreign(hosts: Sequence[str], origins: Sequence[str], permitted: frozenset[str]) -> bool:
    """Return whether a request is not from a page of this server.

    Parameters
    ----------
    hosts, origins
        All values of Host and of Origin in the request. Programs that are no browsers send no
        Origin; there must be one Host.
    permitted
        As of `local_hosts`.
    """
    if len(hosts) != 1 or hosts[0] not in permitted or len(origins) > 1:
        return True
    return any(origin not in {f"http://{host}" for host in permitted} for origin in origins)
