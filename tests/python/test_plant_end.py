"""The example of a plant end flies with a brick; frames and queues are as hal/README.md describes them."""

from __future__ import annotations

import math
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from brickpilot.hil import ends
from brickpilot.link import links
from brickpilot.link.messages import book, dbc_path

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "tools/examples/plant_end.py"
ROUTE_MM = [(800, 0), (800, -800), (0, 0)]


@pytest.fixture
def device() -> Iterator[str]:
    process, address = ends.start_brick("--pty")
    try:
        yield address.removeprefix("serial:")
    finally:
        ends.end_brick(process)


def parts() -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLE))


def test_the_example_flies_its_route(device: str) -> None:
    done = subprocess.run(
        [sys.executable, EXAMPLE, device, dbc_path()], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("arrived at ")


def test_it_passes_every_waypoint_in_order_and_sees_a_refused_route(device: str) -> None:
    fly = parts()["fly"]
    arrived, track = fly(device, dbc_path().read_bytes(), ROUTE_MM)
    assert arrived
    rest = iter(track)
    for x, y in ROUTE_MM:
        assert any(math.hypot(at[0] - x / 1000, at[1] - y / 1000) < 0.2 for at in rest), (x, y)
    with pytest.raises(ValueError, match="the brick refuses"):
        fly(device, dbc_path().read_bytes(), [(32000, 0)])  # beyond 30 m
    with pytest.raises(ValueError, match="the brick refuses"):
        fly(device, b"another DBC", ROUTE_MM)


def crc16(data: bytes) -> int:
    """Returns the CRC-16/CCITT-FALSE of `data`, by the definition of this CRC."""
    value = 0xFFFF
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = (value << 1 ^ (0x1021 if value & 0x8000 else 0)) & 0xFFFF
    return value


def test_the_frame_in_the_readme_is_what_its_text_says() -> None:
    text = (ROOT / "hal/README.md").read_text()
    section = text[text.index("### The bytes of a frame") :]
    rows = dict(re.findall(r"^    (\w[\w, ]*?)  +((?:[0-9A-F]{2} ?)+)(?: .*)?$", section, re.MULTILINE))
    line = {name: bytes.fromhex(row) for name, row in rows.items()}
    assert list(line) == ["data", "id, size, data", "with CRC", "COBS", "frame"]
    layout = book().by_name["MODE_COMMAND"]
    start = book().choices("MODE_COMMAND", "command")["start"]
    check = crc16(layout.id.to_bytes(2, "little") + line["data"][:6])
    assert line["data"] == bytes([7, start, 0, 0, 0, 0]) + check.to_bytes(2, "little") == layout.seal(7, start)
    assert line["id, size, data"] == layout.id.to_bytes(2, "little") + bytes([8]) + line["data"]
    assert line["with CRC"] == line["id, size, data"] + crc16(line["id, size, data"]).to_bytes(2, "little")
    blocks = line["with CRC"].split(b"\0")
    assert line["COBS"] == b"".join(bytes([len(block) + 1]) + block for block in blocks)
    assert line["frame"] == line["COBS"] + b"\0" == links.encode_frame(layout.id, line["data"])
    assert parts()["framed"]((layout.id, line["data"])) == line["frame"]
    assert parts()["unframed"](line["COBS"]) == (layout.id, line["data"])


def test_the_queues_are_as_deep_as_the_readme_says() -> None:
    text = (ROOT / "hal/README.md").read_text()
    depths = {name: int(depth) for name, depth in re.findall(r"`(LINK_IN|LINK_OUT|SIL_LINK_SIZE)`, (\d+)", text)}
    headers = (ROOT / "hal/link/link.h").read_text() + (ROOT / "hal/sil/sil.h").read_text()
    assert depths == {
        name: int(depth) for name, depth in re.findall(r"(LINK_IN|LINK_OUT|SIL_LINK_SIZE) = (\d+)", headers)
    }
