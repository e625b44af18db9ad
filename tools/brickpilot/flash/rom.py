"""Puts a file on an RCX: firmware by the download protocol of the ROM, programs by the protocol of brickOS.

A packet is 55 FF 00, then the opcode, the operands and the sum of opcode and operands. After 55 FF 00, each byte is
followed by its complement. The opcode of a reply is the complement of the request's opcode. The rules for sending a
packet again:

- The ROM remembers the opcode to which it last replied. If the next request has the same opcode, the ROM only repeats
  its reply. So a new request toggles bit 3 of its opcode, and a repeated request does not.
- The ROM writes the bytes of a block to memory as they arrive. When the same index arrives again, the ROM goes back to
  the start of the block. So a block can be sent again, even with fewer bytes, until it is acknowledged.
- After a damaged byte, the ROM looks for an opcode in the rest of the same packet. The ROM may take bytes of the image
  for the head of another block; then the ROM loses the start of the present block. The ROM may also take image
  bytes for a short request, twice in a row. Then the ROM repeats its reply to the last block, and this reply looks like
  an acknowledgement. So if the line damages packets, a block ends before bytes that the ROM could misread.
- The ROM also loses the start of a block if a byte of the index and the byte's complement are both lost. After a block
  with a wrong checksum, the ROM waits for the next block. Then only a new download helps.

Sources: K. Proudfoot, RCX Internals; J. Hoenicke's ROM for brickEmu.
"""

from __future__ import annotations

import dataclasses
import time

from brickpilot.errors import InputError
from brickpilot.flash import image_files
from brickpilot.flash.image_files import Image
from brickpilot.flash.program import Loader, Progress, Tally
from brickpilot.link.tower import BYTE_S, Tower

TOGGLE = 0x08
ALIVE = b"\x10"
VERSIONS = b"\x15\x01\x03\x05\x07\x0b"
DELETE = b"\x65\x01\x03\x05\x07\x0b"
BEGIN = b"\x75"
BLOCK = b"\x45"
UNLOCK = b"\xa5LEGO\xae"

LONGEST = 200
"""Largest number of image bytes in a block, the same as in firmdl3 and nqc."""
SHORTEST = 8
_SKIPPED = (0x00, 0x55, 0xFF)
"""Bytes that the ROM skips when it looks for an opcode."""
_AROUND = 6
"""Number of bytes in a block besides the image: opcode, index, length and checksum."""
TRIES_PRESENT = 10
TRIES = 40
"""Largest number of tries for a packet once the brick has replied: 20 s, time to move the brick back into range."""
DOWNLOADS = 12
"""Largest number of downloads of the whole image."""


def frame(body: bytes) -> bytes:
    """Returns the packet that carries `body`, an opcode and its operands."""
    checked = body + bytes([sum(body) & 0xFF])
    return b"\x55\xff\x00" + bytes(byte for value in checked for byte in (value, value ^ 0xFF))


def find_reply(received: bytes, opcode: int, length: int) -> bytes | None:
    """Returns the reply to `opcode`, even if its header is damaged, or None. `length`: its number of bytes."""
    pairs = length + 1
    for at in range(len(received) - 2 * pairs + 1):
        values = received[at : at + 2 * pairs : 2]
        if values[0] != opcode ^ 0xFF or sum(values[:-1]) & 0xFF != values[-1]:
            continue
        if all(low ^ high == 0xFF for low, high in zip(values, received[at + 1 : at + 2 * pairs : 2], strict=True)):
            return values[:-1]
    return None


def _misread(packet: bytes) -> bool:
    """Returns whether the ROM can take the rest of this block for another packet if the block's beginning is damaged.

    The ROM takes five bytes for a block if they look like a block's head. For any other packet it needs an opcode, as
    many operands as the opcode's low bits say, and the right sum. The search begins after the block's index, because
    a cut of `piece` does not change opcode and index.
    """
    for at in range(3, len(packet)):
        if packet[at] & ~TOGGLE == BLOCK[0]:
            if at + 4 < len(packet):
                return True
        elif packet[at] not in _SKIPPED:
            end = at + 1 + (packet[at] & 7) % 6
            if end < len(packet) and sum(packet[at:end]) & 0xFF == packet[end]:
                return True
    return False


def block(opcode: int, index: int, piece: bytes, *, careful: bool) -> bytes:
    """Returns opcode and operands of a block with `piece`; if `careful`, `piece` is cut so that it is not misread."""
    for length in range(len(piece), 0, -1):
        data = piece[:length]
        head = bytes([opcode]) + index.to_bytes(2, "little") + length.to_bytes(2, "little")
        body = head + data + bytes([sum(data) & 0xFF])
        if not careful or not _misread(body + bytes([sum(body) & 0xFF])):
            break
    return body


