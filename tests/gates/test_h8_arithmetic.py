"""The products of fix_h8.h, on the simulator of the RCX's processor."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = "/usr/h8300-hitachi-coff/lib/ldscripts/h8300.x"
FLAGS = ["-std=gnu99", "-Os", "-fno-builtin", "-fomit-frame-pointer", "-Wall", "-Wextra", "-Werror"]
INCLUDES = [f"-I{ROOT}/{folder}" for folder in ("hal/h8_include", "firmware")]


def status_of(fix: str, folder: Path) -> int:
    """What products.c returns, linked with this text of fix_h8.h."""
    (folder / "core").mkdir()
    (folder / "core/fix_h8.h").write_text(fix)
    for source in ("hal/h8sim/products.c", "firmware/core/fix.c"):
        made = folder / f"{Path(source).stem}.o"
        command = ["h8300-hms-gcc", *FLAGS, f"-I{folder}", *INCLUDES, "-c", str(ROOT / source), "-o", str(made)]
        subprocess.run(command, check=True)
    subprocess.run(["h8300-hms-as", "-o", folder / "start.o", ROOT / "hal/h8sim/start.s"], check=True)
    objects = [folder / f"{name}.o" for name in ("start", "products", "fix")]
    subprocess.run(["h8300-hms-ld", "-T", SCRIPT, "-relax", "-o", folder / "coff", *objects], check=True)
    subprocess.run(
        ["h8300-hms-objcopy", "-I", "coff-h8300", "-O", "srec", folder / "coff", folder / "srec"], check=True
    )
    simulator = subprocess.run([ROOT / "hal/h8sim/simulator"], stdout=subprocess.PIPE, text=True, check=True)
    return subprocess.run([simulator.stdout.strip(), folder / "srec"], stdin=subprocess.DEVNULL, check=False).returncode


@pytest.mark.parametrize(
    ("of", "to", "right"),
    [("", "", True), ("add.b #1,r0h", "add.b #0,r0h", False), ("sub.w r2,r0", "sub.w r3,r0", False)],
)
def test_products_are_exact_and_a_slip_is_caught(tmp_path: Path, of: str, to: str, right: bool) -> None:
    fix = (ROOT / "firmware/core/fix_h8.h").read_text()
    assert of in fix
    assert (status_of(fix.replace(of, to) if of else fix, tmp_path) == 0) == right
