"""The firmware as a library: a folder that the Arduino IDE, arduino-cli and PlatformIO take as it is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

from brickpilot.firmware import sources

NAME = "Brickpilot"
ENTRY = "brickpilot_run"
_SENTENCE = "An autopilot for a two-wheeled robot, with the constants of one robot"
_PARAGRAPH = "Gyro with accelerometers or rotation sensors, two motors on an H-bridge, and a serial link to a host"

_HEADER = f"""/* {NAME}.h: the autopilot. src/avr/board.h has the wiring. It takes timers 1 and 2, the converter,
 * serial port 0, the pin-change interrupts and the watchdog; a sketch may use none of them. */
#ifndef BRICKPILOT_H
#define BRICKPILOT_H

#ifdef __cplusplus
extern "C" {{
#endif

/* Starts the drivers and flies the route of src/app/mission.h after two seconds at rest. It never returns. */
int {ENTRY}(void);

#ifdef __cplusplus
}}
#endif

#endif
"""

_SKETCH = f"""// Flies the robot's route two seconds after power-on, and obeys a host on the serial port.
#include <{NAME}.h>

void setup() {{
  {ENTRY}();
}}

void loop() {{
}}
"""


def write(root: Path, headers: Path, flags: Sequence[str], folder: Path) -> None:
    """Writes the library into `folder`; the arguments are those of `sources.write`."""
    version = metadata.version("brickpilot")
    sources.write(root, headers, [*flags, f"-D{sources.LIBRARY}"], "avr", folder / "src", entry=ENTRY)
    example = folder / "examples" / "Mission" / "Mission.ino"
    example.parent.mkdir(parents=True)
    texts = {
        folder / "src" / f"{NAME}.h": _HEADER,
        example: _SKETCH,
        folder / "library.properties": _properties(version),
        folder / "library.json": _manifest(version),
        folder / "LICENSE": (root / "LICENSE").read_text(encoding="utf-8"),
        folder / "keywords.txt": f"{NAME}\tKEYWORD1\n{ENTRY}\tKEYWORD2\n",
    }
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")


def _properties(version: str) -> str:
    """Returns library.properties, by Arduino's library specification."""
    rows = {
        "name": NAME, "version": version, "author": f"{NAME} maintainers", "maintainer": f"{NAME} maintainers",
        "sentence": f"{_SENTENCE}.", "paragraph": f"{_PARAGRAPH}.", "category": "Device Control",
        "url": "", "architectures": "avr", "includes": f"{NAME}.h",
    }  # fmt: skip
    return "".join(f"{name}={value}\n" for name, value in rows.items())


def _manifest(version: str) -> str:
    """Returns library.json, by PlatformIO's."""
    rows = {
        "name": NAME,
        "version": version,
        "description": f"{_SENTENCE}. {_PARAGRAPH}.",
        "keywords": "robot, autopilot, differential drive",
        "license": "MIT",
        "frameworks": "arduino",
        "platforms": "atmelavr",
        "headers": f"{NAME}.h",
        "examples": [{"name": "Mission", "base": "examples/Mission", "files": ["Mission.ino"]}],
    }
    return json.dumps(rows, indent=2) + "\n"
