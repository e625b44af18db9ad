"""A brick that begins anew in the middle of a flight: the session notices, ends the flight and says so."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from brickpilot.cli import main
from brickpilot.hil import ends, fly
from brickpilot.link.links import Link, Message, WrappedLink
from brickpilot.link.messages import book
from brickpilot.link.session import LOCKSTEP, REALTIME, ResetWatch
from test_hil import plan

REPLAYED_AT = 400
FLOWN = 'name = "s"\nkind = "mission"\nduration_s = 6\nwaypoints_m = [[0.3, 0.1]]\n'


class Replaying(WrappedLink):
    """A link that sends chosen earlier messages of the host again, before the messages of step REPLAYED_AT."""

    def __init__(self, link: Link, names: Sequence[str]) -> None:
        super().__init__(link)
        by = book().by_name
        self._sync = by["SYNC"].id
        self._kept = {by[name].id for name in names}
        self._heard: list[Message] = []
        self._sets = 0

    def send(self, messages: Sequence[Message]) -> None:
        self._sets += any(identifier == self._sync for identifier, _ in messages)
        if self._sets < REPLAYED_AT:
            self._heard += [message for message in messages if message[0] in self._kept]
        elif self._heard:
            self._link.send(self._heard)
            self._heard = []
        super().send(messages)


OPEN_ALONE = ("OPEN",)
A_WHOLE_SESSION = ("OPEN", "PARAMETER_REQUEST", "WAYPOINT_REQUEST", "ROUTE_REQUEST", "MODE_COMMAND")


@pytest.mark.parametrize("pace", [LOCKSTEP, pytest.param(REALTIME, marks=pytest.mark.realtime)])
@pytest.mark.parametrize("replayed", [OPEN_ALONE, A_WHOLE_SESSION], ids=["OPEN", "session"])
def test_replayed_bytes_end_the_flight_and_it_says_why(replayed: Sequence[str], pace: str) -> None:
    wanted = plan(duration=6.0)

    def once() -> fly.HilFlight:
        with ends.both_ends("serial:pty") as both:
            link = Replaying(both.link, replayed)
            pair = dataclasses.replace(both, link=link)
            return fly.fly(pair, "x", wanted, pace=pace, telemetry_every=5, progress=lambda *_: None)

    for _ in range(6):  # in real time the machine itself can stall for 20 ms, which ends the run too early
        flown = once()
        if flown.flight.motors[REPLAYED_AT - 20 : REPLAYED_AT - 5].any():
            break
    assert flown.broke_off is not None
    assert flown.broke_off.startswith("the brick was reset: ")
    assert flown.safe_stops >= 1
    steps = len(flown.flight.motors)
    assert REPLAYED_AT - 2 < steps - fly.GIVE_UP_STEPS < REPLAYED_AT + 20
    assert flown.flight.motors[REPLAYED_AT - 20 : REPLAYED_AT - 5].any()
    assert not flown.flight.motors[-fly.GIVE_UP_STEPS :].any()
    assert abs(flown.flight.log["true_speed_m_s"][-1]) < 0.01


def test_the_command_gives_status_1_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "s.toml").write_text(FLOWN, encoding="utf-8")
    real = ends.both_ends

    @contextmanager
    def replaying(spec: str, image: Path | None = None) -> Iterator[ends.Ends]:
        with real(spec, image=image) as both:
            yield dataclasses.replace(both, link=Replaying(both.link, A_WHOLE_SESSION))

    monkeypatch.setattr(ends, "both_ends", replaying)
    with pytest.raises(SystemExit) as ended:
        main.main(["hil", str(tmp_path / "s.toml"), "--link", "tcp", "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert (ended.value.code, said.count("\n")) == (1, 1)
    assert "the brick was reset: it restarted, or took an OPEN that this session has not sent" in said
    assert "The brick was reset" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def hello() -> Message:
    layout = book().by_name["HELLO"]
    return layout.id, layout.seal(7, book().protocol, book().crc, 0, 0)


def heartbeat(tick: int) -> Message:
    layout = book().by_name["HEARTBEAT"]
    return layout.id, layout.pack(tick, 0, 1, 0, 0)


def watched(*messages: Message, repeats: int = 0) -> bool:
    watch = ResetWatch()
    watch.opened(repeats)
    watch.begin()
    for message in messages:
        watch.take(*message)
    return watch.reset


def test_a_hello_that_nobody_asked_for_shows_a_reset() -> None:
    assert watched(hello())
    assert not watched(hello(), repeats=1), "the late reply to an OPEN that was sent twice"
    assert watched(hello(), hello(), repeats=1)
    identifier, data = hello()
    assert not watched((identifier, data[:5] + b"\xff" + data[6:])), "a damaged one"


def test_a_tick_that_goes_back_shows_a_reset_and_a_damaged_one_does_not() -> None:
    assert not watched(*map(heartbeat, (0, 100, 200, 300)))
    assert not watched(*map(heartbeat, (0, 100, 100, 400))), "one came twice, two were lost"
    assert watched(*map(heartbeat, (0, 100, 200, 0)))
    assert watched(*map(heartbeat, (500, 100)))
    for bit in range(32):
        assert not watched(heartbeat(700), heartbeat(800 ^ 1 << bit), heartbeat(900)), bit


def test_nothing_counts_before_the_flight() -> None:
    watch = ResetWatch()
    watch.take(*heartbeat(700))
    watch.take(*hello())
    watch.opened(0)
    watch.take(*hello())
    watch.begin()
    watch.take(*heartbeat(0))
    assert not watch.reset
