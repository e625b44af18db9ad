"""Runs discovery and its peers on measured data sets, and returns results as plain data for the table."""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from brickpilot import __version__, catalogue
from brickpilot.campaign.run_parts import Part, PartProgress, Workers, run_parts
from brickpilot.campaign.workers import Here, shared
from brickpilot.data import holdout, reading
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from brickpilot.discover import pipeline
from brickpilot.discover.finding import Finding, verdict_json
from brickpilot.errors import InputError, SimulationError
from brickpilot.vehicle import model as model_file
from brickpilot.vehicle.compared_runs import comparable
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Replay

from lab import measured, real_results
from lab.peers import PEERS, Peer
from lab.peers.grid import signals_of
from lab.real_logs import HiddenTest, RealLog
from lab.real_score import FIGURE, Predictions, fits

Progress = Callable[[int, int, str], None]

_FREE_RUN = "free_run"  # the name of this horizon in verdict.json


def data_sets(folders: Sequence[Path]) -> list[Path]:
    """Returns the folders of all data sets in or below `folders`, sorted.

    Raises:
        InputError: a folder does not exist, or there is no data set at all.
    """
    found: set[Path] = set()
    for folder in folders:
        if not folder.is_dir():
            raise InputError("no such folder", file=folder)
        found |= {path.parent for path in folder.rglob("dataset.toml")}
    if not found:
        raise InputError("no data set: no dataset.toml in it or below", file=folders[0])
    return sorted(found)


@dataclasses.dataclass(frozen=True)
class Work:
    """What to run on a data set.

    Attributes:
        discover: whether discovery runs.
        peers: the peers that run.
        seed, jobs, budget_s: options of discovery. budget_s None: the time is not limited.
    """

    discover: bool = True
    peers: Collection[Peer] = PEERS
    seed: int = 0
    jobs: int = 2
    budget_s: float | None = None


@dataclasses.dataclass(frozen=True)
class _Asked:
    """One data set and the work on it, for a worker."""

    folder: Path
    known: Mapping[str, RealLog]
    work: Work
    kept: Mapping[str, Mapping[str, Any]]
    progress: Progress


def run(
    folders: Sequence[Path],
    known: Mapping[str, RealLog],
    work: Work,
    kept: dict[str, dict[str, Any]],
    path: Path,
    *,
    workers: Workers,
    progress: Progress,
) -> None:
    """Runs data sets, and puts each result into `kept` and into the file `path` as soon as the result is there.

    Args:
        known: name of a log -> what is known of it.
        kept: name of a data set -> its last result.
        workers: the workers that run the data sets. If they run in this process, each set shows its own progress;
            otherwise `progress` shows the number of finished sets.
        progress: called with (done, all, text).

    Raises:
        InputError: a data set cannot be read.
    """
    here = isinstance(workers, Here)
    inner, outer = (progress, _silent) if here else (_silent, progress)

    def keep(part: Part, result: dict[str, Any]) -> None:
        kept[result["name"]] = result
        real_results.save(kept, path)

    parts = (
        Part(str(folder), _Asked(folder if here else folder.resolve(), known, work, kept, inner)) for folder in folders
    )
    told = PartProgress(outer, len(folders), what="data sets")
    run_parts(_run_asked, parts, keep=keep, workers=workers, progress=told)


def _run_asked(asked: _Asked) -> dict[str, Any]:
    return run_log(shared(asked.folder), asked.known, asked.work, asked.kept, asked.progress)


def _silent(done: int, total: int, text: str) -> None:
    """Shows no progress, because a worker has no terminal."""


