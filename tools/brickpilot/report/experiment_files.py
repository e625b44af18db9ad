"""The next experiment as files: a scenario for `run`, a table, and an array for the program of a robot."""

from __future__ import annotations

import numpy as np
import tomlkit

from brickpilot.report.template import render_plain
from brickpilot.vehicle.manoeuvres import Manoeuvre, commands

SCENARIO, TABLE, ARRAY = (f"next_experiment.{ending}" for ending in ("toml", "csv", "h"))

FILES = {
    SCENARIO: "the next experiment for brickpilot run",
    TABLE: "the next experiment as a table: the start of each step and its voltages",
    ARRAY: "the next experiment as a C array",
}
"""Each file that `files_of` may write, and its purpose."""

_RAMP_STEP_S = 0.05  # s: length of the steps that replace a ramp
_HIGHEST_V = 20.0  # V: highest voltage that a scenario allows

Step = tuple[float, float, float]


def files_of(manoeuvre: Manoeuvre, vehicle: str) -> dict[str, str]:
    """Returns file -> text. There is no scenario for a motor, or if a voltage exceeds 20 V."""
    found = steps(manoeuvre)
    sides = ("voltage",) if vehicle == "motor" else ("voltage_left", "voltage_right")
    texts = {TABLE: _table(found, sides), ARRAY: _array(manoeuvre, found, sides)}
    highest = max(abs(volts) for _, *both in found for volts in both)
    if vehicle != "motor" and highest <= _HIGHEST_V:
        texts[SCENARIO] = _scenario(manoeuvre, found)
    return texts


def steps(manoeuvre: Manoeuvre) -> list[Step]:
    """Returns a list of (start in s, V left, V right); steps replace a ramp, each with the ramp's mean voltage."""
    points = {round(at, 6) for side in (manoeuvre.voltage_left, manoeuvre.voltage_right) for at, _ in side}
    grid = np.arange(0.0, manoeuvre.duration_s, _RAMP_STEP_S).round(6)
    starts = np.array(sorted({0.0, *points, *grid.tolist()} - {round(manoeuvre.duration_s, 6)}))
    ends = np.append(starts[1:], manoeuvre.duration_s)
    found: list[Step] = []
    for start, (left, right) in zip(starts, commands(manoeuvre, (starts + ends) / 2), strict=True):
        one = (float(start), round(float(left), 4), round(float(right), 4))
        if not found or one[1:] != found[-1][1:]:
            found.append(one)
    return found


def _scenario(manoeuvre: Manoeuvre, found: list[Step]) -> str:
    document = tomlkit.document()
    document.add(
        tomlkit.comment("The next experiment, made by brickpilot discover: brickpilot run next_experiment.toml")
    )
    document["name"], document["title"] = "next_experiment", manoeuvre.name
    document["kind"], document["duration_s"] = "manoeuvre", manoeuvre.duration_s
    segments = tomlkit.array().multiline(True)
    for start, left, right in found:
        entry = tomlkit.inline_table()
        entry.update({"from_s": start, "left_V": left, "right_V": right})
        segments.append(entry)
    document["segments"] = segments
    return tomlkit.dumps(document)


def _table(found: list[Step], sides: tuple[str, ...]) -> str:
    lines = [("from_s", *sides), *((start, *volts[: len(sides)]) for start, *volts in found)]
    return "".join(f"{','.join(map(str, line))}\n" for line in lines)


def _array(manoeuvre: Manoeuvre, found: list[Step], sides: tuple[str, ...]) -> str:
    ended = [*found, (manoeuvre.duration_s, 0.0, 0.0)]
    rows = [
        (round(1000 * start), ", ".join(str(round(1000 * one)) for one in volts[: len(sides)]))
        for start, *volts in ended
    ]
    fields = ", ".join(side.replace("voltage", "mv") for side in sides)
    return render_plain("next_experiment.h", title=manoeuvre.name, rows=rows, fields=fields)
