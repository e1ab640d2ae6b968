"""A cluster's address: is it one, and does a Ray answer there? Ray itself tries for minutes."""

from __future__ import annotations

import os
import socket
from urllib.parse import urlsplit

from orchestrator.errors import UsageError

SECONDS_TO_ANSWER = 5.0
# Ray's head speaks HTTP/2, where both sides begin with a frame of settings: length, type 4, flags.
HELLO = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
SETTINGS = 4


def host_and_port(address: str) -> tuple[str, int]:
    """Its parts. Raises UsageError for what is no address of a head."""
    try:
        parts = urlsplit(f"//{address}")
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if host is None or port is None or parts.netloc != address:
        raise UsageError(
            f"--address {address}: HOST:PORT is expected, as in 10.0.0.1:6379 or [::1]:6379, the "
            "port being that of `ray start --head --port`"
        )
    return host, port


def check_answer(address: str) -> None:
    """Find out in seconds whether something like a Ray answers there; OSError says why not."""
    with socket.create_connection(host_and_port(address), SECONDS_TO_ANSWER) as connection:
        if os.environ.get("RAY_USE_TLS", "0") != "0":
            return  # it answers nothing but a handshake
        connection.settimeout(SECONDS_TO_ANSWER)
        connection.sendall(HELLO)
        answer = connection.recv(4)
    if answer[3:] != bytes([SETTINGS]):
        raise ConnectionError("what answers there is no Ray")
