"""The stored results of the benchmark on real logs: one JSON file, from which the table can be made at any time."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from brickpilot.errors import InputError

KEPT = Path(__file__).with_name("real_results.json")


def load(path: Path) -> dict[str, dict[str, Any]]:
    """Returns the results by data set; empty if the file does not exist.

    Raises:
        InputError: `save` did not write the file.
    """
    if not path.exists():
        return {}
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["logs"]
        return {one["name"]: one for one in found}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError("is not a file of results that the benchmark wrote", file=path) from error


def save(results: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Writes the results, one line for each data set, sorted by name; the file is replaced only when complete."""
    lines = [json.dumps(results[name], allow_nan=False, sort_keys=True) for name in sorted(results)]
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text('{"logs": [\n' + ",\n".join(lines) + "\n]}\n", encoding="utf-8")
    beside.replace(path)


def pooled(entry: Mapping[str, Any] | None, role: str) -> float | None:
    """Returns the pooled fit percent of a peer or of a model of discovery; None: there is no such value."""
    found = (entry or {}).get(role) or {}
    value = found.get("pooled")
    return None if value is None else float(value)


def models(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Returns model of discovery ("before", "after" or "predictor") -> role -> signal -> fit percent."""
    found: Mapping[str, Any] = result.get("discover", {}).get("fit") or {}
    return found


def judged_on(result: Mapping[str, Any]) -> str:
    """Returns the role of the runs that are scored: "held_out", or "fit" if no run is held out."""
    return "held_out" if result["roles"]["held_out"] else "fit"


def peers_of(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Returns the names of all peers in the results, in order of first appearance."""
    return list(dict.fromkeys(name for result in results for name in result.get("peers", {})))
