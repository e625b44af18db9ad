"""The verdict depends on the vehicle, not on how its data are written: mirrored, in other units, thinned, reordered.

The tests rewrite one small data set of the planar engine, whose right motor is weaker than the left, in each way.
"""

from __future__ import annotations

import copy
import json
import re
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from brickpilot import catalogue, side_by_side
from brickpilot.data import reading
from brickpilot.data.signals import TURNS_WITH_FRAME
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding, verdict_json
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden import folder as hidden_folder
from hidden import manoeuvre
from hidden.recipe import Recipe

Table = dict[str, NDArray[np.float64]]

HIDDEN = {"motor_asymmetry": {"difference": 0.07}}
SAME, NEAR = 0.02, 0.05
"""Allowed relative change of a parameter: for the same data written differently, and for a part of the data."""

_SECONDS = 4.2
# The voltages step at even samples of 3 ms, so every second sample still shows the time of each step.
_RUNS = tuple(
    manoeuvre.steps(name, _SECONDS, (0.3, left, right), (3.0, 0.0, 0.0))
    for name, left, right in (
        ("ahead", 6.0, 6.0),
        ("back", -6.0, -6.0),
        ("spin_right", 3.3, -3.3),
        ("spin_left", -3.3, 3.3),
        ("curve_right", 7.0, 3.0),
        ("curve_left", 3.0, 7.0),
    )
)


@dataclass
class Log:
    """The files of a data set. `said`: dataset.toml; `tables`: run -> column -> (n,)."""

    said: dict[str, Any]
    tables: dict[str, Table]

    @classmethod
    def read(cls, folder: Path) -> Log:
        said = tomllib.loads((folder / "dataset.toml").read_text())
        tables = {}
        for run in said["runs"]:
            rows = np.genfromtxt(folder / run["file"], delimiter=",", names=True)
            tables[run["name"]] = {name: rows[name] for name in rows.dtype.names or ()}
        return cls(said, tables)

    def write(self, folder: Path) -> Path:
        folder.mkdir()
        (folder / "dataset.toml").write_text(tomlkit.dumps(self.said))
        for run in self.said["runs"]:
            table = self.tables[run["name"]]
            text = [",".join(f"{value:.9g}" for value in row) for row in zip(*table.values(), strict=True)]
            (folder / run["file"]).write_text("\n".join([",".join(table), *text]) + "\n")
        return folder

    def column(self, signal: str) -> str:
        return str(self.said["signals"][signal]["column"])

    def thinned(self, keep: Callable[[Table], NDArray[np.bool_]]) -> Log:
        rows = {name: keep(table) for name, table in self.tables.items()}
        return Log(self.said, {n: {c: v[rows[n]] for c, v in table.items()} for n, table in self.tables.items()})


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    recipe = Recipe("weaker-right", HIDDEN, engine="planar", runs=_RUNS, seed=3)
    return Log.read(hidden_folder.write(recipe, tmp_path_factory.mktemp("made")))


def found_in(log: Log, folder: Path, *, seed: int = 0, jobs: int = 2) -> Finding:
    return pipeline.discover(reading.read(log.write(folder)), seed=seed, jobs=jobs)


@pytest.fixture(scope="module")
def found(log: Log, tmp_path_factory: pytest.TempPathFactory) -> Finding:
    """Returns the finding with two jobs, even where xdist gives its worker one processor."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(side_by_side, "_processors", lambda: 2)
        return found_in(log, tmp_path_factory.mktemp("as_written") / "data")


def values_of(finding: Finding) -> dict[str, float]:
    return {f"{e.name}.{name}": one.value for e in finding.effects for name, one in e.parameters.items()}


def test_what_was_hidden_is_named(found: Finding) -> None:
    assert (found.verdict, [effect.name for effect in found.effects]) == ("named", list(HIDDEN))
    assert values_of(found)["motor_asymmetry.difference"] == pytest.approx(0.07, rel=SAME)


def mirrored(log: Log) -> Log:
    """Mirrors the data: left and right change places, turns and sideways signals change sign."""
    said, tables = copy.deepcopy(log.said), copy.deepcopy(log.tables)
    for table in tables.values():
        for left in [name for name in said["signals"] if name.endswith("_left")]:
            one, other = log.column(left), log.column(left.replace("_left", "_right"))
            table[one], table[other] = table[other], table[one]
        for signal in TURNS_WITH_FRAME & said["signals"].keys():
            table[log.column(signal)] *= -1
    return Log(said, tables)


def in_other_units(log: Log) -> Log:
    """Writes deg/s, rpm, mV, g and ms. The noise and the range of a signal have the signal's unit."""
    units = {
        "time": ("ms", 1e3),
        "voltage_left": ("mV", 1e3),
        "voltage_right": ("mV", 1e3),
        "accel_surge": ("g0", 1 / 9.80665),
        "accel_sway": ("g0", 1 / 9.80665),
        "yaw_rate": ("deg/s", 180 / np.pi),
        "wheel_speed_left": ("rpm", 30 / np.pi),
        "wheel_speed_right": ("rpm", 30 / np.pi),
    }
    said, tables = copy.deepcopy(log.said), copy.deepcopy(log.tables)
    for signal, (unit, factor) in units.items():
        entry = said["signals"][signal]
        entry["unit"] = unit
        entry.update({size: entry[size] * factor for size in ("noise_sd", "resolution") if size in entry})
        if "range" in entry:
            entry["range"] = [bound * factor for bound in entry["range"]]
        for table in tables.values():
            table[log.column(signal)] = table[log.column(signal)] * factor
    return Log(said, tables)