def run_log(
    folder: Path, known: Mapping[str, RealLog], work: Work, kept: Mapping[str, Mapping[str, Any]], progress: Progress
) -> dict[str, Any]:
    """Returns the result of one data set.

    Args:
        known: name of a log -> what is known of it.
        kept: name of a data set -> its last result. Parts that `work` leaves out are copied from the last result.
    """
    data = reading.read(folder)
    before = kept.get(data.name, {})
    before = before if before.get("figure") == FIGURE else {}  # figures of different kinds are not compared
    log = known.get(data.name)
    roles = holdout.assign(data, Replay(data).inputs)
    result = {
        **before,
        "figure": FIGURE,
        "name": data.name,
        "vehicle": data.vehicle,
        "samples": sum(len(run.time) for run in data.runs),
    }
    if work.discover:
        result["discover"], own = _discovered(data, roles, work, progress)
        result["measured"] = {**result.get("measured", {}), "discover": measured.state()}
        roles = own or roles
    result["roles"] = {role: len([one for one in roles.by_run.values() if one == role]) for role in ("fit", "held_out")}
    peers = dict(before.get("peers", {}))
    for peer in work.peers:
        progress(0, 1, f"{data.name}: {peer.name}")
        peers[peer.name] = _peer(peer, data, roles, signals_of(data))
        result["measured"] = {**result.get("measured", {}), peer.name: measured.state()}
    result["peers"] = peers
    if log is not None and log.test is not None:
        result["test"] = _tested(data, log.test, work, dict(before.get("test", {})), progress)
    return result


def _discovered(data: Dataset, roles: Roles, work: Work, progress: Progress) -> tuple[dict[str, Any], Roles | None]:
    """Returns discovery's answer to a data set with the fits of its models, and the roles that discovery used."""
    began = time.perf_counter()
    try:
        found = _found(data, work, _named(data.name, progress))
        seconds = time.perf_counter() - began
        written = _written(found.augmented)
        used = Roles(dict(found.roles), roles.note)
        scored = {"before": _free_runs(data, found.nominal_model), "after": _free_runs(data, written)}
        scored["predictor"] = _free_runs(data, _written(_predictor(found)))
    except (InputError, SimulationError) as error:
        return {"error": str(error), "seconds": round(time.perf_counter() - began, 1)}, None
    signals = _signals(data, scored["after"])
    fit = {
        name: {role: one.to_json() for role, one in fits(data, used, runs, signals).items()}
        for name, runs in scored.items()
    }
    return {**_said(found), "fit": fit, "seconds": round(seconds, 1), "version": __version__}, used


def _found(data: Dataset, work: Work, progress: Progress) -> Finding:
    return pipeline.discover(
        data, seed=work.seed, jobs=work.jobs, budget_s=work.budget_s, predictor=True, progress=progress
    )


def _predictor(found: Finding) -> Model:
    return found.augmented if found.predictor is None else found.predictor.model


def _signals(data: Dataset, simulated: Predictions) -> tuple[str, ...]:
    """Returns the measured signals that are simulated."""
    return tuple(name for name in signals_of(data) if any(name in outputs for outputs in simulated.values()))


def _named(name: str, progress: Progress) -> Progress:
    return lambda done, total, text: progress(done, total, f"{name}: {text}")


def _written(model: Model) -> Model:
    """Returns the model after it is saved and loaded, as a user would read it."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "model.toml"
        model_file.save(model, path)
        return model_file.load(path)


def _free_runs(data: Dataset, model: Model, only: Collection[str] | None = None) -> Predictions:
    """Returns free runs from the same initial states as in `compare`, so that `compare` gives the same figures."""
    found: Predictions = Replay(comparable(data).started).simulate([model], only=only)[0]
    return found


def _said(found: Finding) -> dict[str, Any]:
    """Returns verdict, effects and mechanisms of a finding, and its attainable fits if the finding states them."""
    full = verdict_json(found)
    mechanisms = {effect.name: effect.mechanism for effect in catalogue.effects()}
    effects = [
        {
            "name": one["name"],
            "mechanism": one.get("mechanism") or mechanisms[one["name"]],
            "claimed": bool(one.get("claimed", True)),
            "confidence": _plain(one["confidence"]),
            "parameters": {key: _value(value) for key, value in one["parameters"].items()},
            "equivalents": [other["name"] for other in one["equivalents"]],
        }
        for one in full["effects"]
    ]
    return {
        "verdict": found.verdict,
        "mechanism": full.get("mechanism"),
        "evidence": full.get("evidence"),
        "effects": effects,
        "term": None if found.term is None else found.term.equation,
        "attainable": _attainable(full.get("fit_percent") or {}),
    }


def _attainable(fit_percent: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Returns "fit" and "held_out" -> signal -> the attainable fit percent of a free run, if discovery states it."""
    free = {signal: horizons.get(_FREE_RUN) or {} for signal, horizons in fit_percent.items()}
    by_role = {"fit": free, "held_out": {signal: one.get("held_out") or {} for signal, one in free.items()}}
    return {
        role: {
            signal: float(f"{one['attainable']:.6g}")
            for signal, one in found.items()
            if one.get("attainable") is not None
        }
        for role, found in by_role.items()
    }


