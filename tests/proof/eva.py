"""Checks the whole control loop by Frama-C's Eva, beside CBMC, for an int of 16 bits.

Eva computes the intervals of all values through `SOURCES` at once; CBMC proves one module at a time. A fault that Eva
cannot exclude is an alarm. Each alarm has to stand in eva.toml with the proof that excludes it, and Eva has to raise
each alarm of eva.toml. Then Eva reads a copy with a mutant, and has to raise one more alarm.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

from prove import HERE, ROOT, table

SOURCES = (
    "firmware/app/loop.c", "firmware/app/parameters.c", "firmware/app/step.c", "firmware/app/telemetry.c",
    "firmware/autopilot/*.c", "firmware/control/*.c", "firmware/core/*.c", "firmware/estimator/*.c",
    "firmware/mixer/*.c", "firmware/model/*.c", "firmware/monitor/*.c", "hal/wire/codecs_gen.c", "hal/wire/crc.c",
    "hal/wire/message.c",
)  # fmt: skip
DEFINED = ("STEP_MS=3", "SENSORS_POSSIBLE=31", "BODY_WITHOUT_PAPER")
PLANT = (
    "firmware/control/pid.c",
    "fix_add32(state->integral_mv_q16, change_mv_q16)",
    "state->integral_mv_q16 + change_mv_q16",
)
"""File, old text and new text of the mutant: the sum of a PID's integral may overflow."""

_ALARM = re.compile(r"\[eva:alarm\] (\S+):(\d+): Warning")

Alarm = tuple[str, str]
"""A source file, and the text of the line."""


def alarms(root: Path) -> set[Alarm]:
    """Returns the alarms of the sources below `root`."""
    headers = " ".join(f"-I{root / folder}" for folder in ("firmware", "hal", "hal/include"))
    defined = " ".join(f"-D{one}" for one in DEFINED)
    sources = sorted(str(one) for pattern in SOURCES for one in root.glob(pattern))
    call = [
        "frama-c", "-machdep", "gcc_x86_16", f"-cpp-extra-args={defined} {headers}", HERE / "harness/eva.c", *sources,
        "-eva", "-eva-precision", "0", "-eva-slevel-function", "bytes_copy:400,bytes_clear:400",
        "-eva-remove-redundant-alarms", "-warn-signed-overflow", "-eva-msg-key=-final-states,-initial-state",
    ]  # fmt: skip
    done = subprocess.run(call, cwd=root, capture_output=True, text=True, check=False)
    if done.returncode != 0 or "ANALYSIS SUMMARY" not in done.stdout:
        raise SystemExit(f"Eva did not finish: {done.stdout[-500:]}{done.stderr}")
    found = set()
    for path, line in _ALARM.findall(done.stdout):
        source = root / path
        text = source.read_text(encoding="utf-8").splitlines()[int(line) - 1].strip()
        found.add((str(source.relative_to(root)), text))
    return found


def excluded() -> dict[Alarm, str]:
    """Returns alarm -> proof from eva.toml. Each proof has to include the source file of its alarm."""
    rows, proofs = tomllib.loads((HERE / "eva.toml").read_text(encoding="utf-8")), table("proofs.toml")
    found = {}
    for source, row in rows.items():
        for line, proof in row.items():
            harness = (HERE / "harness" / f"{proofs[proof]['file']}.c").read_text(encoding="utf-8")
            if source not in proofs[proof]["with"] and source.removeprefix("firmware/") not in harness:
                raise SystemExit(f"tests/proof/eva.toml: {proof} does not take in {source}")
            found[source, line] = proof
    return found


def planted() -> set[Alarm]:
    """Returns the alarms of a copy of the sources with the mutant."""
    source, old, new = PLANT
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for one in ("firmware", "hal"):
            shutil.copytree(ROOT / one, root / one, ignore=shutil.ignore_patterns("*.svg", "README.md"))
        text = (root / source).read_text(encoding="utf-8")
        assert text.count(old) == 1, f"{source} has {text.count(old)} times: {old}"
        (root / source).write_text(text.replace(old, new), encoding="utf-8")
        return alarms(root)


def main() -> int:
    began = time.monotonic()
    found, known = alarms(ROOT), excluded()
    seconds = time.monotonic() - began
    for source, line in sorted(found - set(known)):
        print(f"{source}: no proof in eva.toml excludes an alarm of Eva: {line}")
    for source, line in sorted(set(known) - found):
        print(f"tests/proof/eva.toml: Eva raises no alarm in {source}: {line}")
    missed = not planted() - found
    if missed:
        print(f"Eva does not see the fault that is planted in {PLANT[0]}")
    failed = len(found ^ set(known)) + missed
    passed = len(found & set(known)) + (not missed)
    print(f"Eva: {len(found)} lines with an alarm, {seconds:.0f} s; {passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
