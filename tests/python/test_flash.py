"""Images reach an emulated RCX bit for bit: by other tools and by `brickpilot flash`, also on bad lines."""

from __future__ import annotations

import functools
import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from brickpilot.flash import image_files, rom
from brickpilot.link import lnp
from brickpilot.link.tower import Tower
from command import brickpilot
from rcx_brick import BYTE_S, Faults, RcxBrick

pytestmark = pytest.mark.realtime  # time-outs of the line, at the speed of the pseudo-terminal

BRICKOS = Path("/usr/lib/brickos")
KERNEL = BRICKOS / "brickOS.srec"
PROGRAM = """
#include <conio.h>
static int counter = 7;
static char *words[] = {"one", "two", "three"};
int sums[20];
int more(int by) { counter += by; return counter; }
int (*const calls[])(int) = {more, more};
int main(int argc, char **argv) {
    cputs(words[counter & 1]);
    sums[counter & 3] = calls[argc & 1](argc);
    return counter;
}
"""
BEGIN, BLOCK = 0x75, 0x45
BAD_LINES = [Faults(seed, **share) for seed in range(2) for share in ({"corrupt": 0.01}, {"lose": 0.01})]

flash_firmware = functools.partial(rom.flash_firmware, progress=lambda *_: None, byte_s=BYTE_S)
flash_program = functools.partial(rom.flash_program, progress=lambda *_: None, byte_s=BYTE_S)


def run(*command: str, cwd: Path) -> None:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stdout[-500:] + done.stderr[-500:]


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Returns the bytes of brickOS's kernel, which binutils read from its S-records."""
    folder = tmp_path_factory.mktemp("kernel")
    run("h8300-hms-objcopy", "-I", "srec", "-O", "binary", str(KERNEL), "kernel.bin", cwd=folder)
    return (folder / "kernel.bin").read_bytes()


