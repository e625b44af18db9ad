"""The peer of the blind test: PySINDy's sparse regression of the residual acceleration on a library of named terms.

The peer gets what discovery gets and, in addition, discovery's calibrated nominal model. The derivative of the residual
and the nominal dynamics give the acceleration that the nominal model lacks (discrepancy modelling: Kaheman, Kaiser,
Strom, Kutz & Brunton 2019, arXiv:1909.08574). The terms of the nominal model itself are projected out. `STLSQ` (with
the threshold by BIC) and `FROLS` of PySINDy choose terms on the fit runs. What a term gains on the held-out runs, in
log likelihood, has to pass a gate. Window and gates are tuned on calibration seeds (sindy_tune.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.benchmark.sindy_library import NOT_IN_LIBRARY
from brickpilot.benchmark.sindy_rows import Regression, rows_of
from brickpilot.data.dataset import Dataset
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Outputs

Array = NDArray[np.float64]

WINDOWS_S = (0.06, 0.12, 0.24, 0.48)
"""Lengths of the cubic Savitzky-Golay window, s: the grid for tuning."""
SHARES = (0.0, 0.02, 0.05, 0.1, 0.2)
"""Values of `Setting.share`: the grid for tuning."""
METHODS = ("STLSQ", "FROLS")
BIC_ALONE = "STLSQ, BIC alone"
"""The usual way: every term that BIC leaves is named, without a gate."""
THRESHOLDS = tuple(float(value) for value in np.geomspace(0.003, 1.0, 15))
"""Thresholds of STLSQ over the norm of the target, as columns have unit length. BIC chooses one."""
MOST = 5
"""The most terms that FROLS takes."""

_LEAST = 1e-4  # norm of a column without the nominal model's terms: a smaller one shows nothing
_RIDGE = 1e-6


@dataclass(frozen=True)
class Setting:
    """How a method is used.

    Attributes:
        window_s: length of the smoothing window.
        share: a further term has to gain this share of what the first term gains.
        gate: sensors -> what any term has to gain on the held-out runs, in log likelihood.
    """

    window_s: float
    share: float
    gate: Mapping[str, float]


SETTINGS = {
    "STLSQ": Setting(0.06, 0.2, {"imu+encoders": 3.0, "imu": 10.8}),
    "FROLS": Setting(0.48, 0.2, {"imu+encoders": 10.9, "imu": 12.8}),
}
"""Tuned by sindy_tune.py on calibration seeds: see the section on the peer in tests/hidden/README.md."""


def tuned_windows() -> tuple[float, ...]:
    """Returns the windows of `SETTINGS`, s."""
    return tuple(sorted({setting.window_s for setting in SETTINGS.values()}))


def nameable(hidden: Iterable[str]) -> bool:
    """Returns whether the library has a column for each of these effects."""
    return not NOT_IN_LIBRARY & set(hidden)


def verdict_of(result: Mapping[str, Any], method: str, setting: Setting | None = None) -> dict[str, Any]:
    """Returns a result with the peer's verdict in place of ours: `none`, or `named` with the terms that pass the gate.

    Args:
        method: one of `METHODS`, or `BIC_ALONE`.
        setting: None: the tuned one.
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
    """Returns why the peer cannot run; None if it can."""
    return None if find_spec("pysindy") else "PySINDy is not installed: pip install pysindy"


def paths(
    dataset: Dataset,
    model: Model,
    simulated: Mapping[str, Outputs],
    roles: Mapping[str, str],
    noise_sd: Mapping[str, float],
    windows_s: Sequence[float] = WINDOWS_S,
) -> dict[str, Any]:
    """Returns what the peer finds in the data set of a differential drive: window -> method -> terms and gains.

    Args:
        model: the calibrated nominal model.
        simulated: run -> its outputs.
        roles: run -> "fit" or "held_out". If no whole run is held out, every third is: a regression over rows has no
            held-out stretches.
        noise_sd: signal -> noise sd of a sample, SI.

    Returns:
        {"0.06": {"FROLS": {"names": [...], "gains": [...]}, "STLSQ": ...}, ...}: effects in the order in which they are
        taken (STLSQ: by gain), and what each gains on the held-out runs, in log likelihood.

    Raises:
        InputError: PySINDy is not installed.
    """
    why = missing()
    if why:
        raise InputError(why, field="--peer")
    if "held_out" not in roles.values():
        roles = {run: "held_out" if k % 3 == 1 else "fit" for k, run in enumerate(roles)}
    found = {}
    for window_s in windows_s:
        by_role = {
            role: rows_of(dataset, model, simulated, [run for run in roles if roles[run] == role], noise_sd, window_s)
            for role in ("fit", "held_out")
        }
        fit = _condensed(by_role["fit"], np.linalg.norm(by_role["fit"].columns, axis=0))
        kept = np.linalg.norm(fit.columns, axis=0) > _LEAST
        fit, held_out = fit.only(kept), _condensed(by_role["held_out"], fit.size).only(kept)
        found[f"{window_s:g}"] = {"STLSQ": _stlsq(fit, held_out), "FROLS": _frols(fit, held_out)}
    return found


