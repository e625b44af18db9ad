"""The firmware's sources as one folder that needs no checkout: for a board of one's own, and as an Arduino library.

`src/` is the only include path. It holds the firmware's folders, hal.h, wire/ and the port; every .c file begins with
brickpilot_build.h, which has the build constants, since an Arduino library cannot give flags to the compiler.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path

BUILD = "brickpilot_build.h"
LIBRARY = "BRICKPILOT_LIBRARY"
"""Defined where another program has the fuses: boot loaders of Arduinos cannot write them."""

HOSTS_ONLY = ("body_pose.c", "pid_start.c")
_WIRE = ("crc", "frame", "message")


def write(root: Path, headers: Path, flags: Sequence[str], port: str, folder: Path, *, entry: str = "main") -> None:
    """Writes the sources into `folder`.

    Args:
        root: the checkout.
        headers: those that take the place of the project's.
        flags: the compiler's; those that define a constant are kept.
        port: folder in hal/ and in firmware/targets/, which holds the main program.
        entry: what main() of that program is called.
    """
    for path in sorted((root / "firmware").rglob("*.[ch]")):
        inside = path.relative_to(root / "firmware")
        if not {"targets", "h8"} & set(inside.parts) and path.name not in HOSTS_ONLY:
            _copy(path, folder / inside)
    _copy(root / "hal/include/hal.h", folder / "hal.h")
    kept = [root / f"hal/wire/{name}.{end}" for name in _WIRE for end in "ch"] + [root / "hal/wire/codecs_gen.h"]
    for path in kept:
        _copy(path, folder / "wire" / path.name)
    for path in (root / "hal" / port).glob("*.[ch]"):
        _copy(path, folder / port / path.name)
    for path in (root / "firmware/targets" / port).glob("*.[ch]"):
        _copy(path, folder / path.name)
    program = folder / "main.c"
    program.write_text(re.sub(r"^int main\(", f"int {entry}(", program.read_text(encoding="utf-8"), flags=re.MULTILINE))
    for path in headers.rglob("*.h"):
        _copy(path, folder / path.relative_to(headers))
    (folder / BUILD).write_text(_constants(flags), encoding="utf-8")


def _copy(path: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".c":
        to.write_text(f'#include "{BUILD}"\n{path.read_text(encoding="utf-8")}', encoding="utf-8")
    else:
        shutil.copyfile(path, to)


def _constants(flags: Iterable[str]) -> str:
    defined = [re.fullmatch(r"-D(\w+)(?:=(.*))?", flag) for flag in flags]
    lines = [f"#define {found[1]} {found[2] or 1}\n" for found in defined if found]
    return f"""/* {BUILD}: the constants of this build. */
#ifndef BRICKPILOT_BUILD_H
#define BRICKPILOT_BUILD_H

{"".join(lines)}
#ifdef __AVR__ /* core/flash.h says why */
#pragma GCC optimize("no-ivopts")
#endif

#endif
"""
