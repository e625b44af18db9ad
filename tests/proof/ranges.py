"""Makes the ranges that the proofs assume: those that comments on fields of the firmware's headers state, as LOW..HIGH.

The ranges of settings are not made here: contracts.h takes them from firmware/app/settings_gen.h, as parameters.c does.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEADERS = (
    "core/signals.h", "control/pid.h", "estimator/heading.h", "estimator/speed.h", "estimator/friction.h",
    "monitor/monitor.h", "mixer/mixer.h", "mixer/drive.h", "autopilot/route.h", "model/scale.h", "app/loop.h",
)  # fmt: skip
_STRUCT = re.compile(r"typedef struct(?: \w+)? \{\n(.*?)\n\} (\w+);", re.DOTALL)
_FIELD = re.compile(r"^ {4}[a-z]\w*\s+(\w+);\s*/\*(.*?)\*/", re.MULTILINE | re.DOTALL)
_RANGE = re.compile(r"(?<![\w.^-])(-?\d+)\.\.(\d+)(?![\w^])")


def ranges(text: str) -> dict[str, tuple[int, int]]:
    """Returns struct.field -> (least, most) of a header's text."""
    found: dict[str, tuple[int, int]] = {}
    for body, struct in _STRUCT.findall(text):
        for field, comment in _FIELD.findall(body):
            match = _RANGE.search(comment)
            if match:
                found[f"{struct}_{field}"] = int(match[1]), int(match[2])
    return found


def header() -> str:
    """Returns the text of ranges_gen.h."""
    lines = ["/* The ranges that the comments of firmware/ state: made by tests/proof/ranges.py. */"]
    for name in HEADERS:
        for place, (low, high) in ranges((ROOT / "firmware" / name).read_text(encoding="utf-8")).items():
            lines += [f"#define LEAST_{place} ({low}L)", f"#define MOST_{place} ({high}L)"]
    return "\n".join(lines) + "\n"
