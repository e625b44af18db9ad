"""Writes a data-set folder.

The folder is first written beside its final place and read back as a check. Then it is renamed.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from brickpilot.data import reading
from brickpilot.data.audit.view import Channels
from brickpilot.data.audit.wiring import miswired, taken_from
from brickpilot.data.audit.wiring_motion import Miswired
from brickpilot.data.dataset import Dataset
from brickpilot.data.input_timing import InputTiming
from brickpilot.data.nominal import lengths
from brickpilot.data.reading import channels_of
from brickpilot.data.signals import Frame, Vehicle
from brickpilot.data.whole_files import beside
from brickpilot.errors import InputError, disk_named
from brickpilot.importers.mapping import Scaling, Source, mending

_ROWS_AT_ONCE = 50_000  # number of rows converted to text at a time, to save memory
_EXACT = 2.0**53  # whole numbers below this limit are written without a decimal point


@dataclass(frozen=True)
class Imported:
    """The result of an importer.

    Attributes:
        folder: the data set's folder.
        runs: the runs' names in order.
        notes: sentences for the user.
        wiring: a sentence on each wiring fault, such as swapped channels, that all runs have.
        mend: the options of `import` that correct the wiring; empty: there is no fault, or options cannot correct it.
    """

    folder: Path
    runs: tuple[str, ...]
    notes: tuple[str, ...]
    wiring: tuple[str, ...] = ()
    mend: str = ""


@dataclass(frozen=True)
class NewRun:
    """A run to be written.

    Attributes:
        columns: signal -> its cells, NaN for a blank cell; all columns have the same length. `NewDataset.scalings`
            turns cells into values in the unit that the data set states.
        gap_s: pause in s between the previous run and this one; None: not stated.
    """

    name: str
    columns: Mapping[str, NDArray[np.float64]]
    gap_s: float | None = None


@dataclass(frozen=True)
class NewDataset:
    """A data set to be written.

    Attributes:
        vehicle: the vehicle.
        frame: the frame; None: the frame that wheels, drives and yaw show, or else FRD.
        units: signal -> unit, for every signal, in the order of the columns.
        runs: the runs in order.
        nominal: parameter -> value in SI.
        notes: sentences for the user; the description begins with these sentences as comments.
        scalings: signal -> conversion of its cells to values; absent: the cells are the values.
        reasons: signal -> the reason for its guess, written as a comment after the signal's line.
        input_timing: how an input goes from one row to the next.
        sources: signal -> its source in the log, for the options that correct a wrong wiring.
        guessed: numbers that the importer assumed because the user did not state them, such as "960 counts a turn".
        as_wired: whether `dataset.toml` states that wiring faults are not corrected.
        name: the data set's name; empty: the name of its folder.
    """

    vehicle: Vehicle
    frame: Frame | None
    units: Mapping[str, str]
    runs: Sequence[NewRun]
    nominal: Mapping[str, float] = field(default_factory=dict)
    notes: Sequence[str] = ()
    scalings: Mapping[str, Scaling] = field(default_factory=dict)
    reasons: Mapping[str, str] = field(default_factory=dict)
    input_timing: InputTiming = "held"
    sources: Mapping[str, Source] = field(default_factory=dict)
    guessed: Sequence[str] = ()
    as_wired: bool = False
    name: str = ""


def check_out(out: Path) -> None:
    """Refuses a folder that is not empty.

    Raises:
        InputError: `out` is a file, or a folder that is not empty.
    """
    if out.is_dir() and not any(out.iterdir()):
        return
    if out.exists() or out.is_symlink():
        raise InputError("exists already; name a new folder", file=out, field="--out")


def run_names(files: Sequence[Path]) -> list[str]:
    """Returns a name for the run of each file: the file's name without its ending.

    Raises:
        InputError: no file is given, or two files have the same name.
    """
    if not files:
        raise InputError("no file to import", field="FILE")
    names = [file.stem for file in files]
    for position, name in enumerate(names):
        if name in names[:position]:
            raise InputError(f"two files would both make run {name!r}", file=files[position])
    return names


def write(new: NewDataset, out: Path, source: Path) -> Imported:
    """Writes `new` to the folder `out`, which does not exist or is empty.

    Args:
        new: the data set.
        out: its folder; missing parents are made.
        source: the log from which the data come; errors name this log.

    Raises:
        InputError: `out` exists or cannot be written, or the result is no valid data set. No file is left behind.
        WorkFailedError: the disk is full. No file is left behind.
    """
    check_out(out)
    place = out.resolve()
    parent = next(folder for folder in place.parents if folder.is_dir())
    try:
        with beside(parent / place.name, is_folder=True) as partial:
            new, read_back = _written(new, partial, out, source)
            place.parent.mkdir(parents=True, exist_ok=True)
            if place.is_dir():
                place.rmdir()  # the folder is empty; Windows cannot rename to a folder that exists
            partial.rename(place)
    except OSError as error:
        raise InputError(error.strerror or "cannot be written", file=out, field="--out") from error
    wiring = tuple(fault.sentence for fault in read_back.wiring)
    notes = (note for note in read_back.notes if not note.startswith("wiring: "))
    mend = mending(new.sources, taken_from(read_back.wiring))
    return Imported(out, tuple(run.name for run in new.runs), (*new.notes, *notes), wiring, mend)


def _written(new: NewDataset, folder: Path, out: Path, source: Path) -> tuple[NewDataset, Dataset]:
    """Writes the data set into a folder. Returns the data set with its frame, and the data set that was read back."""
    try:
        with disk_named(out):
            _write_runs(new, folder)
        read_back = _described(new, folder, out)
        if new.frame is None:
            other = _described(replace(new, frame="FLU"), folder, out) if "reference_yaw_rate" in new.units else None
            new = replace(new, **_framed(new, read_back, other))
            read_back = _described(new, folder, out)
    except InputError as error:
        reason = str(error).replace(f"{folder}{os.sep}", "")
        raise InputError(f"makes no valid data set: {reason}", file=source) from error
    return new, read_back


def _described(new: NewDataset, folder: Path, out: Path) -> Dataset:
    """Writes the description of runs that are already written, and reads the whole data set back."""
    with disk_named(out):
        (folder / "dataset.toml").write_text(
            _description(new, new.name or out.resolve().name), encoding="utf-8", newline="\n"
        )
    return reading.read(folder)


def _framed(new: NewDataset, as_frd: Dataset, as_flu: Dataset | None) -> dict[str, Any]:
    """Returns the frame that the data show, or else FRD, and the notes, with a note on the frame.

    The data show a frame if the yaw contradicts wheels and drives in the other frame. A set point of the yaw rate has
    the same frame as the gyro. So in a wrong frame, left and right look swapped. With such a set point, the frame with
    fewer wiring faults is chosen.

    Args:
        as_flu: the data set in the frame FLU, if there is a set point of the yaw rate.
    """
    yaw = next((name for name in ("yaw_rate", "yaw_angle") if name in new.units), None)
    if yaw is None or new.vehicle == "motor":
        return {"frame": "FRD"}
    nominal = lengths(as_frd.nominal, new.vehicle)
    channels = [channels_of(run) for run in as_frd.runs]
    faults = miswired(channels, nominal) if new.as_wired else as_frd.wiring

    def is_against(faults: Sequence[Miswired]) -> bool:
        return any(fault.kind == "sign" and yaw in fault.mend for fault in faults)

    shown: Frame | None = (
        "FLU" if is_against(faults) else "FRD" if is_against(miswired(list(map(_turned, channels)), nominal)) else None
    )
    if as_flu is not None:
        more = len(as_frd.wiring) - len(as_flu.wiring)
        shown = None if more == 0 else "FLU" if more > 0 else "FRD"
    if shown is None:
        note = f"the wheels do not show the sign of {yaw}: the frame is taken as FRD; see --frame"
        return {"frame": "FRD", "notes": (*new.notes, note), "guessed": (*new.guessed, "the frame FRD")}
    sense = "counter-clockwise" if shown == "FLU" else "clockwise"
    note = f"guessed: the frame is {shown}, as {yaw} and the wheels show {sense} as positive"
    return {"frame": shown, "notes": (*new.notes, note)}


def _turned(run: Channels) -> Channels:
    outputs = {name: -values if name.startswith("yaw_") else values for name, values in run.outputs.items()}
    return replace(run, outputs=outputs)


def _write_runs(new: NewDataset, folder: Path) -> None:
    for run in new.runs:
        columns = [run.columns[signal] for signal in new.units]
        with (folder / f"{run.name}.csv").open("w", encoding="utf-8", newline="\n") as file:
            file.write(",".join(new.units) + "\n")
            for start in range(0, len(columns[0]), _ROWS_AT_ONCE):
                rows = zip(*(_cells(values[start : start + _ROWS_AT_ONCE]) for values in columns), strict=True)
                file.writelines(f"{','.join(row)}\n" for row in rows)


def _cells(values: NDArray[np.float64]) -> list[str]:
    """Returns the shortest texts that read back as the same numbers; a blank for NaN."""
    whole = values == np.round(values)
    if np.all(whole & (np.abs(values) < _EXACT)):
        return list(map(str, values.astype(np.int64).tolist()))
    return ["" if value != value else repr(value) for value in values.tolist()]


def _description(new: NewDataset, name: str) -> str:
    document = tomlkit.document()
    for note in new.notes:
        document.add(tomlkit.comment(note))
    document.update({"name": name, "vehicle": new.vehicle, "frame": new.frame or "FRD"})
    if new.input_timing != "held":
        document["input_timing"] = new.input_timing
    if new.guessed:
        document["guessed"] = list(new.guessed)
    if new.as_wired:
        document["as_wired"] = True
    document["csv"] = _inline({"delimiter": ",", "header": True})
    signals = tomlkit.table()
    for signal, unit in new.units.items():
        scaling = new.scalings.get(signal, Scaling())
        stated = {"scale": scaling.scale, "offset": scaling.offset}
        default = {"scale": 1.0, "offset": 0.0}
        changed = {name: value for name, value in stated.items() if value != default[name]}
        signals[signal] = _inline({"column": signal, "unit": unit, **changed})
        if signal in new.reasons:
            signals[signal].comment(new.reasons[signal])
    document["signals"] = signals
    document["nominal"] = dict(new.nominal)
    runs = tomlkit.aot()
    for run in new.runs:
        entry = tomlkit.table()
        entry.update({"name": run.name, "file": f"{run.name}.csv"})
        if run.gap_s is not None:
            entry["gap_s"] = run.gap_s
        runs.append(entry)
    document["runs"] = runs
    return tomlkit.dumps(document)


def _inline(values: Mapping[str, object]) -> tomlkit.items.InlineTable:
    table = tomlkit.inline_table()
    table.update(values)
    return table
