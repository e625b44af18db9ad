"""`brickpilot flash rcx` reports each obstacle in one line, if possible before it sends anything."""

from __future__ import annotations

import functools
import struct
from pathlib import Path

import pytest
from brickpilot.cli import main
from brickpilot.flash import image_files, rom
from rcx_brick import BYTE_S, RcxBrick

pytestmark = pytest.mark.realtime  # the link's time-outs are in real time, for the speed of a pseudo-terminal

KNOCK = image_files.KNOCK


def record(kind: int, address: int, data: bytes = b"") -> str:
    content = address.to_bytes(2, "big") + data
    checked = bytes([len(content) + 1]) + content
    return f"S{kind}{checked.hex().upper()}{0xFF - (sum(checked) & 0xFF):02X}"


GOOD = [record(0, 0, b"test"), record(1, 0x8000, b"\x54\x70"), record(1, 0x8002, KNOCK), record(9, 0x8000)]


def program(
    *, version: int = 0, text: bytes = b"Tp" * 8, bss: int = 0, start: int = 0, places: tuple[int, ...] = ()
) -> bytes:
    header = struct.pack(">8H", version, 0xB000, len(text), 0, bss, 512, start, len(places))
    return b"brickOS\0" + header + text + struct.pack(f">{len(places)}H", *places)


IMAGES = {
    "no S-records": ("hello\n", ":1: is no S-record"),
    "an ELF file": ("\x7fELF\x01\x02", ":1: is no S-record"),
    "empty": ("", "holds no data"),
    "not hexadecimal": ("\n".join([GOOD[0], "S105800G547056"]), ":2: is no S-record: it needs an even number"),
    "wrong count": ("\n".join([GOOD[0], GOOD[1][:-2]]), ":2: gives its length as 5 bytes, but has 4"),
    "wrong checksum": ("\n".join([*GOOD[:2], GOOD[2][:-2] + "00", GOOD[3]]), ":3: has the wrong checksum 00"),
    "cut short": ("\n".join(GOOD[:3]), "its end record (S9) is missing"),
    "written twice": ("\n".join([GOOD[1], GOOD[1], *GOOD[2:]]), ":2: writes to 0x8000, where"),
    "after its end": ("\n".join([*GOOD, GOOD[1]]), ":5: stands behind"),
    "below the memory": ("\n".join([record(1, 0x7FFF, b"aa"), *GOOD[1:]]), ":1: 0x7FFF..0x8000 is outside"),
    "over the ROM's variables": (
        "\n".join([*GOOD[:3], record(1, 0xEE5D, b"aa"), GOOD[3]]),
        ":4: 0xEE5D..0xEE5E is outside",
    ),
    "linked elsewhere": ("\n".join([record(1, 0xB000, KNOCK), record(9, 0xB000)]), "starts at 0xB000"),
    "entered outside": ("\n".join([*GOOD[:3], record(9, 0)]), "has its entry at 0x0000"),
    "does not knock": ("\n".join([GOOD[1], GOOD[3]]), 'lacks "Do you byte, when I knock?"'),
    "knocks too high": (
        "\n".join([GOOD[1], record(1, 0xCBF0, KNOCK), GOOD[3]]),
        'lacks "Do you byte, when I knock?" below 0xCC00',
    ),
    "a program's records": ("$$ program\n  _main $b000\n$$\n", ":1: holds a program: S-records with symbols"),
}  # fmt: skip

PROGRAMS = {
    "not an .lx": (b"S00F0000", "is no brickOS program"),
    "only its name": (b"brickOS\0\0\0", "ends within its header"),
    "another version": (program(version=1), "has format version 1"),
    "cut short": (program()[:-1], "has 39 bytes, but its header gives 40"),
    "too long": (program() + b"\0", "has 41 bytes, but its header gives 40"),
    "relocated outside": (program(places=(15,)), "has a relocation outside"),
    "started outside": (program(start=16), "starts at 16, beyond its 16 bytes of text"),
    "too large": (program(bss=28700), "too large for the RCX's 28672"),
}


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes the command use `BYTE_S`, the time of a byte on the pseudo-terminal."""
    for name in ("flash_firmware", "flash_program"):
        monkeypatch.setattr(rom, name, functools.partial(getattr(rom, name), byte_s=BYTE_S))
    monkeypatch.delenv("RCXTTY", raising=False)


def refused(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 2) -> str:
    """Returns the line with which `brickpilot flash rcx ARGUMENTS` refuses. `status`: the expected exit status."""
    with pytest.raises(SystemExit) as stopped:
        main.main(["flash", "rcx", *arguments, "--json"])
    said = capsys.readouterr()
    assert stopped.value.code == status
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


@pytest.fixture
def image(tmp_path: Path) -> str:
    file = tmp_path / "good.srec"
    file.write_text("\r\n".join(GOOD))
    return str(file)


@pytest.fixture
def lx(tmp_path: Path) -> str:
    file = tmp_path / "good.lx"
    file.write_bytes(program())
    return str(file)


@pytest.mark.parametrize(("content", "expected"), IMAGES.values(), ids=IMAGES)
def test_a_wrong_image_is_refused_unsent(
    content: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "image.srec"
    file.write_bytes(content.encode("latin-1"))
    with RcxBrick() as brick:
        assert expected in refused(capsys, str(file), "--tty", brick.path)
    assert brick.heard == 0


@pytest.mark.parametrize(("content", "expected"), PROGRAMS.values(), ids=PROGRAMS)
def test_a_wrong_program_is_refused_unsent(
    content: bytes, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "wrong.lx"
    file.write_bytes(content)
    with RcxBrick(brickos=True) as brick:
        assert expected in refused(capsys, str(file), "--tty", brick.path)
    assert brick.heard == 0


def test_good_files_arrive(image: str, lx: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The image and the program without a fault are delivered. `IMAGES` and `PROGRAMS` have faulty variants of them."""
    with RcxBrick() as rom:
        main.main(["flash", "rcx", image, "--tty", rom.path])
    with RcxBrick(brickos=True) as brickos:
        main.main(["flash", "rcx", lx, "--tty", brickos.path])
    assert rom.firmware(2) == b"\x54\x70"
    assert bytes(brickos.brickos.slots[0].image) == b"Tp" * 8
    assert "firmware, started" in capsys.readouterr().out


