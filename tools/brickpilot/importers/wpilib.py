"""Turns WPILib characterisation logs, JSON files of frc-characterization and of SysId, into a data set.

A file holds rows for each test, with positions in rotations and velocities in rotations/s. The length of a row shows
which tool wrote it:

    10 numbers, frc-characterization: time, battery V, autospeed, |V| left, |V| right, position left, right,
        velocity left, right, gyro rad
    9 numbers, SysId drivetrain: time, V left, right, position left, right, velocity left, right, gyro rad, gyro rad/s
    4 numbers, SysId mechanism: time, V, position, velocity

In rows of 10 numbers the voltages have no sign and lag by a sample. So the importer computes them as autospeed times
battery voltage.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brickpilot.data.signals import SIGNALS, Frame, Vehicle
from brickpilot.data.units import si_factor
from brickpilot.data.whole_files import read_text
from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, Log, Vector, by_name
from brickpilot.importers.writer import NewDataset, NewRun, run_names

_LENGTHS = {"meters": "m", "feet": "ft", "inches": "in"}
_ANGLES = {"radians": "rad", "degrees": "deg", "rotations": "rotation"}
_WIDTHS: dict[Vehicle, tuple[int, ...]] = {"diff_drive": (10, 9), "motor": (10, 4)}
_TEST_NAME = re.compile(r"\w[\w.+ -]{0,60}", re.ASCII).fullmatch
_SURE = 0.8  # least correlation of gyro and wheels that shows the sign of the gyro


@dataclass(frozen=True)
class _Log:
    """The content of one file.

    Attributes:
        signals: names of the signals of position and velocity; for a drivetrain, without ``_left`` or ``_right``.
        per_rotation: m or rad per rotation.
        tests: name -> rows (n, width), in the order of time.
    """

    vehicle: Vehicle
    signals: tuple[str, str]
    per_rotation: float
    tests: Mapping[str, Vector]


def import_wpilib(files: Sequence[Path]) -> NewDataset:
    """Returns a data set of WPILib JSON files; each test becomes a run.

    With several files, the name of a run begins with the name of its file. Runs of one file are ordered by the robot's
    clock, and ``gap_s`` is the pause between two runs. A comparison with the wheels shows the gyro's sign, and so the
    frame of the data set. Idle rows are kept; rows whose time does not increase are left out.

    Args:
        files: JSON files of one robot, all of a drivetrain or all of a mechanism.

    Raises:
        InputError: a file or a test is bad; the message names it.
    """
    logs = dict(zip(run_names(files), (_read(file) for file in files), strict=True))
    first = next(iter(logs.values()))
    for file, log in zip(files, logs.values(), strict=True):
        if log.vehicle != first.vehicle or log.signals != first.signals:
            raise InputError(f"is of another mechanism or another kind of unit than {files[0]}", file=file)
    notes: list[str] = []
    runs: list[NewRun] = []
    for stem, log in logs.items():
        runs += _runs(f"{stem}_" if len(logs) > 1 else "", log, notes)
    runs = _with_shared_columns(runs, notes)
    units = {signal: SIGNALS[signal].unit for signal in runs[0].columns}
    frame = _frame(runs, notes) if first.vehicle == "diff_drive" else "FRD"
    return NewDataset(first.vehicle, frame, units, runs, notes=notes)


def read(file: Path) -> Log:
    """Reads the tests of a file; the channels are ``TEST.SIGNAL``.

    Raises:
        InputError: the file or a test is bad.
    """
    notes: list[str] = []
    channels = [
        Channel(f"{run.name}.{signal}", "double", run.columns["time"], values, SIGNALS[signal].unit)
        for run in _runs("", _read(file), notes)
        for signal, values in run.columns.items()
        if signal != "time"
    ]
    return Log(file, by_name(channels), notes=tuple(notes))


def _read(file: Path) -> _Log:
    content = _json(file)
    test, unit, per_rotation = (content.get(key) for key in ("test", "units", "unitsPerRotation"))
    if not isinstance(test, str):
        raise InputError("is missing or not a text; is this a WPILib log?", file=file, field="test")
    unit = unit.lower() if isinstance(unit, str) else unit
    if unit not in (*_LENGTHS, *_ANGLES):
        raise InputError(f"{unit!r} is not one of {', '.join((*_LENGTHS, *_ANGLES))}", file=file, field="units")
    if isinstance(per_rotation, bool) or not isinstance(per_rotation, int | float) or not 0 < per_rotation < 1e6:
        raise InputError(f"{per_rotation!r} is not a number above zero", file=file, field="unitsPerRotation")
    vehicle: Vehicle = "diff_drive" if test.startswith("Drivetrain") else "motor"
    for key, rows in content.items():
        if isinstance(rows, list) and not _TEST_NAME(key):
            raise InputError("is not a valid name of a test", file=file, field=repr(key))
    tests = {key: _rows(file, key, rows, vehicle) for key, rows in content.items() if isinstance(rows, list) and rows}
    if not tests:
        raise InputError("holds no test with rows", file=file)
    factor = si_factor(_LENGTHS[unit], "m") if unit in _LENGTHS else si_factor(_ANGLES[unit], "rad")
    signals = ("position", "velocity") if unit in _LENGTHS else ("angle", "speed")
    if vehicle == "diff_drive":
        signals = ("wheel_travel", "wheel_velocity") if unit in _LENGTHS else ("wheel_angle", "wheel_speed")
    in_order = dict(sorted(tests.items(), key=lambda item: float(item[1][0, 0])))
    return _Log(vehicle, signals, float(per_rotation) * factor, in_order)


def _json(file: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_text(file))
    except json.JSONDecodeError as error:
        raise InputError(f"is not JSON: {error.msg}", file=file, line=error.lineno) from error
    except (ValueError, RecursionError) as error:
        raise InputError("is not JSON", file=file) from error
    if not isinstance(content, dict):
        raise InputError("is not a WPILib log: one JSON object is needed", file=file)
    return content


def _rows(file: Path, test: str, rows: list[Any], vehicle: Vehicle) -> Vector:
    widths = _WIDTHS[vehicle]
    for index, row in enumerate(rows):
        if not isinstance(row, list) or len(row) not in widths or len(row) != len(rows[0]):
            wanted = " or ".join(str(width) for width in widths)
            raise InputError(f"is not a row of {wanted} numbers like the others", file=file, field=f"{test}[{index}]")
        if not all(isinstance(cell, int | float) and not isinstance(cell, bool) for cell in row):
            raise InputError("holds something that is not a number", file=file, field=f"{test}[{index}]")
    try:
        values = np.array(rows, dtype=np.float64)
    except OverflowError as error:
        raise InputError("holds a number that is too large", file=file, field=test) from error
    finite = np.isfinite(values).all(axis=1)
    if not finite.all():
        raise InputError("holds a value that is not finite", file=file, field=f"{test}[{int(np.argmin(finite))}]")
    return values


def _runs(prefix: str, log: _Log, notes: list[str]) -> list[NewRun]:
    runs: list[NewRun] = []
    end: float | None = None
    for test, rows in log.tests.items():
        latest = np.maximum.accumulate(rows[:, 0])
        kept = rows[np.concatenate([[True], rows[1:, 0] > latest[:-1]])]
        run = f"{prefix}{test}"
        if len(kept) < len(rows):
            notes.append(f"run {run}: {len(rows) - len(kept)} rows whose time does not increase were left out")
        start = float(kept[0, 0])
        gap_s = start - end if end is not None and start > end else None
        runs.append(NewRun(run, _columns(run, kept, log, notes), gap_s))
        end = float(kept[-1, 0])
    return runs


def _columns(run: str, rows: Vector, log: _Log, notes: list[str]) -> dict[str, Vector]:
    width = rows.shape[1]
    columns: dict[str, Vector] = {"time": rows[:, 0]}
    sides = ("_left", "_right") if log.vehicle == "diff_drive" else ("",)
    position = {10: 5, 9: 3, 4: 2}[width]
    velocity = {10: 7, 9: 5, 4: 3}[width]
    for offset, side in enumerate(sides):
        turning = rows[:, velocity + offset]
        voltage = rows[:, 1] * rows[:, 2] if width == 10 else rows[:, 1 + offset]
        columns[f"voltage{side}"] = _signed(run, f"voltage{side}", voltage, turning, width, notes)
        columns[f"{log.signals[0]}{side}"] = rows[:, position + offset] * log.per_rotation
        columns[f"{log.signals[1]}{side}"] = turning * log.per_rotation
    if width == 10:
        columns["battery_voltage"] = rows[:, 1]
    if log.vehicle == "diff_drive":
        columns["yaw_angle"] = rows[:, 9 if width == 10 else 7]
        if width == 9:
            columns["yaw_rate"] = rows[:, 8]
    return columns


def _signed(run: str, signal: str, voltage: Vector, turning: Vector, width: int, notes: list[str]) -> Vector:
    """Returns the voltage with the sign of its wheel's motion, if the log gives no sign.

    In rows of 10 numbers, no column tells which side is reversed in a turning test. In other rows, a voltage without
    negative values may be a magnitude; a voltage with negative values is not changed.
    """
    unsigned = width == 10 or not (voltage < 0.0).any()
    if unsigned and float(voltage @ turning) < 0.0:
        notes.append(f"run {run}: the sign of {signal} is reversed, because its wheel turns the other way")
        return 0.0 - voltage  # -voltage would give -0.0
    return voltage


def _with_shared_columns(runs: list[NewRun], notes: list[str]) -> list[NewRun]:
    """Returns the runs with only the signals that all runs have; a gyro that never moves is left out."""
    shared = [name for name in runs[0].columns if all(name in run.columns for run in runs)]
    if "yaw_angle" in shared and all(np.ptp(run.columns["yaw_angle"]) == 0.0 for run in runs):
        shared = [name for name in shared if name not in {"yaw_angle", "yaw_rate"}]
        notes.append("yaw is left out: its angle never changes, so the log has no gyro")
    return [NewRun(run.name, {name: run.columns[name] for name in shared}, run.gap_s) for run in runs]


def _frame(runs: Sequence[NewRun], notes: list[str]) -> Frame:
    """Returns FLU if the gyro counts up while the right wheel is faster, FRD if it counts down."""
    if "yaw_angle" not in runs[0].columns:
        return "FLU"
    wheel = "wheel_travel" if "wheel_travel_left" in runs[0].columns else "wheel_angle"
    differences = [run.columns[f"{wheel}_right"] - run.columns[f"{wheel}_left"] for run in runs]
    turns = np.concatenate([values - values.mean() for values in differences])
    gyro = np.concatenate([run.columns["yaw_angle"] - run.columns["yaw_angle"].mean() for run in runs])
    size = float(np.linalg.norm(turns) * np.linalg.norm(gyro))
    correlation = float(turns @ gyro) / size if size > 0.0 else 0.0
    if abs(correlation) < _SURE:
        notes.append("gyro and wheels do not agree: WPILib's convention is used, counter-clockwise positive")
        return "FLU"
    sense = "counter-clockwise" if correlation > 0.0 else "clockwise"
    notes.append(
        f"the gyro counts {sense}: its angle follows right minus left wheel travel (correlation {correlation:.4f})"
    )
    return "FLU" if correlation > 0.0 else "FRD"
