"""Sound recordings of an RCX are imported, and damaged ones refused. tests/gates/test_rcx.py uses a simulated brick."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from brickpilot.errors import InputError
from brickpilot.importers import rcx
from brickpilot.link import lnp

PORT = Path("/dev/tower")
AXES = struct.pack("<HHB", 512, 20 * 256 + 115, 0) + 2 * struct.pack("<HHB", 500, 38 * 256 + 82, 1)
MANOEUVRES = ((16384, -16384, 30),)


def block_0(samples: int = 30, kind: int = 0, axes: bytes = AXES, version: int = 1) -> bytes:
    rows = b"".join(struct.pack("<hhH", *row) for row in MANOEUVRES)
    return struct.pack("<BBBHH", version, kind, 10, samples, 2) + axes + bytes([len(MANOEUVRES)]) + rows


class Answers:
    """An infrared tower that answers the request for block n with `blocks[n]`."""

    def __init__(self, blocks: dict[int, bytes]) -> None:
        self.blocks = blocks

    def exchange(
        self, packet: bytes, find: Callable[[bytes], bytes | None], reply_bytes: int, patience: float, /
    ) -> bytes | None:
        request = lnp.find(packet, lnp.BRICK, lnp.HOST)
        assert request is not None
        block = self.blocks.get(*struct.unpack("<H", request))
        return find(b"" if block is None else lnp.packet(request + block, lnp.HOST, lnp.BRICK))


def test_numbers_of_ten_bits_come_out_of_five_bytes() -> None:
    numbers = [1023, 0, 341, 682]
    packed = sum(number << 10 * place for place, number in enumerate(numbers)).to_bytes(5, "little")
    assert rcx.unpack(packed + packed).tolist() == [numbers, numbers]


def test_a_recording_becomes_si_values_in_the_papers_frame() -> None:
    one = (500 | 510 << 10 | 522 << 20 | 319 << 30).to_bytes(5, "little")
    description, samples = rcx.fetch(Answers({0: block_0(), 1: 20 * one, 2: 10 * one}), PORT)
    new = rcx.dataset_of(description, samples)
    (run,) = new.runs
    assert run.name == "spin"
    assert run.columns["yaw_rate"] == pytest.approx(np.full(30, 10 * (20 + 115 / 256) / 1000))
    assert run.columns["accel_surge"] == pytest.approx(np.zeros(30))
    assert run.columns["accel_sway"] == pytest.approx(np.full(30, -10 * (38 + 82 / 256) / 1000))
    assert run.columns["duty_right"][0] == -0.5
    assert run.columns["time"][-1] == pytest.approx(0.29)
    assert list(new.notes) == ["2 of 30 samples were late"]


def test_wheels_turn_on_where_their_ten_bits_wrap() -> None:
    raw = np.array([1020.0, 1023.0, 2.0, 1022.0])
    turned = rcx._turned(raw, True)
    assert turned * 48 / (2 * np.pi) == pytest.approx([0, -3, -6, -2])


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ({}, "/dev/tower: no answer: is the tower plugged in"),
        ({0: b""}, "/dev/tower: recorder of version , not 01"),
        ({0: block_0(version=2)}, "/dev/tower: recorder of version 02, not 01"),
        ({0: block_0(samples=31)}, "/dev/tower: the description is not whole"),
        ({0: block_0()[:-1]}, "/dev/tower: the description is not whole"),
        ({0: block_0()[:12]}, "/dev/tower: the description is not whole"),
        ({0: block_0(kind=3)}, "/dev/tower: the description is not whole"),
        ({0: block_0(), 1: bytes(100)}, "/dev/tower: block 2 did not come in 8 tries"),
        ({0: block_0(), 1: bytes(99)}, "/dev/tower: block 1 has 99 bytes, not 100"),
    ],
)
def test_a_wrong_reply_is_refused_in_one_line(blocks: dict[int, bytes], message: str) -> None:
    with pytest.raises(InputError) as error:
        rcx.fetch(Answers(blocks), PORT)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_a_port_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such device"):
        rcx.import_rcx([tmp_path / "tty"])
