"""A data set in the program's form: runs in SI and in the paper's frame (x forward, y right, clockwise positive).

`reading` makes a data set from a folder of files, or from DataFrames.

Results are shown in the unit, the frame and the sign in which the data set states its signals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.ndimage import median_filter

from brickpilot import catalogue
from brickpilot.data.nominal import Nominal
from brickpilot.data.shown import Result
from brickpilot.data.signals import SIGNALS, TURNS_WITH_FRAME, Array, Frame, Vehicle, input_names, of_motors, to_frd
from brickpilot.errors import InputError

if TYPE_CHECKING:
    import pandas

    from brickpilot.data.audit.fault import Fault
    from brickpilot.data.audit.wiring_motion import Miswired
    from brickpilot.data.description import Role, Signal
    from brickpilot.data.input_timing import InputTiming
    from brickpilot.data.reading import Column


__all__ = ["PRESET_BATTERY_VOLTAGE", "Dataset", "Nominal", "Run", "battery", "motor_inputs"]


PRESET_BATTERY_VOLTAGE = catalogue.parameter("battery_voltage").preset
"""V: the battery voltage that multiplies a duty, if the data set states no voltage."""

_SHOWN_RUNS = 8  # largest number of runs that a printed data set lists

_DROPOUT_SHARE = 0.25  # limit, as a share of the running median: a battery voltage farther from the median is a dropout
_MEDIAN_SAMPLES = 5


@dataclass(frozen=True, eq=False)
class Run:
    """One measured run. Arrays are read-only, in SI and the paper's frame, with one entry for each sample.

    Attributes:
        name: the run's name, unique in its data set.
        file: the text file that the run is read from.
        role: "fit" or "held_out"; None: the program chooses the role.
        time: s, strictly increasing, as logged; it may start at any value and have uneven steps. Rows closer than the
            plant's motor step are merged (`reading.decimated`).
        inputs: signal -> values; NaN where the cell is blank, which means that the motor floats.
        outputs: signal -> values; NaN where the cell is blank or the sample is damaged (`Dataset.faults`).
        raw_outputs: as `outputs`, but with the damaged samples as measured.
        gap_s: pause in s between the end of the previous run in the file and the start of this run.
        replicate_of: name of the run that this run repeats.
        initial: name from `signals.INITIAL_UNITS` -> stated value of the vehicle's state at the start of the run.
        recording: name of the recording that the run belongs to; empty: there is only one recording.
    """

    name: str
    file: Path
    role: Role | None
    time: Array
    inputs: Mapping[str, Array]
    outputs: Mapping[str, Array]
    raw_outputs: Mapping[str, Array]
    gap_s: float
    replicate_of: str | None
    initial: Mapping[str, float]
    recording: str = ""

    def __post_init__(self) -> None:
        """Makes the arrays read-only, because runs share them."""
        for values in (self.time, *self.inputs.values(), *self.outputs.values(), *self.raw_outputs.values()):
            values.setflags(write=False)

    def rows(self, rows: slice, **changes: Any) -> Run:
        """Returns a part of the run, with `replicate_of` None. `changes`: field -> its value in the new run."""
        tables = {
            table: {signal: values[rows] for signal, values in getattr(self, table).items()}
            for table in ("inputs", "outputs", "raw_outputs")
        }
        return replace(self, time=self.time[rows], replicate_of=None, **tables | changes)

    def to_frame(self) -> pandas.DataFrame:
        """Returns a table with a row for each sample: time, inputs and outputs, in SI and the paper's frame."""
        import pandas

        return pandas.DataFrame({"time": self.time, **self.inputs, **self.outputs})