@pytest.fixture(scope="module")
def linked(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Returns a function that links a program for an address and returns its COFF file."""
    folder = tmp_path_factory.mktemp("program")
    (folder / "program.c").write_text(PROGRAM)
    includes = [f"-I/usr/include/brickos{part}" for part in ("", "/lnp")]
    run("h8300-hms-gcc", "-O2", "-fno-builtin", "-fomit-frame-pointer", *includes, "-c", "program.c", cwd=folder)

    def link(base: int) -> Path:
        out = folder / f"{base:x}.coff"
        script = ("-T", str(BRICKOS / "brickOS.lds"), "-relax", f"-L{BRICKOS}")
        run(
            "h8300-hms-ld",
            *script,
            "--oformat",
            "coff-h8300",
            "program.o",
            "-lc",
            "-Ttext",
            f"{base:#x}",
            "-o",
            str(out),
            cwd=folder,
        )
        return out

    return link


@pytest.fixture(scope="module")
def program(linked: Callable[[int], Path]) -> Path:
    """Returns an .lx that is made as in brickOS's Makefile."""
    for base in (0xB000, 0xB210):
        coff = linked(base)
        names = (coff.name, f"{base:x}")  # without a path, which would make an S-record too long for makelx
        run("h8300-hms-objcopy", "-I", "coff-h8300", "-O", "symbolsrec", *names, cwd=coff.parent)
    run(str(BRICKOS / "makelx"), "b000", "b210", "program.lx", cwd=coff.parent)
    return coff.with_name("program.lx")


def plain_image() -> image_files.Image:
    """Returns an image of 727 bytes, which are sent in blocks of 200, 200, 200 and 127 bytes."""
    return image_files.Image(bytes(n * n % 61 | 0x80 for n in range(700)) + image_files.KNOCK, 0x8000)


def small_image(size: int = 1000) -> image_files.Image:
    """Returns an image with many bytes that look like opcodes, and with runs of equal bytes."""
    body = bytes(
        0x45 if n % 97 == 0 else 0x4D if n % 89 == 0 else n * n // 7 & 0xF0 | n // 50 & 0xF for n in range(size)
    )
    return image_files.Image(body[:300] + image_files.KNOCK + body[300:], 0x8000)


def large_program(text: int = 1100, data: int = 200) -> image_files.Program:
    image = bytes(n * n * 7 >> 3 & 0xFF for n in range(text + data))
    return image_files.Program(0xB000, text, data, 100, 512, 0, tuple(range(0, text + data - 2, 6)), image)


def downloads(brick: RcxBrick) -> int:
    """Returns the number of downloads that were begun; a repeated request counts once."""
    opcodes = [request[0] for request in brick.rom.requests]
    return sum(
        opcode & 0xF7 == BEGIN and opcode != before for before, opcode in zip([0, *opcodes], opcodes, strict=False)
    )


@pytest.mark.parametrize(
    ("command", "last_block"),
    [
        (("firmdl3", "-s", "--tty={}", str(KERNEL)), 56),
        (("nqc", "-S{}", "-firmware", str(KERNEL)), 0),  # nqc numbers its last block 0: then the ROM plays a sound
    ],
)
def test_other_tools_deliver_the_kernel_bit_for_bit(
    kernel: bytes, tmp_path: Path, command: tuple[str, ...], last_block: int
) -> None:
    with RcxBrick(
        lego=command[0] == "nqc"
    ) as brick:  # nqc asks the started firmware for its version in LEGO's protocol
        run(*(word.format(brick.path) for word in command), cwd=tmp_path)
    assert brick.firmware(len(kernel)) == kernel
    assert brick.rom.entry == 0x801A
    assert brick.rom.blocks[-1] == last_block


def test_flash_delivers_the_kernel_bit_for_bit(kernel: bytes, tmp_path: Path) -> None:
    with RcxBrick() as brick:
        done = brickpilot("flash", "rcx", str(KERNEL), "--tty", brick.path, "--json", cwd=tmp_path, fresh=True)
    assert done.returncode == 0, done.stderr
    assert brick.firmware(len(kernel)) == kernel
    assert brick.rom.entry == 0x801A
    assert brick.rom.blocks == list(range(1, len(brick.rom.blocks) + 1))
    figures = json.loads(done.stdout)
    assert figures["kind"] == "firmware"
    assert figures["bytes"] == len(kernel)
    assert figures["checksum"] == sum(kernel) & 0xFFFF
    assert (figures["packets"], figures["sent_again"]) == (len(brick.rom.blocks), 0)
    assert len(brick.rom.blocks) < 60


@pytest.mark.parametrize("faults", BAD_LINES, ids=str)
def test_flash_delivers_firmware_on_a_line_that_damages_one_byte_of_a_hundred(faults: Faults) -> None:
    image = small_image()
    with RcxBrick(faults=faults) as brick:
        done = flash_firmware(image, brick.path)
    assert brick.firmware(len(image.data)) == image.data
    assert brick.rom.entry == image.entry
    assert brick.rom.blocks == list(range(1, len(brick.rom.blocks) + 1))
    assert brick.hit > 20
    assert downloads(brick) < 4
    assert done.tally.sent_again > 10


def test_flash_delivers_the_whole_kernel_on_a_bad_line(kernel: bytes) -> None:
    with RcxBrick(faults=Faults(2, corrupt=0.005, lose=0.005)) as brick:
        flash_firmware(image_files.read_firmware(KERNEL), brick.path, byte_s=BYTE_S / 2)
    assert brick.firmware(len(kernel)) == kernel
    assert brick.rom.entry == 0x801A
    assert brick.hit > 500


@pytest.mark.parametrize(("lost", "lego"), [*((lost, False) for lost in range(1, 9)), (7, True), (8, True)])
def test_a_lost_reply_costs_a_packet_and_not_the_image(lost: int, lego: bool) -> None:
    """The brick replies to alive, delete, begin, four blocks and start. The ROM repeats a reply without acting again.

    `lego` matters only after the start of the image, whether the reply to start arrives or not.
    """
    image = plain_image()
    with RcxBrick(lose_replies=frozenset([lost]), lego=lego) as brick:
        done = flash_firmware(image, brick.path)
    assert brick.firmware(len(image.data)) == image.data
    assert brick.rom.entry == image.entry
    assert brick.rom.blocks == list(range(1, len(brick.rom.blocks) + 1))
    assert downloads(brick) == 1
    assert done.tally.sent_again >= (4 <= lost <= 7)


def test_several_lost_replies_to_one_block_shorten_it_and_skip_no_byte() -> None:
    """The ROM already has the long block when the short one arrives, and has to continue after the short one."""
    image = plain_image()
    with RcxBrick(lose_replies=frozenset([5, 6, 7])) as brick:
        done = flash_firmware(image, brick.path)
    assert brick.firmware(len(image.data)) == image.data
    assert downloads(brick) == 1
    assert len(brick.rom.blocks) > 4
    assert done.tally.sent_again >= 3


@pytest.mark.parametrize("back_after", [1300, 2000])
def test_a_delivery_continues_when_the_brick_comes_back_into_the_beam(back_after: int) -> None:
    """The brick is away for a few or more than half of all tries; then the sender asks whether the brick is alive."""
    image = plain_image()
    with RcxBrick(vanish_after=700, back_after=back_after) as brick:
        done = flash_firmware(image, brick.path)
    assert brick.firmware(len(image.data)) == image.data
    assert brick.rom.blocks == list(range(1, len(brick.rom.blocks) + 1))
    assert downloads(brick) == 1
    assert (done.tally.sent_again > rom.TRIES // 2) == (back_after == 2000)


def test_a_block_with_a_wrong_checksum_restarts_the_image() -> None:
    image = plain_image()
    with RcxBrick(broken_sums=1) as brick:
        flash_firmware(image, brick.path)
    assert brick.firmware(len(image.data)) == image.data
    assert brick.rom.entry == image.entry
    assert downloads(brick) == 2


@pytest.mark.parametrize("tool", ["dll", "brickpilot"])
def test_a_program_arrives_linked_for_its_address(
    program: Path, linked: Callable[[int], Path], tmp_path: Path, tool: str
) -> None:
    with RcxBrick(brickos=True) as brick:
        if tool == "dll":
            run("dll", f"-t{brick.path}", "-p3", "-e", str(program), cwd=tmp_path)
        else:
            done = brickpilot("flash", "rcx", str(program), "-t", brick.path, "-p", "3", "-e", cwd=tmp_path)
            assert done.returncode == 0, done.stderr
            assert "program 3, started" in done.stdout
    slot = brick.brickos.slots[2]
    assert slot.valid
    assert brick.brickos.running == 2
    assert slot.text not in (0xB000, 0xB210)
    there = str(linked(slot.text))
    run("h8300-hms-objcopy", "-I", "coff-h8300", "-O", "binary", there, "there.bin", cwd=tmp_path)
    assert bytes(slot.image) == (tmp_path / "there.bin").read_bytes()[: len(slot.image)]
    symbols = subprocess.run(["h8300-hms-nm", there], capture_output=True, text=True, check=True).stdout
    assert f"{slot.text + slot.start:04x} T _main\n" in symbols
    assert (slot.stack_size, slot.priority) == (1024, 10)


def test_flash_and_dll_send_the_same_commands(program: Path, tmp_path: Path) -> None:
    with RcxBrick(brickos=True, host=5) as theirs:
        run("dll", f"-t{theirs.path}", "-r5", "-p8", str(program), cwd=tmp_path)
    with RcxBrick(brickos=True, host=5) as ours:
        flash_program(image_files.read_program(program), ours.path, slot=7, host=5)
    assert ours.brickos.commands == theirs.brickos.commands
    assert ours.brickos.slots[7].valid
    assert ours.brickos.running is None


@pytest.mark.parametrize("faults", BAD_LINES, ids=str)
def test_flash_delivers_a_program_on_a_line_that_damages_one_byte_of_a_hundred(faults: Faults) -> None:
    program = large_program()
    with RcxBrick(faults=faults, brickos=True) as brick:
        done = flash_program(program, brick.path, slot=4, execute=True)
    slot = brick.brickos.slots[4]
    assert bytes(slot.image) == program.at(slot.text) == done.image
    assert brick.brickos.running == 4
    assert done.tally.sent_again > 3


@pytest.mark.parametrize("lost", [*([number] for number in range(1, 10)), [3, 4, 5], [8, 9, 10], [2, 4]], ids=str)
def test_a_program_arrives_complete_although_acknowledgements_are_lost(lost: list[int]) -> None:
    """brickOS acknowledges delete, create, six packets of data and run. If create or the last data are sent
    again, brickOS does not acknowledge them again."""
    program = large_program()
    with RcxBrick(brickos=True, lose_replies=frozenset(lost)) as brick:
        flash_program(program, brick.path, execute=True)
    slot = brick.brickos.slots[0]
    assert bytes(slot.image) == program.at(slot.text)
    assert brick.brickos.running == 0


def test_a_reply_counts_only_if_complete_and_not_from_the_echo() -> None:
    """The echo of a block counts for nothing, even if block and complements contain the bytes of the block's reply."""
    reply = rom.frame(b"\xba\x00")
    assert rom.find_reply(b"\x12" + reply, 0x45, 2) == b"\xba\x00"
    for at in range(3, len(reply)):  # the header may be damaged
        damaged = bytearray(reply)
        damaged[at] ^= 0x10
        assert rom.find_reply(bytes(damaged), 0x45, 2) is None
    assert rom.find_reply(reply, 0x4D, 2) is None
    request = rom.frame(b"\x45\x01\x00\x05\x00\xaa\xff\xba\x00\xba\x1d")
    assert rom.find_reply(request, 0x45, 2) == b"\xba\x00"
    with RcxBrick(on=False) as brick, Tower(brick.path, BYTE_S) as tower:
        assert tower.exchange(request, lambda received: rom.find_reply(received, 0x45, 2), 9) is None


def test_an_acknowledgement_counts_only_if_complete_and_from_the_brick() -> None:
    acknowledged = lnp.packet(b"\x00", 0x80, 0x30)
    assert acknowledged.hex() == "f103803000a3"
    assert lnp.find(b"\xf1\x02" + acknowledged, 0x80, 0x30) == b"\x00"
    assert lnp.find(acknowledged, 0x80, 0x00) is None
    for at in range(len(acknowledged)):
        assert lnp.find(acknowledged[:at] + bytes([acknowledged[at] ^ 1]) + acknowledged[at + 1 :], 0x80, 0x30) is None
        assert lnp.find(acknowledged[:at], 0x80, 0x30) is None
