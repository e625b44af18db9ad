"""The peer of the blind test: PySINDy's sparse regression of the residual acceleration on a library of named terms.

It gets what discovery gets and its calibrated nominal model besides. Residual: measured less simulated; its
derivative and its own nominal dynamics make the acceleration that the nominal model lacks (discrepancy modelling:
Kaheman, Kaiser, Strom, Kutz & Brunton 2019, arXiv:1909.08574). The nominal model's own terms are projected out.
Terms are chosen on the fit runs by PySINDy's `STLSQ` (the threshold by BIC) and `FROLS`, and judged on the held-out
runs: what a term gains there, in log likelihood, must pass a gate. Window and gates are tuned on calibration seeds
(`benchmark_tune`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

from brickpilot.benchmark.sindy_library import NOT_IN_LIBRARY, Column, Modes, Motion, carried, library, modes
from brickpilot.data.dataset import Dataset, Run, motor_inputs
from brickpilot.errors import InputError
from brickpilot.fit.replay import Outputs
from brickpilot.vehicle.model import Model

Array = NDArray[np.float64]

WINDOWS_S = (0.06, 0.12, 0.24, 0.48)
"""s: the grid of Savitzky-Golay windows (cubic) that is tuned over."""
SHARES = (0.0, 0.02, 0.05, 0.1, 0.2)
"""The grid of `Setting.share`."""
METHODS = ("STLSQ", "FROLS")
BIC_ALONE = "STLSQ, BIC alone"
"""As is usual: whatever BIC leaves is named, without a gate."""
THRESHOLDS = tuple(float(value) for value in np.geomspace(0.003, 1.0, 15))
"""STLSQ's, over the rms of the target: columns have unit length. BIC chooses."""
MOST = 5
"""Terms that FROLS may take."""

_IMU = ("accel_surge", "accel_sway", "yaw_rate")
_LEAST = 1e-4  # of a column: what must be left of it beside the model's own
_RIDGE = 1e-6
_STATE_WINDOW_S = 0.5  # of the speeds that terms are made of: longer, else their noise stands on both sides
_PER_WINDOW = 3  # rows kept of each window's length
_ORDER = 3


@dataclass(frozen=True)
class Setting:
    """How a method is used.

    Attributes:
        window_s: of the smoothing.
        share: of what the first term gains: what a further one must gain.
        gate: what any term must gain held out, in log likelihood; by sensors.
    """

    window_s: float
    share: float
    gate: Mapping[str, float]


SETTINGS = {
    "STLSQ": Setting(0.06, 0.2, {"imu+encoders": 3.0, "imu": 10.8}),
    "FROLS": Setting(0.48, 0.2, {"imu+encoders": 10.9, "imu": 12.8}),
}
"""Tuned by `benchmark_tune` on calibration seeds: see the benchmark's section in tests/hidden/README.md."""


def tuned_windows() -> tuple[float, ...]:
    """s: the windows that `SETTINGS` use."""
    return tuple(sorted({setting.window_s for setting in SETTINGS.values()}))


def nameable(hidden: Iterable[str]) -> bool:
    """Whether the library has a column for each of these effects."""
    return not NOT_IN_LIBRARY & set(hidden)


def verdict_of(result: Mapping[str, Any], method: str, setting: Setting | None = None) -> dict[str, Any]:
    """A benchmark's record with the peer's verdict in place of ours: `none`, or `named` with the terms past the gate.

    Args:
        method: one of `METHODS`, or `BIC_ALONE`.
        setting: instead of the tuned one.
    """
    setting = setting or SETTINGS[method.split(",")[0]]
    path = result["peer"][f"{setting.window_s:g}"][method.split(",")[0]]
    least = max(setting.gate[result["sensors"]], setting.share * max(path["gains"][:1], default=0.0))
    names = path["names"]
    if method != BIC_ALONE:
        passed = takewhile(lambda term: term[1] >= least, zip(names, path["gains"], strict=True))
        names = [name for name, _ in passed]
    effects = [{"name": name, "parameters": {}, "equivalents": []} for name in dict.fromkeys(names)]
    return {**result, "verdict": "named" if effects else "none", "effects": effects, "term": None}


def missing() -> str | None:
    """Why the peer cannot run; None where it can."""
    return None if find_spec("pysindy") else "PySINDy is not installed: pip install pysindy"