@dataclass(frozen=True, eq=False, repr=False)
class Dataset(Result):
    """A data set that has been read and checked.

    Attributes:
        path: the dataset.toml, as the caller named it.
        frame: the frame of the files; all values in this object are in FRD.
        signals: signal -> its column and unit in the files; noise_sd, resolution and range are in SI and FRD.
        nominal: known parameters of the plant; the other parameters are fitted.
        nominal_effects: effect -> parameter -> value, for effects that the experimenter's model contains.
        runs: the runs in the file's order.
        gap_s: pause in s before a run that does not state its own pause.
        faults: the damaged samples, ordered by run and time; they are NaN in the runs' outputs (see `audit`).
        notes: sentences for the user about presets, repaired readings and damaged samples.
        input_timing: what an input does between two rows: "held", "linear", or "unknown", which is treated as "held".
            With "linear", rows without outputs are added until rows are at most 5 ms apart wherever an input changes.
        guessed: numbers that an importer had to guess, such as "960 counts a turn"; see `guesses`.
        wiring: channels that are swapped, reversed, dead or scaled wrongly in all runs; `runs` holds the mended
            channels if the fault is sure.
    """

    name: str
    path: Path
    vehicle: Vehicle
    frame: Frame
    signals: Mapping[str, Signal]
    nominal: Mapping[str, Nominal]
    nominal_effects: Mapping[str, Mapping[str, Nominal]]
    runs: tuple[Run, ...]
    gap_s: float
    faults: tuple[Fault, ...]
    notes: tuple[str, ...]
    input_timing: InputTiming = "held"
    wiring: tuple[Miswired, ...] = ()
    guessed: tuple[str, ...] = ()

    _of_frames: ClassVar[Callable[..., Dataset]]  # `reading` sets this function, because `reading` imports this module

    @property
    def guesses(self) -> tuple[str, ...]:
        """Guessed numbers that scale all speeds or all voltages. The runs cannot confirm these numbers."""
        is_preset = any(name.startswith("duty") for name in self.signals) and not (
            "battery_voltage" in self.signals or "battery_voltage" in self.nominal
        )
        return (*self.guessed, *([f"{PRESET_BATTERY_VOLTAGE:g} V of the battery"] if is_preset else []))

    def motor_inputs(self, run: Run) -> Array:
        """Returns the voltage at each motor; see the function `motor_inputs`."""
        return motor_inputs(run, self)

    @staticmethod
    def from_frames(
        frames: Mapping[str, pandas.DataFrame],
        *,
        vehicle: Vehicle | None = None,
        signals: Mapping[str, Column] | None = None,
        nominal: Mapping[str, Any] | None = None,
        frame: Frame | None = None,
        roles: Mapping[str, Role] | None = None,
        gap_s: float | Mapping[str, float] | None = None,
        replicate_of: Mapping[str, str] | None = None,
        initial: Mapping[str, Mapping[str, float]] | None = None,
        input_timing: InputTiming | None = None,
        floats: bool = False,
        as_wired: bool = False,
        name: str = "frames",
    ) -> Dataset:
        """Returns a data set made of DataFrames, with the checks that `read` makes of files.

        Args:
            frames: run -> its table, with a row for each sample.
            vehicle: "diff_drive", "motor" or "skid_steer"; required.
            signals: signal -> its column: a name (values in SI); (name, unit); or a mapping of the keys that a data
                set's file may state, such as {"column": "gz", "unit": "deg/s", "noise_sd": 0.2}. The default for the
                time is the column "time", in s. None: every column of the first frame that is named like a signal, in
                SI. A frame's index with a name counts as a column.
            nominal: as [nominal] in a data set's file: parameter -> a value in SI, or {"value": ..., "sd": ...}.
            frame: "FLU" or "FRD"; None: FRD.
            roles: run -> "fit" or "held_out"; the program chooses the roles of the other runs.
            gap_s: the pause between runs in s; or run -> the pause before this run in s; None: 0.
            replicate_of: run -> the other run that this run repeats.
            initial: run -> name from `signals.INITIAL_UNITS` -> value at the start of the run, in SI and `frame`.
                Absent values are taken from the first sample.
            input_timing: what an input does between two rows: "held", "linear", or "unknown"; None: held.
            as_wired: True: channels that look swapped, reversed or scaled wrongly are not mended.
            floats: True: a motor floats where its voltage is NaN; False: NaN in a voltage is an error.

        Raises:
            InputError: an argument or a frame is wrong; the message names run, row (from 0, as in `iloc`) and column.

        >>> import brickpilot as bp, pandas as pd
        >>> bench = pd.DataFrame({"time": [0.0, 0.1, 0.2], "u": [0.0, 6.0, 6.0], "rpm": [0.0, 12.0, 30.0]})
        >>> dataset = bp.Dataset.from_frames(
        ...     {"step": bench}, vehicle="motor", signals={"voltage": "u", "speed": ("rpm", "rpm")}
        ... )
        >>> dataset.runs[0].to_frame().round(3)
           time  voltage  speed
        0   0.0      0.0  0.000
        1   0.1      6.0  1.257
        2   0.2      6.0  3.142
        """
        pause, pauses = (None, gap_s) if isinstance(gap_s, Mapping) else (gap_s, None)
        stated = {
            "name": name, "vehicle": vehicle, "frame": frame, "nominal": nominal, "as_wired": as_wired,
            "input_timing": input_timing, "gap_s": pause,
        }  # fmt: skip
        of_runs = {"role": roles, "gap_s": pauses, "replicate_of": replicate_of, "initial": initial}
        known = {key: values for key, values in of_runs.items() if values is not None}
        return Dataset._of_frames(frames, signals, known, stated, floats)

    def to_frame(self, run: str | None = None) -> pandas.DataFrame:
        """Returns a table with a row for each run: role, samples, duration (s), median step (s) and faults.

        With the name of a run, the table has a row for each sample of this run, in SI and the frame of the data set's
        files.
        """
        import pandas

        if run is not None:
            by_name = {each.name: each for each in self.runs}
            if run not in by_name:
                raise InputError(f"{run!r} is not one of {', '.join(by_name)}", field="run")
            return by_name[run].to_frame().apply(lambda column: to_frd(str(column.name), column, self.frame))

        rows = [
            {
                "run": run.name,
                "role": run.role,
                "samples": len(run.time),
                "duration_s": run.time[-1] - run.time[0],
                "step_s": np.median(np.diff(run.time)),
                "faults": sum(fault.run == run.name for fault in self.faults),
            }
            for run in self.runs
        ]
        return pandas.DataFrame(rows)

    def __repr__(self) -> str:
        """Returns two lines about the data set, and one line for each of the first runs."""
        shown = [
            f"  {run.name}: {len(run.time)} samples, {run.time[-1] - run.time[0]:.4g} s, {run.role or 'no role stated'}"
            for run in self.runs[:_SHOWN_RUNS]
        ]
        more = [f"  and {len(self.runs) - _SHOWN_RUNS} more"] if len(self.runs) > _SHOWN_RUNS else []
        size = f"{self.vehicle}, {len(self.runs)} runs, {len(self.faults)} faults, {len(self.notes)} notes"
        return "\n".join([f"Dataset {self.name}: {size}", f"  signals: {', '.join(self.signals)}", *shown, *more])


