"""Data sets whose truth is known: outputs of the plant with seeded noise, written as a user would log them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from brickpilot import catalogue
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle import plant
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.plant import OpenLoopRun, State

TURNS = {"accel_sway", "yaw_rate", "yaw_angle"}

MANOEUVRES = {
    "straight": (4.0, 4.0),
    "straight_back": (-6.0, -6.0),
    "spin": (4.5, -4.5),
    "curve": (6.0, 3.0),
}


def robot(**changes: float) -> Model:
    """Returns the packaged robot with some values changed, without air drag and inductance."""
    rcx = model_file.rcx()
    return Model("truth", "diff_drive", "coupled", {**rcx.parameters, "drag_area": 0.0, "inductance": 0.0, **changes})


def motor(**values: float) -> Model:
    """Returns a bare motor with some values set, without inductance."""
    return Model("truth", "motor", "coupled", {**catalogue.presets("motor"), "inductance": 0.0, **values})


def steps(left: float, right: float, *, seconds: float = 2.0, period: float = 0.01, jitter_seed: int | None = None):
    """Returns time (n,), s, and voltages (n, 2), V: 0, the step, 0. With `jitter_seed` the samples are irregular."""
    time = np.arange(0.0, seconds, period)
    if jitter_seed is not None:
        time = time + np.random.default_rng(jitter_seed).uniform(-0.4, 0.4, len(time)) * period
        time = time - time[0]
    on = (time > 0.1) & (time < 0.7 * seconds)
    return time, np.where(on[:, np.newaxis], [left, right], 0.0)


def write(
    folder: Path,
    truth: Model,
    signals: Mapping[str, float],
    nominal: str,
    *,
    seed: int = 0,
    manoeuvres: Mapping[str, tuple[float, float]] = MANOEUVRES,
    frame: str = "FRD",
    units: Mapping[str, tuple[str, float]] | None = None,
    jitter: bool = False,
    roles: Sequence[str] | None = None,
    spoil=None,
    start: State | None = None,
    initial: str = "",
) -> Path:
    """Writes a data set and returns its folder.

    Args:
        signals: output -> sd of its noise, SI; an output that the vehicle lacks is noise about 0.
        nominal: the lines below [nominal].
        units: signal -> (unit, number of these units in one SI unit).
        start: the true start state of every run.
        initial: the start state that the file states, as the inside of a TOML table.
        spoil: damages a run: called with (run name, table of columns) before it is written; NaN is written as a blank.
    """
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    units = dict(units or {})
    lines = ['name = "synthetic"', f'vehicle = "{truth.vehicle}"', f'frame = "{frame}"', "[signals]"]
    lines += ['time = { column = "t", unit = "s" }']
    inputs = ["voltage"] if truth.vehicle == "motor" else ["voltage_left", "voltage_right"]
    lines += [f'{name} = {{ column = "{name}", unit = "V" }}' for name in inputs]
    for name in signals:
        lines.append(
            f'{name} = {{ column = "{name}", unit = "{units.get(name, (catalogue.outputs()[name], 1.0))[0]}" }}'
        )
    lines += ["[nominal]", nominal]
    for number, (name, (left, right)) in enumerate(manoeuvres.items()):
        time, voltages = steps(left, right, jitter_seed=seed + number if jitter else None)
        voltages = voltages[:, : len(inputs)]
        simulated = plant.simulate([(truth, OpenLoopRun(time=time, inputs=voltages, initial=start or State()))])[0]
        outputs = {name: np.zeros(len(time)) for name in signals} | simulated.outputs
        table = {"t": time} | dict(zip(inputs, voltages.T, strict=True))
        for signal, sd in signals.items():
            sign = -1.0 if frame == "FLU" and signal in TURNS else 1.0
            noisy = outputs[signal] + random.normal(0.0, sd, len(time))
            table[signal] = sign * noisy * units.get(signal, ("", 1.0))[1]
        if spoil is not None:
            spoil(name, table)
        rows = np.column_stack(list(table.values()))
        cells = [["" if np.isnan(value) else f"{value:.12g}" for value in row] for row in rows]
        text = "\n".join([",".join(table), *(",".join(row) for row in cells)])
        (folder / f"{name}.csv").write_text(text + "\n", encoding="utf-8")
        role = roles[number] if roles is not None else "fit"
        lines += ["[[runs]]", f'name = "{name}"', f'file = "{name}.csv"', *([f'role = "{role}"'] if role else [])]
        lines += [f"initial = {{ {initial} }}"] if initial else []
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder
