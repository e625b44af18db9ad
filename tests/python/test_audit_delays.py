"""A wheel velocity that lags behind the derivative of its travel is reported, but none of its samples is left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read

Table = dict[str, np.ndarray]

NOISE = {
    "wheel_travel_left": 0.0002, "wheel_travel_right": 0.0002,
    "wheel_velocity_left": 0.005, "wheel_velocity_right": 0.005,
}  # fmt: skip
RUNS = {"ahead": (6.0, 6.0), "back": (-5.0, -5.0), "curve": (6.0, 3.0)}
RATES = ("wheel_velocity_left", "wheel_velocity_right")


def written(folder: Path, behind: dict[str, float], *, filtered: bool = False) -> Dataset:
    """Writes runs with delayed signals and returns the data set.

    Args:
        behind: signal -> its delay, s.
        filtered: whether the signal is averaged over twice the delay; else it is shifted by the delay.
    """

    def spoil(_: str, table: Table) -> None:
        for name, seconds in behind.items():
            rows = round(seconds / 0.01)
            if filtered:
                path = np.concatenate([np.zeros(2 * rows), np.cumsum(table[name])])
                table[name] = (path[2 * rows :] - path[: -2 * rows]) / (2 * rows)
            else:
                table[name] = np.interp(table["t"] - seconds, table["t"], table[name])

    return read(synthetic.write(folder, synthetic.robot(), NOISE, "mass = 0.6", manoeuvres=RUNS, spoil=spoil))


def timing(data: Dataset) -> list[str]:
    return [note for note in data.notes if note.startswith("timing:")]


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("seconds", [0.03, 0.05, 0.1])
def test_a_delay_of_a_rate_is_told_with_its_size(seconds: float, filtered: bool, tmp_path: Path) -> None:
    data = written(tmp_path / "s", dict.fromkeys(RATES, seconds), filtered=filtered)
    assert data.faults == ()
    (note,) = timing(data)
    for name in RATES:
        told = float(note.split(f"{name} by ")[1].split()[0])
        assert told == pytest.approx(1e3 * seconds, abs=8.0)
    assert "behind the derivative" in note
    assert all(np.isfinite(run.outputs[name]).all() for run in data.runs for name in RATES)


def test_only_the_channel_that_is_late_is_told(tmp_path: Path) -> None:
    (note,) = timing(written(tmp_path / "s", {RATES[0]: 0.06}))
    assert RATES[0] in note
    assert RATES[1] not in note


def test_a_rate_that_is_in_time_is_not_told(tmp_path: Path) -> None:
    assert timing(written(tmp_path / "s", {})) == []