def test_files_and_options_that_do_not_fit_are_refused(
    image: str, lx: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    renamed = tmp_path / "program.srec"
    renamed.write_bytes(program())
    assert "No such file" in refused(capsys, str(tmp_path / "none.srec"), "--tty", "/dev/null")
    assert "No such file" in refused(capsys, str(tmp_path / "none.lx"), "--tty", "/dev/null")
    assert "needs the suffix .lx" in refused(capsys, str(renamed), "--tty", "/dev/null")
    assert "--tty: is missing" in refused(capsys, image)
    assert "apply to programs" in refused(capsys, image, "--tty", "/dev/null", "-p", "2")
    assert "not in the range 1<=x<=8" in refused(capsys, lx, "--tty", "/dev/null", "-p", "0")


def test_missing_ports_and_towers_are_reported(image: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no such device" in refused(capsys, image, "--tty", str(tmp_path / "ttyUSB0"))
    assert "cannot be opened as a serial port" in refused(capsys, image, "--tty", image)
    with RcxBrick(tower=False) as brick:
        assert "has no tower: nothing echoes" in refused(capsys, image, "--tty", brick.path)


def test_a_missing_brick_is_reported(image: str, lx: str, capsys: pytest.CaptureFixture[str]) -> None:
    for file in (image, lx):
        with RcxBrick(on=False) as brick:
            assert "the brick does not reply: is it on" in refused(capsys, file, "--tty", brick.path)


def test_a_brick_with_the_other_software_is_reported(image: str, lx: str, capsys: pytest.CaptureFixture[str]) -> None:
    with RcxBrick(brickos=True) as brick:
        said = refused(capsys, image, "--tty", brick.path)
    assert "brickOS runs on the brick" in said
    assert "hold Prgm and press On-Off" in said
    with RcxBrick() as brick:
        assert "the brick has no brickOS: flash brickOS.srec first" in refused(capsys, lx, "--tty", brick.path)
    with RcxBrick(brickos=True, host=3) as brick:
        assert "Is its LNP address 0?" in refused(capsys, lx, "--tty", brick.path)


def test_a_brick_whose_program_runs_is_reported(lx: str, capsys: pytest.CaptureFixture[str]) -> None:
    with RcxBrick(brickos=True) as brick:
        brick.brickos.running = 1
        assert "a program runs on the brick: stop it" in refused(capsys, lx, "--tty", brick.path)


def test_a_program_without_room_on_the_brick_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "large.lx"
    file.write_bytes(program(bss=0x4100))
    with RcxBrick(brickos=True) as brick:
        said = refused(capsys, str(file), "--tty", brick.path)
    assert "it has no room for 16656 bytes" in said
    assert not any(slot.text for slot in brick.brickos.slots)


def test_a_refused_image_is_reported(image: str, capsys: pytest.CaptureFixture[str]) -> None:
    with RcxBrick(broken_sums=1000) as brick:
        assert "the brick refused the image 12 times" in refused(capsys, image, "--tty", brick.path)
    assert brick.rom.entry is None


def test_a_brick_that_stops_replying_gives_status_1(
    image: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = tmp_path / "long.srec"
    blocks = [record(1, 0x8100 + at, bytes(range(200))) for at in range(0, 4000, 200)]
    long.write_text("\n".join([*GOOD[:3], *blocks, GOOD[3]]))
    with RcxBrick(vanish_after=3000) as brick:
        said = refused(capsys, str(long), "--tty", brick.path, status=1)
    assert "the brick no longer replies after 1400 of 4256 bytes" in said
    file = tmp_path / "long.lx"
    file.write_bytes(program(text=bytes(range(250)) * 8))
    with RcxBrick(brickos=True, vanish_after=1000) as brick:
        said = refused(capsys, str(file), "--tty", brick.path, status=1)
    assert "the brick no longer replies after 744 of 2000 bytes" in said
