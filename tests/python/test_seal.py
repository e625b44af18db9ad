"""No held-out value reaches a stage before the last choice, and the seal is opened once."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brickpilot.data import reading
from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.motion import run_of
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding, verdict_json
from brickpilot.discover.prepare import Prepared, calibrate, prepare, prepare_windows
from brickpilot.discover.seal import Sealed, SealError, prove
from brickpilot.vehicle import model as model_file
from scipy.sparse import issparse
from synthetic import motor, robot, write

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
MOVES = {
    "ahead": (4.0, 4.0), "back": (-5.0, -5.0), "spin": (4.0, -4.0), "curve": (6.0, 3.0), "again": (5.0, 5.0),
}  # fmt: skip
ROLES = ["fit"] * 4 + ["held_out"]
STATED = "\n".join(
    f"{name} = {{ value = {robot().parameters[name]}, sd = {robot().parameters[name] * 0.02} }}"
    for name in ("mass", "yaw_inertia", "wheel_radius", "half_track", "resistance", "torque_constant", "emf_constant")
)
TRUTH = dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": 0.006}})


def runs_held_out(folder: Path) -> Dataset:
    return reading.read(write(folder, TRUTH, NOISE, STATED, manoeuvres=MOVES, roles=ROLES))


def stretches_held_out(folder: Path) -> Dataset:
    """Returns a data set without roles: each manoeuvre occurs once, so the last part of its drive is held out."""
    return reading.read(write(folder, TRUTH, NOISE, STATED, manoeuvres=MOVES, roles=[""] * 5))


def motor_held_out(folder: Path) -> Dataset:
    truth = dataclasses.replace(motor(battery_voltage=9.0), effects={"coulomb_friction": {"torque": 0.004}})
    volts = {"low": (3.0, 0.0), "high": (6.0, 0.0), "back": (-5.0, 0.0), "other": (4.0, 0.0)}
    options = {"manoeuvres": volts, "roles": ["fit", "fit", "fit", "held_out"]}
    return reading.read(write(folder, truth, {"angle": 0.002}, "resistance = 20.0", **options))


KINDS = [runs_held_out, stretches_held_out, motor_held_out]


def held_out_rows(run: Run, prepared: Prepared) -> np.ndarray:
    """Returns (n,): whether each sample of a run is held out."""
    if prepared.roles.by_run[run_of(run.name)] == "held_out":
        return np.ones(len(run.time), dtype=bool)
    first, last = prepared.roles.stretches.get(run_of(run.name), (np.inf, -np.inf))
    return (run.time >= first) & (run.time <= last)


def wild(data: Dataset, prepared: Prepared, *, seed: int) -> Dataset:
    """Returns the data set with other held-out measured values: 1.5 times as large, and noisy."""
    random, runs = np.random.default_rng(seed), []
    for run in data.runs:
        rows = held_out_rows(run, prepared)
        outputs = {
            name: np.where(rows, 1.5 * values + random.normal(0, 0.1 * np.nanstd(values), len(values)), values)
            for name, values in run.outputs.items()
        }
        runs.append(dataclasses.replace(run, outputs=outputs, raw_outputs=outputs))
    return dataclasses.replace(data, runs=tuple(runs))


def arrays(given: object, where: str = "prepared", seen: set[int] | None = None) -> Iterator[tuple[str, np.ndarray]]:
    """Yields every array that can be reached from an object, with its path."""
    seen = set() if seen is None else seen
    if id(given) in seen or given is None or isinstance(given, (str, bytes, int, float, complex, type, Path)):
        return
    seen.add(id(given))
    if isinstance(given, np.ndarray):
        yield from numbers_in(given, where)
    elif issparse(given):
        yield f"{where}.data", given.data
    elif isinstance(given, Mapping):
        for key, value in given.items():
            yield from arrays(value, f"{where}[{key!r}]", seen)
    elif isinstance(given, (list, tuple, set, frozenset)):
        for index, value in enumerate(given):
            yield from arrays(value, f"{where}[{index}]", seen)
    elif callable(given) and getattr(given, "__closure__", None):
        for index, cell in enumerate(given.__closure__):
            yield from arrays(cell.cell_contents, f"{where}.cell{index}", seen)
    else:
        slots = [name for kind in type(given).__mro__ for name in getattr(kind, "__slots__", ())]
        held = {one: getattr(given, one, None) for one in slots} | getattr(given, "__dict__", {})
        for name, value in held.items():
            yield from arrays(value, f"{where}.{name}", seen)


def numbers_in(array: np.ndarray, where: str) -> Iterator[tuple[str, np.ndarray]]:
    """Yields an array, or each field of an array of structures, without addresses, which differ from call to call."""
    for name in array.dtype.names or ():
        yield from numbers_in(array[name], f"{where}.{name}")
    if array.dtype.names is None and array.dtype.kind != "u":
        yield where, array


def held_out_values(data: Dataset, prepared: Prepared) -> set[float]:
    """Returns the held-out measured values that occur nowhere else, with and without damaged samples."""
    hidden, known = list[float](), set[float]()
    for run in data.runs:
        rows = held_out_rows(run, prepared)
        for values in (*run.outputs.values(), *run.raw_outputs.values()):
            hidden += values[rows].tolist()
            known |= set(values[~rows].tolist())
        for values in (run.time, *run.inputs.values()):
            known |= set(values.tolist())
    return {one for one in hidden if np.isfinite(one)} - known - {0.0}


def found_in(given: object, values: set[float]) -> list[str]:
    """Returns the paths to arrays that hold one of the values."""
    return [
        way for way, array in arrays(given) if array.dtype.kind == "f" and not values.isdisjoint(array.ravel().tolist())
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_stages_work_on_holds_no_value_that_is_held_out(kind: Any, tmp_path: Path) -> None:
    data = kind(tmp_path / "set")
    prepared, sealed = prepare(data, None, seed=0, jobs=1)
    values = held_out_values(data, prepared)
    assert len(values) > 50
    windows = prepare_windows(prepared)
    assert (windows is None) == (data.vehicle == "motor")
    for stage in (prepared, calibrate(prepared)) + (() if windows is None else (windows,)):
        assert found_in(stage, values) == []
    assert found_in(sealed.open(), values)  # in the opened seal they are found


def test_a_leak_would_be_found(tmp_path: Path) -> None:
    """Three ways in which a held-out value may reach a stage, each planted."""
    data = runs_held_out(tmp_path / "set")
    prepared, _ = prepare(data, None, seed=0, jobs=1)
    values = held_out_values(data, prepared)
    leaked = next(run for run in data.runs if run.role == "held_out").outputs["yaw_rate"]
    runs = (*prepared.dataset.runs[:-1], dataclasses.replace(prepared.dataset.runs[-1], outputs={"yaw_rate": leaked}))
    planted = [
        dataclasses.replace(prepared, dataset=dataclasses.replace(prepared.dataset, runs=runs)),
        dataclasses.replace(prepared, coarse=dataclasses.replace(prepared.coarse, measured=leaked[:50].copy())),
        dataclasses.replace(prepared, deadline=lambda: leaked),  # type: ignore[arg-type, return-value]
    ]
    ways = [found_in(one, values) for one in planted]
    assert [len(one) for one in ways] == [1, 1, 1]
    assert "dataset.runs[4].outputs['yaw_rate']" in ways[0][0]


@pytest.mark.parametrize("kind", KINDS)
def test_other_held_out_values_leave_all_that_is_prepared_as_it_was(kind: Any, tmp_path: Path) -> None:
    """Equal to the byte are the residuals, their weights, the start states, the roles and the calibrated model."""
    data = kind(tmp_path / "set")
    first, _ = prepare(data, None, seed=0, jobs=1)
    second, _ = prepare(wild(data, first, seed=1), None, seed=0, jobs=1)
    (one, nominal), (other, again) = calibrate(first), calibrate(second)
    assert [(way, array.tobytes()) for way, array in arrays(one)] == [
        (way, array.tobytes()) for way, array in arrays(other)
    ]
    assert one.roles == other.roles
    assert one.excitation == other.excitation
    for name in ("scales", "rms", "notes", "runs"):
        assert getattr(one.fine, name) == getattr(other.fine, name)
        assert getattr(one.coarse, name) == getattr(other.coarse, name)
    assert model_file.render(nominal.model) == model_file.render(again.model)


def told_by_fit_runs(found: Finding) -> str:
    """Returns the results that the fit runs alone decide, as text."""
    figures = verdict_json(found)
    kept = ("explanations", "ranking", "power", "predictable_left")
    return json.dumps({name: figures[name] for name in kept}) + model_file.render(found.nominal_model)


def test_held_out_values_choose_nothing(tmp_path: Path) -> None:
    """Any held-out values give the same explanations, weights, ranking and values. Only the proof differs."""
    data = runs_held_out(tmp_path / "set")
    prepared, _ = prepare(data, None, seed=0, jobs=1)
    one, other = (pipeline.discover(given, jobs=1) for given in (data, wild(data, prepared, seed=2)))
    assert told_by_fit_runs(one) == told_by_fit_runs(other)
    assert [effect.parameters for effect in one.effects] == [effect.parameters for effect in other.effects]
    assert one.evidence is not None
    assert other.evidence is not None
    assert one.evidence.removed_fit == other.evidence.removed_fit
    assert one.evidence.removed_held_out > 0.9 > other.evidence.removed_held_out
    assert [(step.stage, step.verdict) for step in one.steps] == [("weigh", "named")]
    assert other.steps == one.steps


def test_a_seal_that_is_opened_twice_is_an_error(tmp_path: Path) -> None:
    prepared, sealed = prepare(runs_held_out(tmp_path / "set"), None, seed=0, jobs=1)
    prove(prepared, sealed, robot(), TRUTH, {})
    with pytest.raises(SealError, match="opened before"):
        sealed.open()
    with pytest.raises(SealError, match="opened before"):
        prove(prepared, sealed, robot(), TRUTH, {})


def test_a_discovery_opens_the_seal_once_and_as_its_last_choice_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[str] = []
    for name in ("prepare", "explain", "settle", "prove", "measure", "conclude"):
        work = getattr(pipeline, name)

        def told(*given: Any, _name: str = name, _work: Any = work, **options: Any) -> Any:
            called.append(_name)
            return _work(*given, **options)

        monkeypatch.setattr(pipeline, name, told)
    opened = Sealed.open

    def open_once(sealed: Sealed) -> Any:
        called.append("open")
        return opened(sealed)

    monkeypatch.setattr(Sealed, "open", open_once)
    pipeline.discover(runs_held_out(tmp_path / "set"), jobs=1)
    assert called.count("open") == 1
    assert called[called.index("open") - 1] == "prove"
    assert not {"prepare", "explain", "settle"} & set(called[called.index("open") :])
    assert called[-2:] == ["measure", "conclude"]