def joined(datasets: Sequence[Dataset]) -> Dataset:
    """Returns one data set with the runs of several data sets of one robot; see `with_all_runs`.

    Raises:
        InputError: the vehicles or the stated nominal values differ.
    """
    first = datasets[0]
    for other in datasets[1:]:
        if (other.vehicle, other.nominal, other.nominal_effects) != (
            first.vehicle,
            first.nominal,
            first.nominal_effects,
        ):
            raise InputError(f"states another vehicle or nominal values than {first.path}", file=other.path)
    return (
        first
        if len(datasets) == 1
        else with_all_runs({f"{number}_": dataset for number, dataset in enumerate(datasets, 1)})
    )


def with_all_runs(datasets: Mapping[str, Dataset]) -> Dataset:
    """Returns the first data set with the runs, faults and notes of all data sets; each key precedes its run names."""
    first = next(iter(datasets.values()))
    signals: dict[str, Signal] = {}
    for dataset in reversed(list(datasets.values())):
        signals |= dataset.signals
    runs, faults = [], []
    for key, dataset in datasets.items():
        faults += [replace(fault, run=key + fault.run) for fault in dataset.faults]
        for run in dataset.runs:
            runs.append(replace(run, name=key + run.name, replicate_of=run.replicate_of and key + run.replicate_of))
    unique: dict[str, Any] = {
        field: tuple(dict.fromkeys(item for dataset in datasets.values() for item in getattr(dataset, field)))
        for field in ("notes", "wiring", "guessed")
    }
    return replace(first, signals=signals, runs=tuple(runs), faults=tuple(faults), **unique)