@dataclass(frozen=True)
class Regression:
    """Whitened rows of one data set: `target` (n,), `columns` (n, k) of the effects `names` (k,), `own` of the model.

    `count`: rows that they stand for, where they are condensed; `size` (k,): what the columns were divided by.
    """

    target: Array
    columns: Array
    own: Array
    names: tuple[str, ...]
    count: int
    size: Array

    def only(self, kept: NDArray[np.bool_]) -> Regression:
        """Without the columns that are not `kept` (k,): those that are the model's own show nothing."""
        names = tuple(name for name, one in zip(self.names, kept, strict=True) if one)
        return replace(self, columns=self.columns[:, kept], names=names, size=self.size[kept])


def paths(
    dataset: Dataset,
    model: Model,
    simulated: Mapping[str, Outputs],
    roles: Mapping[str, str],
    noise_sd: Mapping[str, float],
    windows_s: Sequence[float] = WINDOWS_S,
) -> dict[str, Any]:
    """What the peer finds in a differential drive's data set: window -> method -> its terms with what each gains.

    Args:
        model: the calibrated nominal model, `simulated` what it gives: run -> outputs.
        roles: run -> "fit" or "held_out".
        noise_sd: signal -> sd of a sample, SI.

    Returns:
        {"0.06": {"FROLS": {"names": [...], "gains": [...]}, "STLSQ": ...}, ...}: effects in the order they were taken
        (STLSQ: by gain), and what each gains on the held-out runs, in log likelihood.

    Raises:
        InputError: PySINDy is not installed.
    """
    why = missing()
    if why:
        raise InputError(why, field="--peer")
    found = {}
    for window_s in windows_s:
        by_role = {
            role: _rows(dataset, model, simulated, [run for run in roles if roles[run] == role], noise_sd, window_s)
            for role in ("fit", "held_out")
        }
        fit = _condensed(by_role["fit"], np.linalg.norm(by_role["fit"].columns, axis=0))
        kept = np.linalg.norm(fit.columns, axis=0) > _LEAST
        fit, unseen = fit.only(kept), _condensed(by_role["held_out"], fit.size).only(kept)
        found[f"{window_s:g}"] = {"STLSQ": _stlsq(fit, unseen), "FROLS": _frols(fit, unseen)}
    return found


def _stlsq(fit: Regression, unseen: Regression) -> dict[str, Any]:
    """The support of least BIC over `THRESHOLDS`; its effects in the order of what each gains in the held-out runs."""
    from pysindy import STLSQ

    scale = float(np.linalg.norm(fit.target)) or 1.0
    best: tuple[float, tuple[int, ...]] = (_bic(fit, ()), ())
    for threshold in THRESHOLDS:
        optimizer = STLSQ(threshold=threshold * scale, alpha=_RIDGE, max_iter=20, unbias=False)
        support = tuple(np.flatnonzero(_fitted(optimizer, fit)).tolist())
        best = min(best, (_bic(fit, support), support))
    support = best[1]
    effects = list(dict.fromkeys(fit.names[k] for k in support))
    whole = _cost(fit, unseen, support)
    gains = {effect: _cost(fit, unseen, [k for k in support if fit.names[k] != effect]) - whole for effect in effects}
    ordered = sorted(effects, key=lambda effect: -gains[effect])
    return {"names": ordered, "gains": [gains[effect] for effect in ordered]}


def _frols(fit: Regression, unseen: Regression) -> dict[str, Any]:
    """Terms in the order that FROLS takes them, and by how much each lowers the cost of the held-out runs."""
    from pysindy import FROLS

    optimizer = FROLS(max_iter=MOST, alpha=_RIDGE, unbias=False)
    _fitted(optimizer, fit)
    names, gains, taken = [], [], []
    before = _cost(fit, unseen, ())
    for coefficients in optimizer.history_[1 : MOST + 1]:
        new = [k for k in np.flatnonzero(np.ravel(coefficients)).tolist() if k not in taken]
        taken += new
        after = _cost(fit, unseen, taken)
        names.append(fit.names[new[0]])
        gains.append(before - after)
        before = after
    return {"names": names, "gains": gains}


def _fitted(optimizer: Any, fit: Regression) -> Array:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # says each time that a threshold took all terms away, which is an answer here
        optimizer.fit(fit.columns, fit.target[:, np.newaxis])
    return np.ravel(optimizer.coef_)


def _solved(fit: Regression, support: Sequence[int]) -> Array:
    return np.asarray(np.linalg.lstsq(fit.columns[:, list(support)], fit.target, rcond=1e-10)[0], dtype=float)


def _cost(fit: Regression, judged: Regression, support: Sequence[int]) -> float:
    """Half the sum of squares that a support, fitted on `fit`, leaves of `judged`."""
    left = judged.target - judged.columns[:, list(support)] @ _solved(fit, support) if len(support) else judged.target
    return 0.5 * float(left @ left)


