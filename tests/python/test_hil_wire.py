"""The C code of hal/wire encodes and decodes as Python libraries do: COBS, CRC, slcan, and the messages of the DBC."""

from __future__ import annotations

import binascii
import struct
from typing import Any

import cantools
import pytest
from brickpilot.compiled import interface
from brickpilot.link.links import decode_frame, encode_frame
from brickpilot.link.messages import book, crc16
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

ffi: Any
ffi, LIBRARY = interface("brickpilot_brick")
IDS = st.integers(0, 0x7FF)
DATA = st.binary(max_size=8)


def in_c(function: str, identifier: int, data: bytes) -> bytes:
    """Returns the bytes that the C encoder `function` makes of a message."""
    out = ffi.new("unsigned char[22]")
    size = getattr(LIBRARY, function)(identifier, data, len(data), out)
    return bytes(ffi.buffer(out, size))


def from_c(function: str, line: bytes) -> tuple[int, bytes] | None:
    """Returns id and data that the C decoder `function` reads from `line`; None: the decoder refuses `line`."""
    identifier, out = ffi.new("unsigned int *"), ffi.new("unsigned char[8]")
    size = getattr(LIBRARY, function)(line, len(line), identifier, out)
    return None if size < 0 else (identifier[0], bytes(ffi.buffer(out, size)))


@given(IDS, DATA)
def test_a_frame_in_c_is_cobs_and_crc_in_python(identifier: int, data: bytes) -> None:
    raw = struct.pack("<HB", identifier, len(data)) + data
    wanted = cobs.encode(raw + struct.pack("<H", binascii.crc_hqx(raw, 0xFFFF))) + b"\0"
    assert in_c("bp_frame_encode", identifier, data) == wanted == encode_frame(identifier, data)
    assert from_c("bp_frame_decode", wanted) == (identifier, data) == decode_frame(wanted[:-1])


@given(st.binary(max_size=40))
def test_both_ends_accept_the_same_frames(rubbish: bytes) -> None:
    block = rubbish.replace(b"\0", b"\1")
    assert from_c("bp_frame_decode", block + b"\0") == (decode_frame(block) if block else None)


@given(IDS, DATA)
def test_an_slcan_line_in_c_is_the_one_of_python_can(identifier: int, data: bytes) -> None:
    wanted = f"t{identifier:03X}{len(data)}{data.hex().upper()}\r".encode()
    assert in_c("bp_slcan_encode", identifier, data) == wanted
    assert from_c("bp_slcan_decode", wanted) == (identifier, data)


def test_the_crc_has_the_catalogued_check_value() -> None:
    assert crc16(b"123456789") == 0x29B1


@pytest.mark.parametrize("name", sorted(book().by_name))
def test_layouts_are_those_of_cantools(name: str) -> None:
    message, layout = book().database.get_message_by_name(name), book().by_name[name]

    @given(st.binary(min_size=8, max_size=8))
    def both(data: bytes) -> None:
        decoded = message.decode(data, decode_choices=False, scaling=False)
        assert dict(zip(layout.names, layout.unpack(data), strict=True)) == decoded
        again = message.encode(decoded, scaling=False, strict=False)
        assert layout.pack(*(int(decoded[signal]) for signal in layout.names)) == again

    both()


def test_every_message_has_8_bytes_and_signals_that_a_16_bit_int_can_take() -> None:
    for message in book().database.messages:
        assert message.length == 8
        for signal in message.signals:
            assert not signal.is_signed or signal.length <= 16 or signal.length == 32
            assert signal.byte_order == "little_endian"


def test_a_recording_decodes_with_the_packaged_dbc() -> None:
    database: Any = cantools.database.load_string(book().database.as_dbc_string(), "dbc")
    layout = book().by_name["MOTORS"]
    decoded = database.decode_message(layout.id, layout.seal(32767, -32767, 5, 6))
    assert (decoded["left"], decoded["right"], decoded["sequence"]) == (pytest.approx(1), pytest.approx(-1), 5)