def in_the_other_frame(log: Log) -> Log:
    """Writes the same motion with other signs: y to the left, yaw counter-clockwise."""
    said, tables = copy.deepcopy(log.said), copy.deepcopy(log.tables)
    assert said["frame"] == "FRD"
    said["frame"] = "FLU"
    for table in tables.values():
        for signal in TURNS_WITH_FRAME & said["signals"].keys():
            table[log.column(signal)] *= -1
    return Log(said, tables)


def reordered(log: Log) -> Log:
    return Log({**log.said, "runs": list(reversed(log.said["runs"]))}, log.tables)


def in_another_form(log: Log) -> Log:
    return reordered(in_the_other_frame(in_other_units(log)))


def without_noise_sd(log: Log) -> Log:
    said = copy.deepcopy(log.said)
    for entry in said["signals"].values():
        entry.pop("noise_sd", None)
    return Log(said, log.tables)


def with_rows_lost(log: Log) -> Log:
    """Removes one row in five at random. Rows with a new command stay, as in a logger that records changes."""
    random = np.random.default_rng(5)

    def keep(table: Table) -> NDArray[np.bool_]:
        inputs = np.column_stack([table[log.column(name)] for name in ("voltage_left", "voltage_right")])
        news = np.append(True, np.any(np.diff(inputs, axis=0) != 0, axis=1))
        return np.asarray(news | (random.uniform(size=len(inputs)) > 0.2))

    return log.thinned(keep)


def with_jittered_samples(log: Log) -> Log:
    """Moves samples by up to 1.2 ms. Values between two old samples are interpolated."""
    random = np.random.default_rng(6)
    tables = {}
    for name, table in log.tables.items():
        clock = log.column("time")
        time = table[clock]
        moved = time + random.uniform(-1.2e-3, 1.2e-3, len(time))
        moved[0], held = time[0], [log.column(side) for side in ("voltage_left", "voltage_right")]
        steps = np.append(True, np.any([np.diff(table[one]) != 0 for one in held], axis=0))
        moved[steps] = time[steps]  # a command is logged when it is given
        tables[name] = {
            column: moved if column == clock else values if column in held else np.interp(moved, time, values)
            for column, values in table.items()
        }
    return Log(log.said, tables)


def with_uneven_samples(log: Log) -> Log:
    return with_rows_lost(with_jittered_samples(log))


def at_half_the_rate(log: Log) -> Log:
    return log.thinned(lambda table: np.arange(len(next(iter(table.values())))) % 2 == 0)


@pytest.mark.parametrize(
    ("change", "tolerance"),
    [
        (in_another_form, SAME),
        (without_noise_sd, SAME),
        (with_uneven_samples, NEAR),
        (at_half_the_rate, NEAR),
    ],
    ids=lambda one: one.__name__ if callable(one) else f"{one:.0%}",
)
def test_the_same_data_written_differently_give_the_same_verdict(
    change: Callable[[Log], Log], tolerance: float, log: Log, found: Finding, tmp_path: Path
) -> None:
    again = found_in(change(log), tmp_path / "data")
    assert again.verdict == found.verdict
    assert values_of(again) == pytest.approx(values_of(found), rel=tolerance)


def test_mirrored_data_give_the_mirrored_effect(log: Log, found: Finding, tmp_path: Path) -> None:
    again = found_in(mirrored(log), tmp_path / "data")
    odd = {f"{e.name}.{one.name}" for e in catalogue.effects() for one in e.parameters if one.odd}
    expected = {name: -value if name in odd else value for name, value in values_of(found).items()}
    assert expected != values_of(found)
    assert again.verdict == found.verdict
    assert values_of(again) == pytest.approx(expected, rel=SAME)


def test_another_seed_gives_the_same_verdict(log: Log, tmp_path: Path) -> None:
    """Without nominal values the fit starts at random. The seed changes this start, not the result."""
    said = copy.deepcopy(log.said)
    for name in ("wheel_inertia", "yaw_inertia", "viscous_friction"):
        del said["nominal"][name]
    fewer = Log(said, log.tables)
    first, second = (found_in(fewer, tmp_path / str(seed), seed=seed) for seed in (0, 20261))
    assert (first.seed, second.seed) == (0, 20261)
    assert first.verdict == second.verdict == "named"
    assert values_of(second) == pytest.approx(values_of(first), rel=SAME)


def test_the_same_data_and_seed_give_the_same_bytes_with_any_jobs(log: Log, found: Finding, tmp_path: Path) -> None:
    """`found` was made with two jobs, the other finding with one."""

    def text(finding: Finding) -> str:
        return re.sub(r'"elapsed_s": [0-9.]+', "", json.dumps(verdict_json(finding)))

    assert text(found_in(log, tmp_path / "data", jobs=1)) == text(found)
