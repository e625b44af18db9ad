"""`brickpilot flash avr`: the real avrdude writes to an emulated boot loader, and each error is one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from arduino_boot_loader import BootLoader
from brickpilot.errors import InputError, WorkFailedError
from brickpilot.flash import avr
from command import brickpilot
from intelhex import IntelHex

UNO = avr.PARTS["328p"]


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """Returns an image of 1000 bytes."""
    made = IntelHex()
    made.puts(0, bytes(index * 7 & 255 for index in range(1000)))
    made.write_hex_file(str(tmp_path / "image.hex"))
    return tmp_path / "image.hex"


def content(image: Path) -> bytes:
    return bytes(IntelHex(str(image)).tobinstr())


def says(text: str, folder: Path, status: int = 1) -> str:
    """Makes a program `avrdude` that prints `text`; returns a PATH in which it comes before the real avrdude."""
    program = folder / "bin" / "avrdude"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\necho "$@" > {folder}/asked\ncat >&2 <<END\n{text}\nEND\nexit {status}\n')
    program.chmod(0o755)
    return f"{program.parent}:/usr/bin:/bin"


def test_the_image_arrives_byte_for_byte(image: Path, tmp_path: Path) -> None:
    with BootLoader() as board:
        done = brickpilot("flash", "avr", str(image), "--port", board.port, "--json", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (0, "")
        figures = json.loads(done.stdout)
        assert figures.pop("seconds") < 60
        assert figures == {
            "file": str(image), "port": board.port, "part": "atmega328p", "bytes": 1000, "written": True
        }  # fmt: skip
        assert board.flash[:1000] == content(image)
        assert set(board.flash[1024:]) == {0xFF}


def test_a_dry_run_writes_nothing(image: Path) -> None:
    with BootLoader() as board:
        assert avr.flash(image, UNO, board.port, dry=True).size == 1000
        assert set(board.flash) == {0xFF}


def test_a_board_with_another_chip_is_named(image: Path) -> None:
    with BootLoader("atmega2560") as board, pytest.raises(InputError) as error:
        avr.flash(image, UNO, board.port)
    assert str(error.value) == f"--port {board.port}: the board has another chip than atmega328p, probably m2560"
    assert set(board.flash) == {0xFF}


def test_flash_that_does_not_keep_what_it_is_sent_fails(image: Path) -> None:
    with BootLoader(worn=True) as board, pytest.raises(WorkFailedError, match="what was read back differs"):
        avr.flash(image, UNO, board.port)


def test_a_silent_board_runs_into_the_time_out(image: Path) -> None:
    with BootLoader(silent=True) as board, pytest.raises(TimeoutError, match=r"avrdude was not done after 1 s"):
        avr.flash(image, UNO, board.port, timeout_s=1.0)


def test_avrdude_is_asked_for_the_mega_by_its_own_protocol(
    image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", says("", tmp_path, status=0))
    avr.flash(image, avr.PARTS["2560"], "COM3", baud=57600, dry=True)
    asked = (tmp_path / "asked").read_text().split()
    assert asked == f"-p atmega2560 -c wiring -P COM3 -b 57600 -D -U flash:w:{image}:i -n".split()


@pytest.mark.parametrize(
    ("text", "kind", "line"),
    [
        ("avrdude: stk500_getsync() attempt 10 of 10: not in sync: resp=0x00", TimeoutError, "no boot loader answers"),
        ("avrdude OS error: cannot open port COM3: No such file", InputError, "--port COM3: cannot be opened"),
        ("avrdude: ser_open(): can't open device: Permission denied", InputError, "--port COM3: is in use, or may not"),
        (
            "avrdude error: something new\n\navrdude done.  Thank you.",
            WorkFailedError,
            "failed: avrdude error: something",
        ),
    ],
)
def test_what_avrdude_says_becomes_one_line(
    text: str, kind: type[Exception], line: str, image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", says(text, tmp_path))
    with pytest.raises(kind, match=line) as error:
        avr.flash(image, UNO, "COM3")
    assert "\n" not in str(error.value)


def test_what_is_wrong_before_avrdude_is_called_is_one_line(image: Path, tmp_path: Path) -> None:
    def line(file: Path, *options: str) -> str:
        done = brickpilot("flash", "avr", str(file), *options, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        return done.stderr

    assert line(image) == (
        "brickpilot: --port: is missing: name the board's serial port here or in the environment as AVRPORT\n"
    )
    assert line(image, "--port", "/dev/no-such-port") == (
        "brickpilot: --port /dev/no-such-port: there is no such port: is the board plugged in?\n"
    )
    assert "none.hex: cannot be read: No such file" in line(tmp_path / "none.hex")
    text = tmp_path / "text.hex"
    text.write_text("hello\n")
    assert "text.hex: is no Intel HEX: " in line(text)
    damaged = tmp_path / "damaged.hex"
    damaged.write_text(image.read_text().replace(":10000000", ":10000100", 1))
    assert "damaged.hex: is no Intel HEX: " in line(damaged)
    large = IntelHex()
    large.puts(0, bytes(32300))
    large.write_hex_file(str(tmp_path / "large.hex"))
    assert line(tmp_path / "large.hex") == (
        f"brickpilot: {tmp_path / 'large.hex'}: needs 32300 bytes of flash; the atmega328p has 32256 beside its boot "
        "loader\n"
    )


def test_without_avrdude_the_line_says_what_to_install(
    image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert shutil.which("avrdude") is None
    with pytest.raises(InputError, match=r"avrdude: is missing: sudo apt-get install avrdude"):
        avr.flash(image, UNO, "COM3")
