"""The download protocol of the RCX's ROM.

Packet: 55 FF 00, then opcode, operands and the sum of both, each byte followed by its complement. The opcode of an
answer is the complement of the request's. What one must know to send again what was lost:

- The ROM keeps the opcode that it answered last. A request with the same one gets the same answer and does nothing
  else: a new request toggles bit 3, one that is sent again does not.
- It writes a block's bytes to memory as they come, and goes back to where the block began when the same index comes
  again: a block may be sent again, and shorter, until it is acknowledged.
- Behind damage it looks for the next opcode at once, in the same packet. If it takes bytes of the image for the head
  of another block, it forgets where this one began; if it takes them for the same short request twice, it repeats the
  answer to the last block, and passes for having this one. So on a line that damages packets, blocks end before they
  hold such bytes.
- If both a byte of the index and its complement are lost, it forgets where the block began too; and after a block
  whose checksum was wrong it waits for the next one. Then only a new download helps.

Sources: K. Proudfoot, RCX Internals; the ROM that J. Hoenicke wrote for brickEmu.
"""

from __future__ import annotations

from brickpilot.errors import InputError
from brickpilot.flash.srec import Image
from brickpilot.flash.tally import Progress, Tally
from brickpilot.link.tower import Tower

TOGGLE = 0x08
ALIVE = b"\x10"
VERSIONS = b"\x15\x01\x03\x05\x07\x0b"
DELETE = b"\x65\x01\x03\x05\x07\x0b"
BEGIN = b"\x75"
BLOCK = b"\x45"
UNLOCK = b"\xa5LEGO\xae"

LONGEST = 200
"""Bytes of image in a block, as firmdl3 and nqc send them."""
SHORTEST = 8
_SKIPPED = (0x00, 0x55, 0xFF)
"""What the ROM passes over where it looks for an opcode."""
_AROUND = 6
"""Bytes of a block that are not the image's: opcode, index, length, checksum."""
TRIES_PRESENT = 10
TRIES = 40
"""Of one packet, once the brick has answered: 20 s and more, so that a brick that is put back into the beam goes on."""
DOWNLOADS = 12
"""Of the whole image, where nothing less helps."""


def frame(body: bytes) -> bytes:
    """The packet of opcode and operands `body`."""
    checked = body + bytes([sum(body) & 0xFF])
    return b"\x55\xff\x00" + bytes(byte for value in checked for byte in (value, value ^ 0xFF))


def find_reply(heard: bytes, opcode: int, length: int) -> bytes | None:
    """Finds the answer to `opcode`, `length` bytes with its own opcode; its header need not have come unharmed."""
    pairs = length + 1
    for at in range(len(heard) - 2 * pairs + 1):
        values = heard[at : at + 2 * pairs : 2]
        if values[0] != opcode ^ 0xFF or sum(values[:-1]) & 0xFF != values[-1]:
            continue
        if all(low ^ high == 0xFF for low, high in zip(values, heard[at + 1 : at + 2 * pairs : 2], strict=True)):
            return values[:-1]
    return None


def _misread(packet: bytes) -> bool:
    """Whether the ROM may take what is left of this block, when its beginning is damaged, for another packet.

    The head of a block is enough for that: five bytes. Of any other packet it would be opcode, operands (as many as the
    opcode's low bits say) and sum. The block's index, at 1 and 2, has to be what it is.
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
    """Opcode and operands of `piece`; if careful, of as much of it as cannot be misread, or of one byte."""
    for length in range(len(piece), 0, -1):
        data = piece[:length]
        head = bytes([opcode]) + index.to_bytes(2, "little") + length.to_bytes(2, "little")
        body = head + data + bytes([sum(data) & 0xFF])
        if not careful or not _misread(body + bytes([sum(body) & 0xFF])):
            break
    return body


class Rom:
    """The ROM of the brick before `tower`."""

    def __init__(self, tower: Tower) -> None:
        self._tower = tower
        self._last = -1
        self._size = LONGEST

    def alive(self) -> bool:
        """Whether the ROM answers, or a firmware that speaks its protocol, as LEGO's does."""
        return self._ask(ALIVE, 1, TRIES_PRESENT) is not None

    def download(self, image: Image, tally: Tally, progress: Progress) -> bool:
        """Replaces the firmware of a brick that is `alive`.

        Returns:
            Whether the brick confirmed the start; if not, it fell silent when it was told to start.

        Raises:
            InputError: it refuses the image.
            TimeoutError: it stopped answering.
        """
        begin = BEGIN + image.entry.to_bytes(2, "little") + image.checksum.to_bytes(2, "little") + b"\0"
        for _ in range(DOWNLOADS):
            self._must(DELETE, 1)
            code = self._must(begin, 2)[1]
            if code != 0:
                raise InputError(f"the brick refuses to begin a download, code {code}", field=self._tower.device)
            if self._send_blocks(image.data, tally, progress):
                progress(len(image.data), len(image.data), "starting it")
                started = self._start()
                if started is not False:
                    return bool(started)
        raise InputError(
            f"the brick refuses the image, {DOWNLOADS} times: it arrives damaged; move it nearer, out of the light",
            field=self._tower.device,
        )

    def _send_blocks(self, data: bytes, tally: Tally, progress: Progress) -> bool:
        """Sends the image; False when only another download helps."""
        at, index = 0, 1
        while at < len(data):
            progress(at, len(data), "firmware")
            opcode = self._toggled(BLOCK[0])
            limit = min(self._size, len(data) - at)
            for attempt in range(TRIES):
                if attempt > 1:  # the longer a packet, the likelier that it is hit
                    limit = max(min(limit, SHORTEST), limit // 2)
                careful = attempt > 0 or index == 1 or self._size < LONGEST  # else the line has proved clean
                packet = block(opcode, index, data[at : at + limit], careful=careful)
                length = len(packet) - _AROUND
                tally.tried(again=attempt > 0)
                reply = self._exchange(packet, 2)
                if reply is not None:
                    break
                if attempt == TRIES // 2:
                    if self.alive():  # it hears, yet not this block: it has lost its place
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
            elif length == limit:  # a shorter one that came through says nothing of longer ones
                self._size = min(LONGEST, self._size + max(8, self._size // 3))
        return True

    def _start(self) -> bool | None:
        """Has the ROM check and start the image: True started, False it will not, None it fell silent."""
        for _ in range(3):
            if self._ask(UNLOCK, 26, 3, patience=4) is not None:
                return True
            versions = self._ask(VERSIONS, 9, 6)
            if versions is None:
                return None
            if any(versions[5:]):  # a firmware runs that speaks the ROM's protocol: its answer to UNLOCK was lost
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
        """`opcode` as a new request: bit 3 other than in the last one."""
        self._last = opcode ^ TOGGLE if self._last == opcode else opcode
        return self._last

    def _exchange(self, packet: bytes, reply_length: int, patience: float = 1.0) -> bytes | None:
        return self._tower.exchange(
            frame(packet), lambda heard: find_reply(heard, packet[0], reply_length), 5 + 2 * reply_length, patience
        )
