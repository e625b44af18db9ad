"""Writes the data set of a recipe into a folder, and its true values and hidden effects into a file beside it."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from hidden import measure, other_laws
from hidden.recipe import Floats, Recipe, Vehicle

UNITS = {
    "accel_surge": "m/s^2", "accel_sway": "m/s^2", "yaw_rate": "rad/s",
    "wheel_speed_left": "rad/s", "wheel_speed_right": "rad/s",
}  # fmt: skip
_TURNS = {"accel_sway", "yaw_rate"}  # signals that change sign between FRD and FLU
_SD_STATED = {"none": 0.0, "half": 0.5, "all": 1.0}  # share of the nominal values whose sd is stated


def nominal(recipe: Recipe) -> dict[str, dict[str, float]]:
    """Returns the nominal values: parameter -> {"value": ..., "sd": ...}; `recipe.sds` says how many have an sd."""
    random = np.random.default_rng([recipe.seed, 1_000_003])
    out = {}
    for parameter in fields(Vehicle):
        true = getattr(recipe.vehicle, parameter.name)
        error, stated = random.normal(0.0, 1.0), random.uniform()
        wrong = recipe.wrong.get(parameter.name)
        off = recipe.nominal_error * error if wrong is None else wrong
        out[parameter.name] = {"value": float(true * (1 + off))}
        if recipe.nominal_error > 0 and true != 0 and (wrong is not None or stated < _SD_STATED[recipe.sds]):
            out[parameter.name]["sd"] = float(true * recipe.nominal_error)
    return out


def write(recipe: Recipe, parent: Path) -> Path:
    """Writes the data set PARENT/NAME and PARENT/NAME.truth.json, or neither after an error; returns the folder.

    Raises:
        FileExistsError: the folder or the file exists already.
    """
    folder, truth = parent / recipe.name, parent / f"{recipe.name}.truth.json"
    for path in (folder, truth):
        if path.exists():
            raise FileExistsError(path)
    parent.mkdir(parents=True, exist_ok=True)
    runs = measure.log(measure.sense(measure.tracks(recipe), recipe), recipe)
    believed = nominal(recipe)
    scratch = Path(tempfile.mkdtemp(prefix=f".{recipe.name}.", dir=parent))
    try:
        for run, logged in zip(recipe.runs, runs, strict=True):
            (scratch / f"{run.name}.csv").write_text(
                _table(recipe, run.held(recipe.sample_s), logged), encoding="ascii"
            )
        (scratch / "dataset.toml").write_text(_description(recipe, believed, list(runs[0])), encoding="ascii")
        shown = measure.shown(recipe)
        facts = {
            "recipe": _plain(recipe),
            "laws": {name: other_laws.told(name) for name in recipe.hidden},
            "nominal": believed,
            "visibility": shown.visibility,
            "unit_of_visibility": "rms change of the signal / sd of its noise",
            "regions": shown.regions,
        }
        note = scratch / "truth.json"
        note.write_text(json.dumps(facts, indent=1) + "\n", encoding="ascii")
        os.replace(note, truth)
        os.chmod(scratch, 0o755)
        os.replace(scratch, folder)
    except BaseException:
        shutil.rmtree(scratch, ignore_errors=True)
        truth.unlink(missing_ok=True)
        raise
    return folder


def _plain(recipe: Recipe) -> dict[str, object]:
    table = asdict(recipe)
    table["runs"] = [run.name for run in recipe.runs]
    table["hidden"] = {name: dict(values) for name, values in recipe.hidden.items()}
    return table


def _table(recipe: Recipe, held: tuple[Floats, Floats, Floats], logged: Mapping[str, Floats]) -> str:
    columns = [[f"{value:.3f}" for value in held[0].tolist()]]
    columns += [[f"{value + 0.0:.5g}" for value in volts.tolist()] for volts in held[1:]]
    for name, values in logged.items():
        sign = -1.0 if recipe.frame == "FLU" and name in _TURNS else 1.0
        columns.append([f"{sign * value + 0.0:.6g}" for value in values.tolist()])
    header = ",".join(["t_s", "v_left_V", "v_right_V", *logged])
    return "\n".join([header, *map(",".join, zip(*columns, strict=True))]) + "\n"


def _description(recipe: Recipe, believed: Mapping[str, Mapping[str, float]], signals: list[str]) -> str:
    lines = [
        f'name = "{recipe.name}"',
        'vehicle = "diff_drive"',
        f'frame = "{recipe.frame}"',
        "",
        "[signals]",
        'time = { column = "t_s", unit = "s" }',
        'voltage_left = { column = "v_left_V", unit = "V" }',
        'voltage_right = { column = "v_right_V", unit = "V" }',
    ]
    for name in signals:
        entry = [f'column = "{name}"', f'unit = "{UNITS[name]}"']
        if recipe.noise_sd_stated:
            entry.append(f"noise_sd = {measure.NOISE_SD[name] * recipe.noise:.6g}")
        if recipe.quantised:
            entry.append(f"resolution = {measure.resolution(name):.6g}")
        entry.append(f"range = [{-measure.RANGE[name]:.6g}, {measure.RANGE[name]:.6g}]")
        lines.append(f"{name} = {{ {', '.join(entry)} }}")
    lines += ["", "[nominal]"]
    for name, value in believed.items():
        text = f"{value['value']:.6g}"
        if "sd" in value:
            text = f"{{ value = {text}, sd = {value['sd']:.3g} }}"
        lines.append(f"{name} = {text}")
    for run in recipe.runs:
        lines += ["", "[[runs]]", f'name = "{run.name}"', f'file = "{run.name}.csv"']
    return "\n".join(lines) + "\n"