def _stlsq(fit: Regression, held_out: Regression) -> dict[str, Any]:
    """Returns the effects of the support with the least BIC over `THRESHOLDS`, in the order of their held-out gains."""
    from pysindy import STLSQ

    scale = float(np.linalg.norm(fit.target)) or 1.0
    best: tuple[float, tuple[int, ...]] = (_bic(fit, ()), ())
    for threshold in THRESHOLDS:
        optimizer = STLSQ(threshold=threshold * scale, alpha=_RIDGE, max_iter=20, unbias=False)
        support = tuple(np.flatnonzero(_fitted(optimizer, fit)).tolist())
        best = min(best, (_bic(fit, support), support))
    support = best[1]
    effects = list(dict.fromkeys(fit.names[k] for k in support))
    whole = _cost(fit, held_out, support)
    gains = {effect: _cost(fit, held_out, [k for k in support if fit.names[k] != effect]) - whole for effect in effects}
    ordered = sorted(effects, key=lambda effect: -gains[effect])
    return {"names": ordered, "gains": [gains[effect] for effect in ordered]}


def _frols(fit: Regression, held_out: Regression) -> dict[str, Any]:
    """Returns terms in the order in which FROLS takes them, and how much each lowers the held-out cost."""
    from pysindy import FROLS

    optimizer = FROLS(max_iter=MOST, alpha=_RIDGE, unbias=False)
    _fitted(optimizer, fit)
    names, gains, taken = [], [], []
    before = _cost(fit, held_out, ())
    for coefficients in optimizer.history_[1 : MOST + 1]:
        new = [k for k in np.flatnonzero(np.ravel(coefficients)).tolist() if k not in taken]
        taken += new
        after = _cost(fit, held_out, taken)
        names.append(fit.names[new[0]])
        gains.append(before - after)
        before = after
    return {"names": names, "gains": gains}


def _fitted(optimizer: Any, fit: Regression) -> Array:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a threshold that removes all terms warns, but here it is an answer
        optimizer.fit(fit.columns, fit.target[:, np.newaxis])
    return np.ravel(optimizer.coef_)


def _solved(fit: Regression, support: Sequence[int]) -> Array:
    return np.asarray(np.linalg.lstsq(fit.columns[:, list(support)], fit.target, rcond=1e-10)[0], dtype=float)


def _cost(fit: Regression, on: Regression, support: Sequence[int]) -> float:
    """Returns half the squared residual of a support that is fitted to `fit`, on the rows of `on`."""
    residual = on.target - on.columns[:, list(support)] @ _solved(fit, support) if len(support) else on.target
    return 0.5 * float(residual @ residual)


def _bic(fit: Regression, support: Sequence[int]) -> float:
    n = fit.count
    return n * float(np.log(max(2 * _cost(fit, fit, support), 1e-300) / n)) + len(support) * float(np.log(n))


def _condensed(rows: Regression, size: Array) -> Regression:
    """Projects the nominal columns out, divides the others by `size`, and condenses the rows to as few as columns."""
    basis, _ = np.linalg.qr(rows.own / np.maximum(np.linalg.norm(rows.own, axis=0), 1e-300))
    both = np.column_stack([rows.columns / np.where(size > 0, size, 1.0), rows.target])
    both -= basis @ (basis.T @ both)
    few: Array = np.linalg.qr(both)[1]
    return replace(rows, target=few[:, -1], columns=few[:, :-1], own=rows.own[:0], size=size)