def motor_inputs(run: Run, dataset: Dataset) -> Array:
    """Returns the voltage at each motor in V: (n, 2), left and right, of a robot; (n, 1) of a motor.

    NaN means that the motor floats. A set point is converted to the voltage at which the wheel turns at the set speed
    without a load. A duty is multiplied by the battery voltage at the same sample; see `battery`. `duty_mean` is
    `(left + right) / 2`, and `duty_diff` is `left - right`.
    """
    first = input_names(run.inputs)[0]
    columns = of_motors(run.inputs, _nominal(dataset, "half_track"))
    if first.startswith("voltage"):
        return columns
    if first.startswith("reference"):
        radius = _nominal(dataset, "wheel_radius") if first == "reference_velocity" else 1.0
        return _nominal(dataset, "emf_constant") / radius * columns
    return columns * battery(run, dataset)[0][:, np.newaxis]


def _nominal(dataset: Dataset, name: str) -> float:
    """Returns a nominal value, or the parameter's preset if no value is stated."""
    stated = dataset.nominal.get(name)
    return catalogue.parameter(name).preset if stated is None else stated.value


def battery(run: Run, dataset: Dataset) -> tuple[Array, int]:
    """Returns the battery voltage of each sample, V, and how many readings were replaced as dropouts.

    Blanks are interpolated. If no voltage is measured, the nominal voltage is used, or else `PRESET_BATTERY_VOLTAGE`.
    """
    measured = run.outputs.get("battery_voltage")
    if measured is not None and np.isfinite(measured).any():
        known = np.isfinite(measured)
        filled = np.interp(run.time, run.time[known], measured[known])
        level = median_filter(filled, size=_MEDIAN_SAMPLES, mode="nearest")
        dropout = np.abs(filled - level) > _DROPOUT_SHARE * np.abs(level)
        return np.where(dropout, level, filled), int(np.count_nonzero(dropout & known))
    nominal = dataset.nominal.get("battery_voltage")
    return np.full(run.time.size, PRESET_BATTERY_VOLTAGE if nominal is None else nominal.value), 0


FRAME_WORDS = {
    "FLU": "x forward, y to the left, yaw counter-clockwise positive",
    "FRD": "x forward, y to the right, yaw clockwise positive",
}


@dataclass(frozen=True)
class OwnUnit:
    """The unit and the sign with which a data set states one signal.

    Attributes:
        unit: the unit's name in the data set.
        per_si: the number of these units in one SI unit; above 0.
        sign: -1 if the signal has opposite signs in the data set's frame and in the paper's frame, else 1.
    """

    unit: str
    per_si: float = 1.0
    sign: float = 1.0

    def value(self, si: float) -> float:
        """Converts a value from SI and the paper's frame to the data set's unit and sign."""
        return self.sign * self.per_si * si

    def size(self, si: float) -> float:
        """Converts a size without a sign, such as an rms, from SI to the data set's unit."""
        return self.per_si * si


def own_units(dataset: Dataset, signals: Iterable[str]) -> dict[str, OwnUnit]:
    """Returns signal -> unit and sign in the data set; a signal without a column, such as a computed rate, is in SI."""
    return {name: own_unit(dataset, name) for name in signals}


def own_unit(dataset: Dataset, signal: str) -> OwnUnit:
    """Returns a signal's unit and sign in the data set. If the unit is the SI unit, its name is that of `SIGNALS`."""
    stated = dataset.signals.get(signal)
    sign = -1.0 if dataset.frame == "FLU" and signal in TURNS_WITH_FRAME else 1.0
    if stated is None or stated.to_si == 1.0:
        return OwnUnit(SIGNALS[signal].unit, 1.0, sign)
    return OwnUnit(stated.unit, 1 / stated.to_si, sign)


def frame_text(dataset: Dataset) -> str:
    """Returns the frame of a data set in words; empty for a motor, which has no frame."""
    return "" if dataset.vehicle == "motor" else f"{dataset.frame}: {FRAME_WORDS[dataset.frame]}"
