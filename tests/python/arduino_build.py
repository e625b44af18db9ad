"""Builds a sketch with a library by the recipes of an installed Arduino core: platform.txt and boards.txt."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Mapping
from pathlib import Path

CORE = Path("/usr/share/arduino/hardware/arduino/avr")
"""Debian's package arduino-core-avr."""

DEBIAN = "-DDECIMAL_DIG=9"
"""A flag as in platform.local.txt: Debian's compiler lacks this constant of C++11, which the core's String uses."""

IDE_VERSION = "10819"


def _properties(path: Path) -> dict[str, str]:
    lines = (line.strip() for line in path.read_text().splitlines())
    return dict(line.split("=", 1) for line in lines if "=" in line and not line.startswith("#"))


def _expanded(text: str, known: Mapping[str, str]) -> str:
    while (found := re.sub(r"\{([\w.]+)\}", lambda name: known.get(name[1], name[0]), text)) != text:
        text = found
    return text


def build(library: Path, sketch: Path, folder: Path, *, board: str = "uno") -> tuple[Path, Path]:
    """Returns the ELF and HEX of a sketch with one library, in `folder`.

    Raises:
        subprocess.CalledProcessError: a recipe fails.
    """
    platform, boards = _properties(CORE / "platform.txt"), _properties(CORE / "boards.txt")
    known = platform | {name.split(".", 1)[1]: value for name, value in boards.items() if name.startswith(f"{board}.")}
    known["compiler.cpp.extra_flags"] = DEBIAN
    known |= {"runtime.ide.version": IDE_VERSION, "build.arch": "AVR", "build.path": str(folder)}
    known |= {"build.project_name": sketch.stem, "archive_file": "core.a", "archive_file_path": str(folder / "core.a")}
    searched = [CORE / "cores" / known["build.core"], CORE / "variants" / known["build.variant"], library / "src"]
    known["includes"] = " ".join(f'"-I{path}"' for path in searched)

    def run(recipe: str, **more: object) -> None:
        command = _expanded(
            platform[f"recipe.{recipe}.pattern"], known | {name: str(one) for name, one in more.items()}
        )
        subprocess.run(shlex.split(command), check=True, cwd=folder, capture_output=True)

    def compiled(source: Path, into: str) -> Path:
        made = folder / f"{into}-{'_'.join(source.parts[-3:])}.o"
        ends = {".c": "c", ".cpp": "cpp", ".S": "S"}
        run(f"{ends[source.suffix]}.o", source_file=source, object_file=made)
        return made

    folder.mkdir(parents=True)
    program = folder / f"{sketch.stem}.ino.cpp"
    program.write_text(f'#include <Arduino.h>\n#line 1 "{sketch}"\n{sketch.read_text()}')
    objects = [compiled(program, "sketch")]
    objects += [compiled(path, "library") for path in sorted((library / "src").rglob("*.c"))]
    for path in sorted(path for path in searched[0].rglob("*") if path.suffix in (".c", ".cpp", ".S")):
        run("ar", object_file=compiled(path, "core"))
    run("c.combine", object_files=" ".join(f'"{one}"' for one in objects))
    run("objcopy.hex")
    return folder / f"{sketch.stem}.elf", folder / f"{sketch.stem}.hex"