def _bic(fit: Regression, support: Sequence[int]) -> float:
    n = fit.count
    return n * float(np.log(max(2 * _cost(fit, fit, support), 1e-300) / n)) + len(support) * float(np.log(n))


def _condensed(rows: Regression, size: Array) -> Regression:
    """The model's own columns projected out, the others over `size`, and the same normal equations in few rows."""
    basis, _ = np.linalg.qr(rows.own / np.maximum(np.linalg.norm(rows.own, axis=0), 1e-300))
    both = np.column_stack([rows.columns / np.where(size > 0, size, 1.0), rows.target])
    both -= basis @ (basis.T @ both)
    few: Array = np.linalg.qr(both)[1]
    return replace(rows, target=few[:, -1], columns=few[:, :-1], own=rows.own[:0], size=size)


def _rows(
    dataset: Dataset,
    model: Model,
    simulated: Mapping[str, Outputs],
    chosen: Sequence[str],
    noise_sd: Mapping[str, float],
    window_s: float,
) -> Regression:
    """Target and columns of all `chosen` runs, one below the other."""
    of = modes(model)
    age, charge, heat = 0.0, 0.0, (0.0, 0.0)
    blocks: list[tuple[Array, Array]] = []
    own = 0
    names: tuple[str, ...] = ()
    for run in dataset.runs:
        motion, left = _motion(run, dataset, simulated[run.name], of, (age, charge, heat))
        age += float(run.time[-1] - run.time[0])
        charge, heat = carried(of, motion)
        if run.name not in chosen:
            continue
        terms = library(of, motion)
        own, names = len(terms[""]), tuple(name for name, columns in terms.items() if name for _ in columns)
        view = _View(of, motion, window_s, tuple(left))
        weight = {name: 1 / sd for name, sd in view.noise(noise_sd).items()}
        target = view.rows({name: values[:, np.newaxis] for name, values in left.items()})
        table = view.columns([column for columns in terms.values() for column in columns])
        blocks.append((view.stacked(target, weight), view.stacked(table, weight)))
    targets, tables = (np.vstack(parts) for parts in zip(*blocks, strict=True))
    return Regression(
        targets[:, 0], tables[:, own:], tables[:, :own], names, len(targets), np.ones(tables.shape[1] - own)
    )


def _motion(
    run: Run, dataset: Dataset, simulated: Outputs, of: Modes, past: tuple[float, float, tuple[float, float]]
) -> tuple[Motion, dict[str, Array]]:
    """The run on an even grid, and measured less simulated: signal -> (n,), wheels as "mean" and "difference"."""
    step = float(np.median(np.diff(run.time)))
    grid = np.arange(run.time[0], run.time[-1] + step / 2, step)
    inputs = np.nan_to_num(motor_inputs(run, dataset))

    def even(values: Array) -> Array:
        known = np.isfinite(values)
        return np.interp(grid, run.time[known], values[known]) if known.any() else np.zeros_like(grid)

    measured = {name: even(values) for name, values in run.outputs.items()}
    given = {name: even(values) for name, values in simulated.items()}
    left = {name: measured[name] - given[name] for name in _IMU if name in measured}
    wheels = {side: given[f"wheel_speed_{side}"] for side in ("left", "right")}
    if all(f"wheel_speed_{side}" in measured for side in wheels):
        off = {side: measured[f"wheel_speed_{side}"] - wheels[side] for side in wheels}
        left["mean"], left["difference"] = 0.5 * (off["left"] + off["right"]), 0.5 * (off["left"] - off["right"])
        wheels = {side: wheels[side] + _smooth(off[side], _samples(_STATE_WINDOW_S, step)) for side in wheels}
    rates = {side: np.gradient(given[f"wheel_speed_{side}"], step) for side in wheels}
    age, charge, heat = past
    motion = Motion(
        step=step,
        left=wheels["left"],
        right=wheels["right"],
        volts_left=even(inputs[:, 0]),
        volts_right=even(inputs[:, 1]),
        left_rate=rates["left"],
        right_rate=rates["right"],
        surge_accel=given["accel_surge"],
        sway_accel=given["accel_sway"],
        yaw_accel=of.radius / of.half_track * 0.5 * (rates["left"] - rates["right"]),
        age=age,
        charge=charge,
        heat=heat,
    )
    return motion, left


def _samples(window_s: float, step: float) -> int:
    """Of a Savitzky-Golay window: odd, and more than its order."""
    return max(_ORDER + 2, 2 * round(0.5 * window_s / step) + 1)


