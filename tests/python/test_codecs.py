"""The brick's codecs of all messages, which use tables, agree with the host's codecs, which cantools generates."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path
from typing import Any

import cantools
import pytest
from cffi import FFI

ROOT = Path(__file__).resolve().parents[2]
DATABASE: Any = cantools.database.load_file(ROOT / "hal/wire/brickpilot.dbc")
NAMES = [message.name for message in DATABASE.messages]
ROUNDS = 2000


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Any:
    library = tmp_path_factory.mktemp("codecs") / "codecs.so"
    sources = [ROOT / "hal/wire/codecs_gen.c", ROOT / "tests/unit/link/host_codecs_gen.c"]
    subprocess.run(["cc", "-shared", "-fPIC", f"-I{ROOT}/hal", "-o", library, *map(str, sources)], check=True)
    ffi = FFI()
    ffi.cdef(
        "".join(
            f"int wire_{name.lower()}_{way}(void *, const void *, size_t);"
            for name in NAMES
            for way in ("pack", "unpack")
        )
    )
    return ffi, ffi.dlopen(str(library))


def _bytes(generator: random.Random, count: int) -> bytes:
    return bytes(generator.choice((0, 255, generator.randrange(256))) for _ in range(count))


@pytest.mark.parametrize("name", NAMES)
def test_both_halves_agree(both: Any, name: str) -> None:
    ffi, library = both
    pack, unpack = (getattr(library, f"wire_{name.lower()}_{way}") for way in ("pack", "unpack"))
    message = DATABASE.get_message_by_name(name)
    used = sum(((1 << signal.length) - 1) << signal.start for signal in message.signals).to_bytes(8, "little")
    generator = random.Random(name)
    for _ in range(ROUNDS):
        data, fields, again = ffi.new("uint8_t[8]", _bytes(generator, 8)), ffi.new("uint32_t[8]"), ffi.new("uint8_t[8]")
        assert unpack(fields, data, 8) == 0
        assert pack(again, fields, 8) == 8
        assert bytes(again) == bytes(byte & mask for byte, mask in zip(data, used, strict=True))
    assert pack(again, fields, 7) < 0
    assert unpack(fields, data, 7) < 0
