"""LNP packets, and RCX records that come wrong; tests/gates/test_rcx.py has those of the simulated brick."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from brickpilot.errors import InputError
from brickpilot.hil.lnp import Decoder, Packet, checksum, encode
from brickpilot.importers import rcx

PORT = Path("/dev/tower")
AXES = struct.pack("<HHB", 512, 20 * 256 + 115, 0) + 2 * struct.pack("<HHB", 500, 38 * 256 + 82, 1)
MANOEUVRES = ((16384, -16384, 30),)


def block_0(samples: int = 30, kind: int = 0, axes: bytes = AXES, version: int = 1) -> bytes:
    rows = b"".join(struct.pack("<hhH", *row) for row in MANOEUVRES)
    return struct.pack("<BBBHH", version, kind, 10, samples, 2) + axes + bytes([len(MANOEUVRES)]) + rows


class Answers:
    """A line at whose other end each block has its answer, behind the tower's echo."""

    def __init__(self, blocks: dict[int, bytes]) -> None:
        self.blocks, self.waiting = blocks, b""

    def write(self, data: bytes, /) -> int:
        (request,) = Decoder().take(data)
        (number,) = struct.unpack("<H", request.data)
        self.waiting += data
        if number in self.blocks:
            self.waiting += encode(Packet(rcx.HOST, rcx.BRICK, request.data + self.blocks[number]))
        return len(data)

    def read(self, size: int = 1, /) -> bytes:
        taken, self.waiting = self.waiting[:size], self.waiting[size:]
        return taken


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rcx, "ANSWER_S", 0.02)


def test_a_packet_is_what_brickos_sends() -> None:
    assert encode(Packet(0x07, 0x87, b"\x01\x00")) == bytes.fromhex("f1040787010083")
    assert checksum(b"") == 0xFF


def test_packets_are_found_between_noise_cut_and_damaged_ones() -> None:
    packets = [Packet(0x87, 0x07, bytes(range(size))) for size in (0, 1, 100)]
    one, two, three = map(encode, packets)
    damaged = bytes([two[0], two[1], two[2] ^ 4, *two[3:]])
    line = b"\x00\x55" + one + damaged + bytes([0xF0, 1, 7, 0xF7]) + two + b"\xff" + three
    decoder = Decoder()
    assert [packet for byte in line for packet in decoder.take(bytes([byte]))] == packets
    assert decoder.take(one[:3]) == []
    decoder.forget()
    assert decoder.take(one) == packets[:1]


def test_numbers_of_ten_bits_come_out_of_five_bytes() -> None:
    numbers = [1023, 0, 341, 682]
    packed = sum(number << 10 * place for place, number in enumerate(numbers)).to_bytes(5, "little")
    assert rcx.unpack(packed + packed).tolist() == [numbers, numbers]


def test_a_record_becomes_si_values_in_the_papers_frame() -> None:
    one = (500 | 510 << 10 | 522 << 20 | 319 << 30).to_bytes(5, "little")
    description, samples = rcx.fetch(Answers({0: block_0(), 1: 20 * one, 2: 10 * one}), PORT)
    new = rcx.dataset_of(description, samples, "bench", {})
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
        ({0: b""}, "/dev/tower: record of version , not 01"),
        ({0: block_0(version=2)}, "/dev/tower: record of version 02, not 01"),
        ({0: block_0(samples=31)}, "/dev/tower: the description is not whole"),
        ({0: block_0()[:-1]}, "/dev/tower: the description is not whole"),
        ({0: block_0()[:12]}, "/dev/tower: the description is not whole"),
        ({0: block_0(kind=3)}, "/dev/tower: the description is not whole"),
        ({0: block_0(), 1: bytes(100)}, "/dev/tower: block 2 did not come in 8 tries"),
        ({0: block_0(), 1: bytes(99)}, "/dev/tower: block 1 has 99 bytes, not 100"),
    ],
)
def test_a_wrong_answer_is_told_in_one_line(blocks: dict[int, bytes], message: str) -> None:
    with pytest.raises(InputError) as error:
        rcx.fetch(Answers(blocks), PORT)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_a_port_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no tower there: No such file or directory"):
        rcx.import_rcx(tmp_path / "tty", tmp_path / "out")
    assert not (tmp_path / "out").exists()
