"""An accelerometer gives the value at a sample's time or the mean since the last: stated, or shown by the data."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import synthetic
from brickpilot.data.dataset import Dataset
from brickpilot.data.reading import read
from brickpilot.discover.prepare import calibrate, prepare
from brickpilot.discover.row_meaning import with_known_sampling
from brickpilot.errors import InputError
from brickpilot.fit.blocks import blocks, on_coarse_grid
from brickpilot.vehicle import plant
from brickpilot.vehicle.plant import OpenLoopRun

Table = dict[str, np.ndarray]

TRUTH = synthetic.robot(inductance=0.5)
NOISE = {"accel_surge": 0.005, "yaw_rate": 0.01, "wheel_speed_left": 0.05, "wheel_speed_right": 0.05}
_FINE_S = 5e-4


def truth_of(table: Table) -> np.ndarray:
    """Returns the acceleration (samples,), m/s^2, at the time of each sample, from a fine simulation.

    Where the command changes, this is the acceleration before the change.
    """
    fine = np.arange(0.0, table["t"][-1] + _FINE_S, _FINE_S)
    rows = np.clip(np.searchsorted(table["t"], fine + 1e-9, side="right") - 1, 0, len(table["t"]) - 1)
    volts = np.column_stack([table["voltage_left"], table["voltage_right"]])[rows]
    run = OpenLoopRun(time=fine, inputs=volts, body_step=_FINE_S)
    outputs = plant.simulate([(TRUTH, run)])[0].outputs
    return np.interp(table["t"], fine, outputs["accel_surge"])


def written(folder: Path, kind: str) -> Dataset:
    def spoil(_: str, table: Table) -> None:
        if kind == "instant":
            noise = np.random.default_rng(1).normal(0, NOISE["accel_surge"], len(table["t"]))
            table["accel_surge"] = truth_of(table) + noise

    other = {"mass", "force_per_volt", "torque_per_volt"}
    known = "\n".join(f"{name} = {value}" for name, value in TRUTH.parameters.items() if name not in other)
    nominal = f"{known}\nmass = {{ value = {TRUTH.parameters['mass']}, sd = 0.03 }}"
    return read(synthetic.write(folder, TRUTH, NOISE, nominal, spoil=spoil))


def stated(data: Dataset, kind: str | None) -> Dataset:
    signals = {
        name: dataclasses.replace(one, sampling=kind) if name.startswith("accel_") else one
        for name, one in data.signals.items()
    }
    return dataclasses.replace(data, signals=signals)


@pytest.mark.parametrize("kind", ["instant", "mean"])
def test_what_a_sample_is_can_be_stated(kind: str, tmp_path: Path) -> None:
    data = written(tmp_path / "s", "mean")
    assert data.signals["accel_surge"].sampling is None
    toml = tmp_path / "s" / "dataset.toml"
    text = toml.read_text(encoding="utf-8")
    key = 'accel_surge = { column = "accel_surge",'
    toml.write_text(text.replace(key, f'{key} sampling = "{kind}",'), encoding="utf-8")
    assert read(tmp_path / "s").signals["accel_surge"].sampling == kind


@pytest.mark.parametrize(
    ("signal", "value", "said"),
    [
        ("accel_surge", '"average"', "signals.accel_surge.sampling: 'average' is not one of instant, mean"),
        ("accel_surge", "3", "signals.accel_surge.sampling: 3 is not one of instant, mean"),
        ("yaw_rate", '"mean"', "signals.yaw_rate.sampling: unknown key; known:"),
    ],
)
def test_a_wrong_statement_is_refused_in_one_line(signal: str, value: str, said: str, tmp_path: Path) -> None:
    written(tmp_path / "s", "mean")
    toml = tmp_path / "s" / "dataset.toml"
    text = toml.read_text(encoding="utf-8")
    key = f'{signal} = {{ column = "{signal}",'
    toml.write_text(text.replace(key, f"{key} sampling = {value},"), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read(tmp_path / "s")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("kind", ["instant", "mean"])
def test_what_is_stated_is_what_is_compared(kind: str, tmp_path: Path) -> None:
    """With the right statement the true model leaves only noise, and with the wrong one more."""
    data = written(tmp_path / "s", kind)
    left = {}
    for said in ("instant", "mean"):
        found, _ = blocks(stated(data, said), TRUTH, {run.name for run in data.runs})
        outputs = {run.name: run for run in data.runs}
        errors = []
        for block in found:
            if block.signal == "accel_surge":
                run = outputs[block.run]
                volts = np.column_stack([run.inputs["voltage_left"], run.inputs["voltage_right"]])
                simulated = plant.simulate([(TRUTH, OpenLoopRun(time=run.time, inputs=volts))])[0].outputs
                errors.append(block.measured - block.picked @ simulated["accel_surge"])
        left[said] = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    other = "mean" if kind == "instant" else "instant"
    assert left[kind] < 1.6 * NOISE["accel_surge"]
    assert left[other] > 1.6 * left[kind]


def test_bins_of_a_coarse_simulation_are_those_of_the_samples_also_where_a_command_steps(tmp_path: Path) -> None:
    """A sample of an accelerometer belongs to the bin of the time before the sample.

    So no bin begins with a sample from the time before a step of the command.
    """
    data = written(tmp_path / "s", "mean")
    time = np.arange(0.0, 1.5, 0.003)
    volts = np.where((time > 0.3 - 1e-9) & (time < 0.9), 7.0, -4.0)
    outputs = plant.simulate([(TRUTH, OpenLoopRun(time=time, inputs=np.column_stack([volts, volts])))])[0].outputs
    measured = {"accel_surge": np.array(outputs["accel_surge"])}
    inputs = {"voltage_left": volts, "voltage_right": volts}
    run = dataclasses.replace(data.runs[0], time=time, inputs=inputs, outputs=measured)
    fast = dataclasses.replace(data, runs=(run,))
    replay, bins = on_coarse_grid(fast, 0.03)
    (block,), _ = blocks(fast, TRUTH, {run.name}, bins)
    simulated = block.picked @ replay.simulate([TRUTH])[0][run.name]["accel_surge"]
    assert np.max(np.abs(block.measured - simulated)) < 0.002 * np.max(np.abs(block.measured))


def known_sampling(data: Dataset) -> Dataset | None:
    return with_known_sampling(data, *calibrate(prepare(data, None, seed=0, jobs=1)[0]))


def test_runs_that_show_the_instant_are_taken_so_and_a_note_says_it(tmp_path: Path) -> None:
    data = written(tmp_path / "s", "instant")
    known = known_sampling(data)
    assert known is not None
    assert known.signals["accel_surge"].sampling == "instant"
    assert {name: one.sampling for name, one in known.signals.items() if one.sampling} == {"accel_surge": "instant"}
    assert known.notes[: len(data.notes)] == data.notes
    (note,) = known.notes[len(data.notes) :]
    assert note.startswith("accel_surge: the data set does not state what a sample is. It is the instant, 9")


def test_the_mean_is_taken_without_a_word_and_what_is_stated_is_not_asked(tmp_path: Path) -> None:
    assert known_sampling(written(tmp_path / "mean", "mean")) is None
    data = written(tmp_path / "instant", "instant")
    for kind in ("instant", "mean"):
        assert known_sampling(stated(data, kind)) is None