def _value(value: Mapping[str, Any]) -> dict[str, Any]:
    bounds = value["ci95"]
    return {
        "value": _plain(value["value"]),
        "unit": value["unit"],
        "ci95": None if bounds is None else [_plain(one) for one in bounds],
    }


def _plain(value: float | None) -> float | None:
    """Returns a number with six digits, or None if the number is not finite: JSON has neither infinity nor NaN."""
    return None if value is None or not np.isfinite(value) else float(f"{value:.6g}")


def _peer(peer: Peer, data: Dataset, roles: Roles, signals: Sequence[str]) -> dict[str, Any]:
    missing = peer.missing()
    if missing:
        return {"missing": missing}
    began = time.perf_counter()
    try:
        predicted = peer.load()(data, roles)
    except (InputError, SimulationError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
        return {"error": f"{type(error).__name__}: {error}"[:200], "seconds": round(time.perf_counter() - began, 1)}
    scored = {role: fit.to_json() for role, fit in fits(data, roles, predicted, signals).items()}
    return {**scored, "seconds": round(time.perf_counter() - began, 1)}


def _tested(data: Dataset, test: HiddenTest, work: Work, before: dict[str, Any], progress: Progress) -> dict[str, Any]:
    """Returns the error of each model on the test run, in the signal's SI unit; the models are fitted without this run.

    The error is computed by the benchmark's own package: RMSE after the samples that are used to estimate the state.
    """
    if find_spec("nonlinear_benchmarks") is None:
        return {"missing": "the benchmark's own protocol is left out: pip install 'brickpilot[peers]'"}
    others = tuple(dataclasses.replace(run, role="fit") for run in data.runs if run.name != test.run)
    fitted = dataclasses.replace(data, runs=others)
    roles = Roles({run.name: "held_out" if run.name == test.run else "fit" for run in data.runs}, test.source)
    if work.discover:
        try:
            found = _found(fitted, work, _named("test", progress))
            free, predicted = (
                _free_runs(data, _written(model), [test.run]) for model in (found.augmented, _predictor(found))
            )
            before["discover"] = {"rmse": _error(data, test, free), "effects": [one.name for one in found.effects]}
            before["predictor of discover"] = {"rmse": _error(data, test, predicted)}
        except (InputError, SimulationError) as error:
            before["discover"] = before["predictor of discover"] = {"error": str(error)}
    for peer in work.peers:
        if not peer.missing():
            before[peer.name] = {"rmse": _error(data, test, peer.load()(data, roles))}
    return before


def _error(data: Dataset, test: HiddenTest, predicted: Predictions) -> float | None:
    from nonlinear_benchmarks.error_metrics import RMSE

    run = next(run for run in data.runs if run.name == test.run)
    simulated = predicted.get(run.name, {}).get(test.signal)
    if simulated is None:
        return None
    measured = run.outputs[test.signal]
    counted = np.isfinite(measured) & (np.arange(len(measured)) >= test.skip)
    return _plain(float(RMSE(measured[counted], simulated[counted])))


def peers_named(names: Sequence[str]) -> tuple[Peer, ...]:
    """Returns the peers with these names, in the table's order; without names, all peers.

    Raises:
        InputError: no peer has one of the names.
    """
    known = {peer.name: peer for peer in PEERS}
    for name in names:
        if name not in known:
            raise InputError(f"{name!r} is none of {', '.join(known)}", field="--peer")
    return tuple(peer for peer in PEERS if not names or peer.name in names)
