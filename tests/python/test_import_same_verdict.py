"""The log of one machine gives the same data set and the same verdict, whichever program wrote it."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import other_logs as logs
import pytest
import synthetic
from command import brickpilot
from numpy.typing import NDArray

Table = Mapping[str, NDArray[np.float64]]
MANOEUVRES = {"low": (2.0, 0.0), "back": (-3.0, 0.0), "high": (6.0, 0.0)}
NOMINAL = ("resistance", "torque_constant", "emf_constant", "wheel_inertia")


def write_csv(path: Path, table: Table) -> Path:
    rows = zip(*(map(repr, column.tolist()) for column in table.values()), strict=True)
    path.write_text("\n".join([",".join(table), *(",".join(row) for row in rows)]) + "\n", encoding="utf-8")
    return path


def write_mcap(path: Path, table: Table) -> Path:
    messages: list[tuple[int, str, str, dict[str, Any]]] = []
    for time, volts, speed in zip(*table.values(), strict=True):
        stamp = round(time * 1e9) + 10**18
        messages.append((stamp, "/motor/volts", "std_msgs/msg/Float64", {"data": volts}))
        joint = logs.joints(stamp, {"wheel": 0.0}, {"wheel": speed})
        messages.append((stamp + 1_700_000, "/joint_states", "sensor_msgs/msg/JointState", joint))
    return logs.write_mcap(path, messages)


def write_wpilog(path: Path, table: Table) -> Path:
    time, volts, speed = table.values()
    changed = np.flatnonzero(np.diff(volts, prepend=np.nan))  # WPILib writes an entry when its value changes
    entries = {
        "/motor/volts": ("double", time[changed], volts[changed]),
        "/motor/speed": ("double", time, speed),
    }
    return logs.write_wpilog(path, entries)


WRITERS: dict[str, tuple[Callable[[Path, Table], Path], list[str]]] = {
    "csv": (write_csv, ["--header", "--map", "time=t", "--map", "voltage=volts", "--map", "speed=speed"]),
    "mcap": (write_mcap, ["--map", "voltage=/motor/volts.data", "--map", "speed=/joint_states.velocity[wheel]"]),
    "wpilog": (write_wpilog, ["--map", "voltage=/motor/volts", "--map", "speed=/motor/speed"]),
    "parquet": (logs.write_parquet, ["--map", "time=t", "--map", "voltage=volts", "--map", "speed=speed"]),
}


def tables(folder: Path) -> dict[str, Table]:
    """Returns run -> table, of a motor with dry friction. Times begin at 1 s: a WPILOG cannot hold the time 0."""
    truth = synthetic.motor(wheel_inertia=1e-3)
    dry = dataclasses.replace(truth, effects={"coulomb_friction": {"torque": 0.02}})
    synthetic.write(folder, dry, {"speed": 0.02}, "", manoeuvres=MANOEUVRES)
    made = {}
    for run in MANOEUVRES:
        rows = list(csv.DictReader((folder / f"{run}.csv").open(encoding="utf-8")))
        column = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
        made[run] = {"t": np.round(1.0 + column["t"], 6), "volts": column["voltage"], "speed": column["speed"]}
    return made


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Returns a folder with the same runs as logs of each kind, and the data sets that the CLI imports from these."""
    place = tmp_path_factory.mktemp("logs")
    known = [
        word
        for name in NOMINAL
        for word in ("--nominal", f"{name}={synthetic.motor(wheel_inertia=1e-3).parameters[name]}")
    ]
    made = tables(place / "truth")
    for ending, (write, options) in WRITERS.items():
        files = [write(place / f"{run}.{ending}", table).name for run, table in made.items()]
        words = ("--vehicle", "motor", *options, *known, "--out", f"from_{ending}")
        done = brickpilot("import", *files, *words, cwd=place)
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return place


def test_the_tables_agree_to_the_digit(folder: Path) -> None:
    for run in MANOEUVRES:
        first = np.loadtxt(folder / f"from_csv/{run}.csv", delimiter=",", skiprows=1)
        for ending in WRITERS:
            rows = np.loadtxt(folder / f"from_{ending}/{run}.csv", delimiter=",", skiprows=1)
            np.testing.assert_array_equal(rows[:, 1:], first[:, 1:], err_msg=f"{ending} {run}")
            clock = rows[:, 0] - rows[0, 0], first[:, 0] - first[0, 0]
            np.testing.assert_allclose(*clock, rtol=0, atol=1e-9, err_msg=f"{ending} {run}")


def test_the_verdict_is_the_same(folder: Path) -> None:
    """Two kinds of logs are enough: the tables of the other kinds have the same digits."""
    verdicts = {}
    for ending in ("csv", "mcap"):
        done = brickpilot("discover", f"from_{ending}", "--out", f"found_{ending}", "--jobs", "1", cwd=folder)
        assert done.returncode == 0, done.stderr
        verdict = json.loads((folder / f"found_{ending}/verdict.json").read_text())
        names = [(one["name"], [other["name"] for other in one["equivalents"]]) for one in verdict["effects"]]
        verdicts[ending] = (verdict["verdict"], names)
    assert verdicts["csv"][0] in ("named", "ambiguous")  # with two constant voltages a dead band looks nearly the same
    assert [name for name, _ in verdicts["csv"][1]] == ["coulomb_friction"]
    assert all(verdict == verdicts["csv"] for verdict in verdicts.values()), verdicts