def _smooth(values: Array, count: int) -> Array:
    return np.asarray(savgol_filter(values, min(count, (len(values) - 1) // 2 * 2 + 1), _ORDER, axis=0))


class _View:
    """Turns residuals and library columns of one run into rows of the regression, the same way.

    With wheel speeds: the accelerations that the two modes lack, and what gyro and accelerometers say beside the
    wheels. By IMU alone: the yaw acceleration that is lacking, and the residuals of the three signals; there is no
    speed to regress on, so that a column is driven through the nominal modes first.
    """

    def __init__(self, of: Modes, motion: Motion, window_s: float, signals: tuple[str, ...]) -> None:
        from pysindy import SmoothedFiniteDifference

        self.of, self.motion, self.signals = of, motion, signals
        self.wheels = "mean" in signals
        self.per = of.radius / of.half_track
        self.surge = (of.radius * 0.5 * (motion.left + motion.right))[:, np.newaxis]
        self.turn = (self.per * 0.5 * (motion.left - motion.right))[:, np.newaxis]
        self.samples = _samples(window_s, motion.step)
        self.every = max(1, self.samples // _PER_WINDOW)
        self.time = np.arange(len(motion.left)) * motion.step
        self.derivative = SmoothedFiniteDifference(
            smoother_kws={"window_length": self.samples, "polyorder": _ORDER, "axis": 0}
        )

    def rows(self, left: Mapping[str, Array]) -> dict[str, Array]:
        """Rows of what is left of each signal, (n, k) of each: name -> (n, k)."""
        smooth = {name: _smooth(values, self.samples) for name, values in left.items()}
        mean_decay, turn_decay = self.of.decay
        if not self.wheels:
            turning = self._rate(left["yaw_rate"]) + turn_decay * smooth["yaw_rate"] if "yaw_rate" in left else None
            return smooth if turning is None else {**smooth, "difference": turning / self.per}
        mean, difference = smooth["mean"], smooth["difference"]
        mean_rate = self._rate(left["mean"])
        beside = {
            "accel_surge": self.of.radius * mean_rate,
            "accel_sway": self.surge * self.per * difference + self.turn * self.of.radius * mean,
            "yaw_rate": self.per * difference,
        }
        return {
            "mean": mean_rate + mean_decay * mean,
            "difference": self._rate(left["difference"]) + turn_decay * difference,
            **{name: smooth[name] - beside[name] for name in beside if name in smooth},
        }

    def columns(self, library_columns: Sequence[Column]) -> dict[str, Array]:
        """Rows of library columns: what `rows` would give, were each of them all that is missing, of size 1."""
        nothing = np.zeros(len(self.time))
        mean = np.column_stack([one.mean for one in library_columns])
        difference = np.column_stack([one.difference for one in library_columns])
        said = {
            name: np.column_stack([one.sensors.get(name, nothing) for one in library_columns]) for name in self.signals
        }
        if self.wheels:
            rows = self.rows(said)
            rows["mean"] = rows["mean"] + _smooth(mean, self.samples)
            rows["difference"] = rows["difference"] + _smooth(difference, self.samples)
            return rows
        mean_decay, turn_decay = self.of.decay
        fast, turned = _driven(mean, mean_decay, self.motion.step), _driven(difference, turn_decay, self.motion.step)
        signals = {
            "accel_surge": self.of.radius * (mean - mean_decay * fast),
            "accel_sway": self.surge * self.per * turned + self.turn * self.of.radius * fast,
            "yaw_rate": self.per * turned,
        }
        return self.rows({name: signals[name] + values for name, values in said.items()})

    def noise(self, noise_sd: Mapping[str, float]) -> dict[str, float]:
        """sd of each row under white noise of the sensors: row -> sd."""
        random = np.random.default_rng(0)
        sds = {name: noise_sd.get(name, 0.0) for name in self.signals}
        if self.wheels:
            sds["mean"] = sds["difference"] = noise_sd["wheel_speed_left"] / np.sqrt(2)
        drawn = {name: random.normal(0.0, sds[name], (len(self.time), 1)) for name in self.signals}
        return {name: max(float(values.std()), 1e-12) for name, values in self.rows(drawn).items()}

    def stacked(self, rows: Mapping[str, Array], weight: Mapping[str, float]) -> Array:
        return np.vstack([weight[name] * rows[name][:: self.every] for name in weight])

    def _rate(self, values: Array) -> Array:
        return np.asarray(self.derivative(values, self.time))


def _driven(values: Array, decay: float, step: float) -> Array:
    """Solution of y' = values - decay y from rest."""
    kept = np.exp(-decay * step)
    return np.asarray(lfilter([0.0, (1 - kept) / decay], [1, -kept], values, axis=0))