class Rom:
    """Speaks to the ROM of the brick in front of `tower`."""

    def __init__(self, tower: Tower) -> None:
        self._tower = tower
        self._last = -1
        self._size = LONGEST

    def alive(self) -> bool:
        """Returns whether the ROM replies, or a firmware with the same protocol, such as LEGO's."""
        return self._ask(ALIVE, 1, TRIES_PRESENT) is not None

    def download(self, image: Image, tally: Tally, progress: Progress) -> bool:
        """Replaces the firmware of a brick that is `alive`.

        Returns:
            Whether the brick confirmed the start. If it did not, it has not replied since the start command.

        Raises:
            InputError: the brick refuses the image.
            TimeoutError: the brick stopped replying.
        """
        begin = BEGIN + image.entry.to_bytes(2, "little") + image.checksum.to_bytes(2, "little") + b"\0"
        for _ in range(DOWNLOADS):
            self._must(DELETE, 1)
            code = self._must(begin, 2)[1]
            if code != 0:
                raise InputError(f"the brick refuses to begin a download, code {code}", field=self._tower.device)
            if self._send_blocks(image.data, tally, progress):
                progress(len(image.data), len(image.data), "start")
                started = self._start()
                if started is not False:
                    return bool(started)
        raise InputError(
            f"the brick refused the image {DOWNLOADS} times because it arrived damaged; move the brick nearer and out "
            "of bright light",
            field=self._tower.device,
        )

    def _send_blocks(self, data: bytes, tally: Tally, progress: Progress) -> bool:
        """Sends the image. Returns False if only a new download helps."""
        at, index = 0, 1
        while at < len(data):
            progress(at, len(data), "firmware")
            opcode = self._toggled(BLOCK[0])
            limit = min(self._size, len(data) - at)
            for attempt in range(TRIES):
                if attempt > 1:  # a long packet is damaged more often
                    limit = max(min(limit, SHORTEST), limit // 2)
                careful = attempt > 0 or index == 1 or self._size < LONGEST  # else the line seems undisturbed
                packet = block(opcode, index, data[at : at + limit], careful=careful)
                length = len(packet) - _AROUND
                tally.tried(again=attempt > 0)
                reply = self._exchange(packet, 2)
                if reply is not None:
                    break
                if attempt == TRIES // 2:
                    if self.alive():  # the brick replies, but not to this block, because it lost the block's start
                        return False
                    self._last = opcode
            else:
                raise self._tower.lost(f" after {at} of {len(data)} bytes")
            if reply[1] != 0:
                return False
            at += length
            index += 1
            if attempt:
                self._size = limit
            elif length == limit:  # the success of a shorter block says nothing about longer blocks
                self._size = min(LONGEST, self._size + max(8, self._size // 3))
        return True

    def _start(self) -> bool | None:
        """Lets the ROM check and start the image. Returns True: started, False: refused, None: no reply."""
        for _ in range(3):
            if self._ask(UNLOCK, 26, 3, patience=4) is not None:
                return True
            versions = self._ask(VERSIONS, 9, 6)
            if versions is None:
                return None
            if any(versions[5:]):  # a firmware with the ROM's protocol runs: its reply to UNLOCK was lost
                return True
        return False

    def _must(self, body: bytes, reply_length: int) -> bytes:
        reply = self._ask(body, reply_length, TRIES, patience=2)
        if reply is None:
            raise self._tower.lost()
        return reply

    def _ask(self, body: bytes, reply_length: int, tries: int, patience: float = 1.0) -> bytes | None:
        packet = bytes([self._toggled(body[0])]) + body[1:]
        for _ in range(tries):
            reply = self._exchange(packet, reply_length, patience)
            if reply is not None:
                return reply
        return None

    def _toggled(self, opcode: int) -> int:
        """Returns the opcode of a new request: bit 3 is toggled if the last request had the same opcode."""
        self._last = opcode ^ TOGGLE if self._last == opcode else opcode
        return self._last

    def _exchange(self, packet: bytes, reply_length: int, patience: float = 1.0) -> bytes | None:
        return self._tower.exchange(
            frame(packet),
            lambda received: find_reply(received, packet[0], reply_length),
            5 + 2 * reply_length,
            patience,
        )


_SILENCE = (
    "the brick does not reply: is it on, are its batteries good, and does its window face the tower at 10 to 20 cm?"
)


@dataclasses.dataclass(frozen=True)
class Delivered:
    """The result of a delivery. `image` is in the brick's memory from `address` on."""

    image: bytes
    address: int
    tally: Tally
    seconds: float


def flash_firmware(image: image_files.Image, device: str, *, progress: Progress, byte_s: float = BYTE_S) -> Delivered:
    """Replaces a brick's firmware and starts it.

    Raises:
        InputError: there is no port, no tower or no reply, or the brick refuses the firmware.
        TimeoutError: the brick stopped replying.
    """
    began, tally = time.monotonic(), Tally()
    with Tower(device, byte_s) as tower:
        rom, loader = Rom(tower), Loader(tower)
        if not rom.alive():
            if loader.alive():
                raise InputError(
                    "brickOS runs on the brick, and only the brick's keys delete it: stop its program, hold Prgm and "
                    "press On-Off, then flash again",
                    field=device,
                )
            raise InputError(
                f"{_SILENCE} If it runs a brickOS with another LNP address, hold Prgm and press On-Off to delete it",
                field=device,
            )
        if not rom.download(image, tally, progress) and not loader.alive():
            raise TimeoutError(
                f"{device}: the whole image is on the brick, but the brick did not confirm the start. If its display "
                "shows no firmware, flash again"
            )
    return Delivered(image.data, image_files.START, tally, time.monotonic() - began)


def flash_program(
    program: image_files.Program,
    device: str,
    *,
    slot: int = 0,
    host: int = 0,
    execute: bool = False,
    progress: Progress,
    byte_s: float = BYTE_S,
) -> Delivered:
    """Puts a program into a slot, 0..7, of a brick with brickOS, and replaces the program that is there.

    Raises:
        InputError: there is no port, no tower or no reply, or the brick refuses the program.
        TimeoutError: the brick stopped replying.
    """
    began, tally = time.monotonic(), Tally()
    with Tower(device, byte_s) as tower:
        loader = Loader(tower, host)
        if not loader.delete(slot):
            if loader.alive():
                raise InputError("a program runs on the brick: stop it with Run, then try again", field=device)
            if Rom(tower).alive():
                raise InputError("the brick has no brickOS: flash brickOS.srec first", field=device)
            raise InputError(f"{_SILENCE} Is its LNP address {host}?", field=device)
        base = loader.send(program, slot, tally, progress)
        if execute:
            loader.run(slot)
    return Delivered(program.at(base), base, tally, time.monotonic() - began)
