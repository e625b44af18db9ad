"""With very many samples, `compare` fits the nominal values to some of the runs only, and tells the user so."""

from __future__ import annotations

import brickpilot as bp
import numpy as np
import pandas as pd
import pytest
from brickpilot.data import holdout
from brickpilot.data.holdout import enough_to_fit
from brickpilot.discover.deadline import Span
from brickpilot.readiness import data_check

VOLTS = (3.0, 4.0, 5.0, 6.0, 7.0, -3.0, -4.0, -5.0, -6.0, -7.0)
KNOWN = {"resistance": 20.0, "torque_constant": 0.3, "emf_constant": 0.3, "inductance": 0.0, "wheel_inertia": 7.5e-4}


def steps() -> bp.Dataset:
    """Returns ten step responses of a motor in closed form, with 100 samples each and pauses of 2 s."""
    time = np.arange(100) * 0.01
    frames = {
        f"step_{volts:g}": pd.DataFrame(
            {
                "time": time,
                "voltage": np.where(time >= 0.195, volts, 0.0),
                "speed": 3 * volts * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15)),
            }
        )
        for volts in VOLTS
    }
    return bp.Dataset.from_frames(frames, vehicle="motor", nominal=KNOWN, gap_s=2.0)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(holdout, "MANY", 300)
    monkeypatch.setattr(holdout, "ENOUGH", 300)


def test_each_direction_and_the_largest_input_stay_and_runs_keep_their_age(few: None) -> None:
    dataset = steps()
    some, note = enough_to_fit(dataset)
    assert [run.name for run in some.runs] == ["step_3", "step_7", "step_-3", "step_-7"]
    assert note is not None
    assert "fitted to 4 of 8 fit runs, 400 samples" in note
    ages = np.cumsum([run.gap_s for run in some.runs]) + np.arange(4) * 0.99
    assert ages == pytest.approx([2.0 + 2.99 * place for place in (0, 4, 5, 9)])
    assert {run.role for run in some.runs} == {"fit"}


def test_few_samples_are_all_fitted() -> None:
    dataset = steps()
    assert enough_to_fit(dataset) == (dataset, None)


def test_compare_fits_some_runs_shows_all_and_says_so(few: None) -> None:
    dataset = steps()
    found = bp.compare(dataset)
    assert found.model.parameters == bp.calibrate(enough_to_fit(dataset)[0]).model.parameters
    assert found.model.parameters["viscous_friction"] == pytest.approx(5e-4, rel=1e-3)
    assert len(found.runs) == 10
    assert sum("fitted to 4 of 8 fit runs" in note for note in found.notes) == 1
    assert sum("held out" in note for note in found.notes) == 1


@pytest.mark.usefixtures("few")
def test_check_fits_some_runs_and_reports_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    dataset = steps()
    some = bp.check(dataset, jobs=1)
    assert [one.name for one in some.runs] == [run.name for run in dataset.runs]
    assert sum("fit runs" in note and "of these runs" in note for note in some.notes) == 1
    monkeypatch.setattr(holdout, "MANY", 1000)
    full = bp.check(dataset, jobs=1)
    assert not any("of these runs" in note for note in full.notes)
    assert [one.role for one in some.runs] == [one.role for one in full.runs]
    assert some.explained.parts.keys() == full.explained.parts.keys()


@pytest.mark.usefixtures("few")
def test_the_time_of_a_discovery_is_that_of_all_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def estimated(*_: object, times: float) -> Span:
        asked.append(times)
        return Span(1.0, 2.0)

    monkeypatch.setattr(data_check, "estimate", estimated)
    bp.check(steps(), jobs=1)
    assert len(asked) == 1
    assert 2 < asked[0] < 1000 / 300 + 0.01
