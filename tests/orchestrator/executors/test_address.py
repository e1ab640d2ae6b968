"""Addresses of clusters: their forms, and what answers there."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from orchestrator.errors import UsageError
from orchestrator.executors import address as addresses
from orchestrator.executors.address import check_answer, host_and_port


@pytest.mark.parametrize(
    ("address", "parts"),
    [
        ("10.0.0.1:6379", ("10.0.0.1", 6379)),
        ("head:6379", ("head", 6379)),
        ("[::1]:6379", ("::1", 6379)),
        ("[fe80::1%eth0]:6379", ("fe80::1%eth0", 6379)),
    ],
)
def test_hosts_and_ports(address: str, parts: tuple[str, int]) -> None:
    assert host_and_port(address) == parts


@pytest.mark.parametrize(
    "address",
    [
        "127.0.0.1", "head", "head:", ":6379", "head:ray", "head:99999999", "ray://head:10001",
        "http://head:8265", "::1:6379", "[::1]", "[::1:6379", "head:6379/x", "",
    ],
)  # fmt: skip
def test_what_is_no_address(address: str) -> None:
    with pytest.raises(UsageError, match="HOST:PORT is expected"):
        host_and_port(address)


@contextmanager
def answering(answer: bytes, host: str = "127.0.0.1") -> Iterator[str]:
    """The address of somebody who says this to whoever calls."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as server:
        try:
            server.bind((host, 0))
        except OSError:
            pytest.skip(f"no {host} here")
        server.listen()

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(100)
                connection.sendall(answer)
                with suppress(ConnectionResetError):
                    connection.recv(100)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        port = server.getsockname()[1]
        yield f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        thread.join(10)


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_somebody_who_speaks_as_ray_does(host: str) -> None:
    with answering(bytes([0, 0, 6, 4, 0, 0, 0, 0, 0]), host) as address:
        check_answer(address)


@pytest.mark.parametrize("answer", [b"HTTP/1.0 505 ", b"SSH-2.0-x", b"", b"\0"])
def test_somebody_else(answer: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(addresses, "SECONDS_TO_ANSWER", 0.5)
    with answering(answer) as address, pytest.raises(OSError, match=r"no Ray|timed out"):
        check_answer(address)


def test_nobody() -> None:
    with pytest.raises(ConnectionRefusedError):
        check_answer("127.0.0.1:1")
