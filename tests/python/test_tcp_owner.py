"""A TCP link has one owner, who knows the token: the first client keeps the brick, and a second client is told so."""

from __future__ import annotations

import json
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from brickpilot.errors import InputError
from brickpilot.hil.checkout import BRICK_PROGRAM
from brickpilot.hil.ends import end_brick, start_brick
from brickpilot.link.links import LinkGoneError, open_tcp
from brickpilot.link.session import REALTIME, Session
from command import brickpilot


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
    for _ in range(20):  # each client connects right after the last client has closed
        first.link.close()
        first = opened(address)
    first.link.close()


TOKEN_NAME, TOKEN = "BRICKPILOT_TOKEN", "correct horse battery"


@pytest.fixture
def guarded(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Starts a brick that other machines can reach, and yields its local address."""
    monkeypatch.setenv(TOKEN_NAME, TOKEN)
    process, address = start_brick("--listen 0.0.0.0:0")
    yield address.removeprefix("tcp:").replace("0.0.0.0", "127.0.0.1")
    end_brick(process)


def refused(options: str, environment: dict[str, str]) -> str:
    """Returns what the brick says when it refuses to start."""
    command = [BRICK_PROGRAM, *options.split()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False, env=environment)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    return done.stderr.strip()


def test_the_right_token_flies(guarded: str, tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('name = "s"\nkind = "mission"\nduration_s = 3\nwaypoints_m = [[0.3, 0]]\n')
    out = brickpilot("hil", "s.toml", "--link", f"tcp:{guarded}", "--out", "run", "--json", cwd=tmp_path)
    assert out.returncode == 0, out.stderr
    assert json.loads(out.stdout)["waypoints_reached"] == 1


def test_a_link_that_hil_starts_itself_has_the_token_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN_NAME, TOKEN)
    out = brickpilot("hil", "--link", "tcp", "--settings", "--json", cwd=tmp_path)
    assert json.loads(out.stdout)["cruise"] > 0


@pytest.mark.parametrize("token", [None, "another horse battery"])
def test_no_token_and_a_wrong_one_are_refused_with_a_line(
    guarded: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, token: str | None
) -> None:
    if token is None:
        monkeypatch.delenv(TOKEN_NAME)
    else:
        monkeypatch.setenv(TOKEN_NAME, token)
    out = brickpilot("hil", "--link", f"tcp:{guarded}", "--settings", cwd=tmp_path)
    assert out.returncode in (1, 2)
    assert out.stderr.count("\n") == 1
    assert ("the token is wrong" if token else "the brick asks for a token: set BRICKPILOT_TOKEN") in out.stderr
    monkeypatch.setenv(TOKEN_NAME, TOKEN)
    opened(guarded).link.close()


def test_a_brick_without_a_token_is_no_brick_of_ours(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN_NAME, TOKEN)
    connect = socket.create_connection
    monkeypatch.setattr(socket, "create_connection", lambda place, timeout: connect(place, timeout / 10))  # 0.5 s
    with pytest.raises(InputError, match="the brick asks for no token"):
        open_tcp("tcp", address)


def test_the_first_client_keeps_a_guarded_link_and_a_silent_one_does_not(guarded: str) -> None:
    host, _, port = guarded.rpartition(":")
    with socket.create_connection((host, int(port)), timeout=5.0) as silent:
        assert silent.recv(100).startswith(b"\0token ")
        with pytest.raises(InputError, match="another host has this link"):
            open_tcp("tcp", guarded)
        time.sleep(3.2)
        first = opened(guarded)
        assert silent.recv(100) == b""
    with pytest.raises(InputError, match="another host has this link"):
        open_tcp("tcp", guarded)
    assert first.read("cruise") > 0
    first.link.close()


def test_a_proof_is_good_once(guarded: str) -> None:
    host, _, port = guarded.rpartition(":")
    challenges = set()
    for _ in range(2):
        with socket.create_connection((host, int(port)), timeout=5.0) as client:
            challenges.add(client.recv(100))
            client.sendall(b"0" * 96)
            assert client.recv(100) == b"\0the token is wrong\0"
    assert len(challenges) == 2


def test_an_address_that_others_reach_needs_a_token_and_a_long_one() -> None:
    assert refused("--listen 0.0.0.0:0", {}) == "brick: 0.0.0.0:0: other machines reach it: set BRICKPILOT_TOKEN"
    short = refused("--listen 127.0.0.1:0", {TOKEN_NAME: "short"})
    assert short == "brick: 127.0.0.1:0: BRICKPILOT_TOKEN needs 16 to 64 bytes"
