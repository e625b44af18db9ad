"""TCP has one owner: the first client keeps the brick until it ends, and a second one is told so."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
from brickpilot.hil.brick_process import end_brick, start_brick
from brickpilot.link.links import LinkGoneError, open_tcp
from brickpilot.link.session import REALTIME, Session


@pytest.fixture
def address() -> Iterator[str]:
    process, address = start_brick("--listen 127.0.0.1:0")
    yield address.removeprefix("tcp:")
    end_brick(process)


def opened(address: str) -> Session:
    session = Session(open_tcp("tcp", address), "tcp")
    session.open("coupled", REALTIME)
    return session


def test_a_silent_second_client_takes_nothing_from_the_first(address: str) -> None:
    first = opened(address)
    host, _, port = address.rpartition(":")
    with socket.create_connection((host, int(port)), timeout=5.0) as second:
        assert second.recv(100) == b"\0another host has this link\0"
        assert second.recv(100) == b""
        for _ in range(20):
            assert first.read("cruise") > 0
    first.link.close()


def test_a_second_host_gets_a_line_and_the_next_one_the_brick(address: str) -> None:
    first = opened(address)
    second = open_tcp("tcp", address)
    with pytest.raises(LinkGoneError, match="another host has this link"):
        second.receive(5.0)
    second.close()
    assert first.read("cruise") > 0
    for _ in range(20):  # one that comes right after the end of the one before
        first.link.close()
        first = opened(address)
    first.link.close()
