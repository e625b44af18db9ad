"""The result of one data set: a line of results.jsonl, with the truth, the verdict and the gap on held-out runs."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from brickpilot.data.holdout import Roles
from brickpilot.data.whole_files import write_whole
from brickpilot.discover.finding import Finding, verdict_json
from brickpilot.errors import InputError
from numpy.typing import NDArray

RESULTS = "results.jsonl"

_RANKED = 5  # number of explanations that a result keeps
_UNMADE = {"hidden": None, "sensors": "imu", "noise": 1.0, "nominal_error": 0.0}  # for a set without a recipe

_SIZE = re.compile(r"-x([0-9.]+)-")


def load(path: Path) -> list[dict[str, Any]]:
    """Returns the last result of each set in a file. An incomplete last line is left out.

    Raises:
        InputError: the file does not exist, or a line is not a result.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError("no results here: run the benchmark first", file=path) from error
    found: dict[tuple[str, str, int], dict[str, Any]] = {}
    for number, line in enumerate(text.split("\n")[:-1], 1):
        try:
            result = json.loads(line)
            found[result["engine"], result["name"], result["seed"]] = result
        except (ValueError, TypeError, KeyError) as error:
            raise InputError("is not a line that the benchmark wrote", file=path, line=number) from error
    return list(found.values())


def append(path: Path, result: Mapping[str, Any]) -> None:
    """Appends a line in a single write, so it is never incomplete. An older incomplete line is removed first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    line = _line(result).encode()
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.lseek(handle, 0, os.SEEK_END)
        if size and os.pread(handle, 1, size - 1) != b"\n":
            os.ftruncate(handle, path.read_bytes().rfind(b"\n") + 1)
        os.write(handle, line)
        os.fsync(handle)
    finally:
        os.close(handle)


def put_in_order(path: Path, keys: Sequence[tuple[str, str, int]]) -> list[dict[str, Any]]:
    """Returns a file's results, those of `keys` last and in the order of `keys`; writes the file if the order changes.

    Args:
        keys: engine, name and seed of results, in the wanted order.
    """
    found = {(one["engine"], one["name"], one["seed"]): one for one in load(path)}
    places = {key: place for place, key in enumerate(keys)}
    ordered = sorted(found, key=lambda key: places.get(key, -1))  # stable: the other results keep their order
    if ordered != list(found):
        write_whole(path, "".join(_line(found[key]) for key in ordered))
    return [found[key] for key in ordered]


def _line(result: Mapping[str, Any]) -> str:
    return json.dumps(result, allow_nan=False) + "\n"


def truth_fields(name: str, truth: Mapping[str, Any] | None) -> dict[str, Any]:
    """Returns the fields of a result for the truth, and empty fields for the verdict."""
    facts: Mapping[str, Any] = {"recipe": _UNMADE, "visibility": {}} if truth is None else truth
    recipe = facts["recipe"]
    size = _SIZE.search(name)
    return {
        "hidden": recipe["hidden"],
        "laws": facts.get("laws", {}),
        "wrong": recipe.get("wrong", {}),
        "called": recipe.get("called", []),
        "group": recipe.get("suite", ""),
        "regions": facts.get("regions", []),
        "sensors": recipe["sensors"],
        "noise": recipe["noise"],
        "nominal_error": recipe["nominal_error"],
        "size": float(size[1]) if size else None,
        "visibility": facts["visibility"],
        "mechanism": None,
        "held": None,
        "law_differs": None,
        "effects": [],
        "suspected": [],
        "term": None,
        "elapsed_s": None,
        "cpu_s": None,
        "where": [],
        "left_prior": [],
        "held_out": {"before": None, "after": None, "removed": None, "floor": None},
        "asked": None,
        "follow": None,
    }


def verdict_fields(found: Finding) -> dict[str, Any]:
    """Returns the fields of a result for a finding."""
    full = verdict_json(found)
    return {
        "verdict": found.verdict,
        "mechanism": full["mechanism"],
        "held": [list(one.mechanisms) for one in found.explanations],
        "law_differs": full["law_differs"],
        "evidence": full["evidence"],
        "fit_percent": _without_nan(full.get("fit_percent")),
        "effects": [_effect(effect) for effect in full["effects"] if effect["claimed"]],
        "suspected": [_effect(effect) for effect in full["effects"] if not effect["claimed"]],
        "term": None
        if found.term is None
        else {
            "place": found.term.acts_on,
            "equation": found.term.equation,
            "removed_held_out": found.term.removed_held_out,
        },
        "where": [
            {key: place[key] for key in ("run", "signal", "from_s", "to_s", "share_of_gap", "when")}
            for place in full["where"]
        ],
        "left_prior": [name for name, change in full["nominal"].items() if change["leaves_prior"]],
        "ranking": [
            {"names": list(rank.names), "removed": _finite(rank.removed), "why": rank.why}
            for rank in found.ranking[:_RANKED]
        ],
    }


def _effect(effect: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": effect["name"],
        "mechanism": effect["mechanism"],
        "confidence": _finite(effect["confidence"]),
        "parameters": {
            name: {"value": value["value"], "ci95": _interval(value["ci95"])}
            for name, value in effect["parameters"].items()
        },
        "equivalents": [
            {"name": other["name"], "worse_by": _finite(other["worse_by"])} for other in effect["equivalents"]
        ],
    }


def _without_nan(tree: Any) -> Any:
    """Returns a JSON tree in which numbers that are not finite are None."""
    if isinstance(tree, Mapping):
        return {key: _without_nan(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [_without_nan(value) for value in tree]
    return None if isinstance(tree, float) and not np.isfinite(tree) else tree


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _interval(ci95: Sequence[float] | None) -> list[float] | None:
    return None if ci95 is None or not np.all(np.isfinite(ci95)) else [float(value) for value in ci95]


def held_out_gap(found: Finding) -> dict[str, Any]:
    """Returns the gap on the held-out runs: the rms over all samples of (measured - simulated) / noise floor.

    The floor combines the data set's stated noise and the converter's step, so it does not depend on discovery's
    estimate of the noise. If the data set states no noise, the floor is discovery's estimate. `removed` is the share of
    the mean square above the floor that the augmented model removes.
    """
    stated = {
        name: float(np.hypot(one.noise_sd, (one.resolution or 0.0) / 12**0.5))
        for name, one in found.dataset.signals.items()
        if one.noise_sd
    }
    known = all(name in stated for name in found.noise_sd)
    floor = {name: stated[name] if known else sd for name, sd in found.noise_sd.items()}
    squares: dict[str, list[NDArray[np.float64]]] = {"nominal": [], "augmented": []}
    roles = Roles(found.roles, "", found.held_out_stretches)
    tested = roles.tested()
    for run in found.dataset.runs:
        if run.name not in tested:
            continue
        outputs = roles.samples(run, "held_out").outputs
        for name, sd in floor.items():
            if name in outputs:
                for which, kept in squares.items():
                    off = (outputs[name] - found.simulated[which][run.name][name]) / sd
                    kept.append(off[np.isfinite(off)] ** 2)
    if not squares["nominal"]:
        return {"before": None, "after": None, "removed": None, "floor": None}
    before, after = (float(np.concatenate(kept).mean()) for kept in squares.values())
    removed = 1 - max(after - 1, 0.0) / (before - 1) if before > 1 else None
    return {
        "before": before**0.5,
        "after": after**0.5,
        "removed": removed,
        "floor": "stated" if known else "found",
    }
