"""Faults of messages, sensors and link ends act as named: a part of tests/loop/fault_matrix.py, and the seeds."""

from __future__ import annotations

from pathlib import Path

import fault_matrix
import pytest
from brickpilot.cli import main
from brickpilot.errors import InputError
from brickpilot.hil.plant_end import FLOOD, HELD_FOR, FaultyLink
from brickpilot.link.links import Message
from brickpilot.vehicle import scenario
from brickpilot.vehicle.scenario import MESSAGE_KINDS, Fault

MISSION = 'name = "s"\nkind = "mission"\nduration_s = 3\nwaypoints_m = [[0.3, 0]]\n'


class Loop:
    """A link that returns the messages that were sent to it."""

    damaged = 0

    def __init__(self) -> None:
        self.messages: list[Message] = []

    def send(self, messages: list[Message]) -> None:
        self.messages += messages

    def receive(self, timeout: float) -> list[Message]:
        taken, self.messages = self.messages, []
        return taken

    def close(self) -> None: ...


def through(kind: str, count: int = 40, rate: float = 1.0, seed: int = 0) -> list[Message]:
    link = FaultyLink(Loop(), [Fault(kind, 0.0, 1.0, rate, "to_brick")], seed)
    for number in range(count):
        link.send([(number, bytes([number] * 8))])
    return link.receive(0.0)


@pytest.mark.realtime  # a reply has 30 ms to arrive
@pytest.mark.parametrize("transport", fault_matrix.TRANSPORTS)
@pytest.mark.parametrize("kind", fault_matrix.KINDS)
def test_no_fault_reaches_the_motors_over_any_transport(kind: str, transport: str) -> None:
    assert fault_matrix.run(kind, 0, transport).trouble == ""


def test_every_kind_of_fault_does_what_its_name_says() -> None:
    sent = [(number, bytes([number] * 8)) for number in range(40)]
    assert through("drop") == through("disconnect") == []
    assert through("duplicate") == [message for message in sent for _ in range(2)]
    assert through("delay")[0] == sent[0]
    assert len(through("delay")) == 40 - HELD_FOR + 1
    late = through("reorder", rate=0.5)
    assert late != sent
    assert set(late) <= set(sent)
    assert all(len(data) < 8 for _, data in through("truncate"))
    for before, after in zip(sent, through("corrupt"), strict=True):
        bits = int.from_bytes(before[1], "little") ^ int.from_bytes(after[1], "little")
        assert bits.bit_count() + (before[0] ^ after[0]).bit_count() == 1
    assert len(through("flood", 2)) == 2 * (FLOOD + 1)
    assert through("flood", 2)[FLOOD] == sent[0]


@pytest.mark.parametrize("kind", MESSAGE_KINDS)
def test_the_same_seed_gives_the_same_faults(kind: str) -> None:
    assert through(kind, 200, 0.5, 7) == through(kind, 200, 0.5, 7)
    if kind != "delay":
        assert through(kind, 200, 0.5, 7) != through(kind, 200, 0.5, 8)


def test_a_fault_acts_in_its_time_and_direction() -> None:
    link = FaultyLink(Loop(), [Fault("drop", 0.3, 0.6, 1.0, "from_brick")], 0)
    received = []
    for step in range(300):
        link.step = step
        link.send([(step, b"")])
        received += [identifier for identifier, _ in link.receive(0.0)]
    assert received == [*range(100), *range(200, 300)]


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ('[[faults]]\nkind = "gremlin"\nfrom_s = 1', "faults.0.kind"),
        ('[[faults]]\nkind = "drop"', "faults.0.from_s"),
        ('[[faults]]\nkind = "drop"\nfrom_s = 4', "faults.0.from_s"),
        ('[[faults]]\nkind = "drop"\nfrom_s = 2\nto_s = 1', "faults.0.to_s"),
        ('[[faults]]\nkind = "drop"\nfrom_s = 1\nrate = 2', "faults.0.rate"),
        ('[[faults]]\nkind = "drop"\nfrom_s = 1\nsensor = "imu"', "faults.0.sensor"),
        ('[[faults]]\nkind = "stuck_sensor"\nfrom_s = 1', "faults.0.sensor"),
        ('[[faults]]\nkind = "plant_restart"\nfrom_s = 1\nrate = 0.5', "faults.0.rate"),
        ("faults = 3", "faults"),
    ],
)
def test_a_bad_fault_is_refused_with_its_place(text: str, field: str, tmp_path: Path) -> None:
    file = tmp_path / "s.toml"
    file.write_text((text + "\n" + MISSION) if text.startswith("faults") else MISSION + text, encoding="utf-8")
    with pytest.raises(InputError, match=r"s\.toml:\d+:") as refused:
        scenario.load(file)
    assert field.replace(".0", "[0]") in str(refused.value) or field in str(refused.value)


def test_run_refuses_a_scenario_with_faults(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "s.toml"
    file.write_text(MISSION + '[[faults]]\nkind = "drop"\nfrom_s = 1\n', encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main.main(["run", str(file), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert "brickpilot hil" in capsys.readouterr().err
