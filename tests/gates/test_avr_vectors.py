"""Every module in tests/vectors, built by avr-gcc for simavr's ATmega2560, gives the same results as on the host.

Each module gets 5,000 vectors; with --full 50,000.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "tests/vectors"
MODULES = sorted(path.relative_to(VECTORS).with_suffix("").as_posix() for path in VECTORS.glob("*/*.c"))
PARTS = 16
FEW = "-DVECTORS_OF_PART=313"


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory, full: bool) -> Path:
    """Returns a folder with the programs of all modules, for the host and for the chip."""
    folder = tmp_path_factory.mktemp("vectors")
    for kind in ("host", "avr"):
        subprocess.run([VECTORS / "build", kind, folder / kind, *([] if full else [FEW])], check=True)
    return folder


def told(*command: str | Path) -> list[str]:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


@pytest.mark.parametrize("module", MODULES)
def test_a_module_gives_the_same_on_an_avr_chip(module: str, programs: Path) -> None:
    name = module.replace("/", "_")
    host = told(programs / "host" / name)
    assert len(set(host)) == PARTS, f"{module}: the vectors tell nothing new"
    assert told(programs / "avr/run", "atmega2560", programs / "avr" / name) == host
