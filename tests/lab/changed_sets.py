"""How often `changed` is right: on pairs of simulated recordings, on labelled real pairs, and on halves of logs.

For a simulated pair, an engine drives one vehicle twice, with different voltages and noise. One of the two recordings
has an effect, or has it from a moment on, or neither recording has one. The score says whether an answer names the
mechanism that differs alone, with an extra name, or among rivals.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import brickpilot as bp
import numpy as np
from brickpilot import catalogue
from hidden import effects, folder, other_laws, planar_engine, scales
from hidden.manoeuvre import Manoeuvre, short, varied
from hidden.recipe import VEHICLES, Hidden, Onset, Recipe, specimen

from lab import measured
from lab.parts import part

Engine = Literal["mujoco", "planar"]
Way = Literal["new", "gone", "begins"]
"""Which recording has the effect: only the second, only the first, or the second from a moment on."""
BEGIN, END = "<!-- changed -->", "<!-- end of changed -->"

_STREAM, _MOMENTS = 17, 18  # random streams that no other suite uses
_MOMENT_S = 0.5  # largest error of the moment of a change
_KINDS = tuple(VEHICLES.values())
_SDS: tuple[Literal["half", "all", "none"], ...] = ("half", "all", "none")

# Labels from the README of the measured data: (before, after) -> name of an allowed change -> its range in percent.
LABELLED: Mapping[tuple[str, str], Mapping[str, tuple[float, float]]] = {
    ("shaft_damper_off", "shaft_damper_on"): {"kV": (33, 43)},
    ("shaft_damper_on", "shaft_damper_off"): {"kV": (-30.1, -24.8)},
    ("wheel_in_air", "wheel_on_ground"): {"dry friction in volts": (45, 95), "kA": (40, 130)},
    ("wheel_on_ground", "wheel_in_air"): {"dry friction in volts": (-48.7, -31.0), "kA": (-56.5, -28.6)},
}


@dataclass(frozen=True)
class Pair:
    """Two recordings of an engine.

    Attributes:
        effect: the effect that only one recording has; None: the recordings do not differ.
        size: ratio of the effect's size to its clearly visible size.
        way: which recording has the effect.
        index: number of the pair in its suite.
    """

    engine: Engine
    effect: str | None
    size: float
    way: Way
    index: int
    seed_offset: int

    @property
    def name(self) -> str:
        way = "" if self.effect is None else f"-{self.way}"
        return f"{self.engine}-{self.effect or 'nothing'}{way}-{self.size:g}-{self.index}-{self.seed_offset}"

    def recipes(self) -> tuple[Recipe, Recipe]:
        """Returns the recipes of both recordings; index and seed offset give vehicle, voltages and noise."""
        random = np.random.default_rng((_STREAM, self.seed_offset, self.index))
        vehicle = specimen(_KINDS[self.index % len(_KINDS)], random)
        absent = effects.TABLE[self.effect].absent if self.effect in effects.TABLE else ()
        vehicle = replace(vehicle, **dict.fromkeys(absent, 0.0))
        drawn: Hidden = {} if self.effect is None else {self.effect: self._drawn(vehicle, random)}
        sound, changed = (
            Recipe(
                name=f"{self.name}-{number}",
                hidden=hidden,
                vehicle=vehicle,
                engine=self.engine,
                runs=scales.at_voltage(varied(short(), random), vehicle),
                seed=self.seed_offset + 1000 * _STREAM + 10 * self.index + number,
                sds=_SDS[self.index % 3],
                frame="FLU" if self.index % 2 else "FRD",
                noise_sd_stated=self.index % 3 != 2,
            )
            for number, hidden in enumerate(({}, drawn))
        )
        if self.way == "begins":
            changed = replace(changed, begins=self._begins(changed.runs))
        return (changed, sound) if self.way == "gone" else (sound, changed)

    def _begins(self, runs: Sequence[Manoeuvre]) -> Onset:
        """Returns a moment in the middle of a run; runs follow and precede."""
        random = np.random.default_rng((_MOMENTS, self.seed_offset, self.index))
        run = int(random.integers(1, len(runs) - 1))
        return Onset(run, round(float(random.uniform(0.2, 0.8)) * runs[run].duration_s, 3))

    def _drawn(self, vehicle: Any, random: np.random.Generator) -> Mapping[str, float]:
        assert self.effect is not None
        return other_laws.draw(self.effect, self.size, vehicle, random)


def pairs(engine: Engine, size: float, nulls: int, seed_offset: int) -> Iterator[Pair]:
    """Yields a pair for each effect and each `Way` that the engine has, and pairs without a difference."""
    for index, effect in enumerate(effects.LIBRARY):
        for way in ("new", "gone", "begins"):
            if way != "begins" or (engine == "planar" and effect not in planar_engine.CARRYING):
                yield Pair(engine, effect, size, way, index, seed_offset)
    for index in range(nulls):
        yield Pair(engine, None, 0.0, "new", 1000 + index, seed_offset)


def ask(pair: Pair, data: Path, jobs: int) -> dict[str, Any]:
    """Returns a summary of the answer for a pair, with its score."""
    recipes = pair.recipes()
    made = [data / one.name if (data / one.name).is_dir() else folder.write(one, data) for one in recipes]
    began = time.perf_counter()
    said = _short(bp.changed(*made, jobs=jobs))
    truth = None if pair.effect is None else catalogue.effect(pair.effect).mechanism
    return {
        "name": pair.name,
        **dataclasses.asdict(pair),
        "seed": pair.seed_offset,
        "measured": measured.state(),
        **said,
        "score": score(said, truth),
        "moment": moment_is_right(said, recipes[1], json.loads((data / f"{recipes[1].name}.truth.json").read_text())),
        "seconds": round(time.perf_counter() - began, 1),
    }


def _short(found: bp.Changed) -> dict[str, Any]:
    told = found.to_dict()
    keys = ("what", "mechanism", "side", "before", "after", "change", "percent", "since", "rivals", "weight")
    return {"verdict": told["verdict"], "changes": [{key: one[key] for key in keys} for one in told["changes"]]}


def score(said: Mapping[str, Any], truth: str | None) -> str:
    """Returns the score of an answer. `truth`: the mechanism that differs; None: nothing differs."""
    verdict, names = said["verdict"], {one["mechanism"] for one in said["changes"]}
    if truth is None:
        return "right" if verdict == "nothing" else "wrong" if verdict == "changed" else verdict
    if verdict in ("nothing", "unknown"):
        return str(verdict)
    if truth not in names:
        return "wrong" if verdict == "changed" else "not among rivals"
    if verdict == "ambiguous":
        return "among rivals"
    return "right" if names == {truth} else "right, and an extra name"


def moment_is_right(said: Mapping[str, Any], recipe: Recipe, truth: Mapping[str, Any]) -> bool | None:
    """Returns whether the first change has the right moment; None: the effect acts always, or no change is told.

    A moment is right from 0.5 s before the effect begins to 0.5 s after it first shows. The effect shows where `truth`
    has a region: it may not act in the manoeuvre in which it begins.
    """
    begins = recipe.begins
    if begins is None or not said["changes"]:
        return None
    names = [run.name for run in recipe.runs]
    starts = np.cumsum([0.0, *(run.duration_s for run in recipe.runs)]).tolist()
    clock = dict(zip(names, starts, strict=False))
    first = clock[names[begins.run]] + begins.at_s
    shows = [max(clock[one["run"]] + one["from_s"], first) for one in truth["regions"]]
    since = said["changes"][0]["since"]
    told = clock[since["run"]] + since["at_s"] if since else 0.0
    return bool(first - _MOMENT_S <= told <= min(shows, default=first) + _MOMENT_S)


def labelled(data: Path, jobs: int) -> Iterator[dict[str, Any]]:
    """Yields the answers for labelled pairs of real machines, and whether an interval overlaps the labelled range."""
    for (before, after), label in LABELLED.items():
        if not ((data / before).is_dir() and (data / after).is_dir()):
            continue
        said = _short(bp.changed(data / before, data / after, jobs=jobs))
        told = {one["what"]: one["percent"]["ci95"] for one in said["changes"] if one["percent"]}
        holds = {
            what: bool(what in told and told[what][0] <= high and told[what][1] >= low)
            for what, (low, high) in label.items()
        }
        right = {one["what"] for one in said["changes"]} == {*label}
        yield {"name": f"{before} -> {after}", **said, "right": right, "intervals": holds}


def halves(data: Path, jobs: int) -> Iterator[dict[str, Any]]:
    """Yields the answer for the two halves of each measured log, between which nothing should change."""
    for place in sorted(one.parent for one in data.glob("*/dataset.toml")):
        dataset = bp.read(place)
        first, second = (replace(part(dataset, index, 2), name=f"half {index + 1}") for index in range(2))
        said = _short(bp.changed(first, second, jobs=jobs))
        yield {"name": place.name, **said, "right": said["verdict"] == "nothing"}


def lines(results: Iterable[Mapping[str, Any]]) -> list[str]:
    """Returns the table in Markdown: the scores for each kind of pair."""
    rows = [one for one in results if "score" in one]
    real = [one for one in results if "right" in one]
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for one in sorted(rows, key=lambda one: (not one["effect"], -one["size"])):
        kinds.setdefault(f"{one['way']}, size {one['size']:g}" if one["effect"] else "nothing", []).append(one)
    columns = ("right", "right, and an extra name", "among rivals", "unknown", "nothing", "not among rivals", "wrong")
    made = [f"| what differs | pairs | {' | '.join(columns)} |", f"|---|---|{'---|' * len(columns)}"]
    for kind, some in kinds.items():
        counts = Counter(one["score"] for one in some)
        made.append(f"| {kind} | {len(some)} | {' | '.join(str(counts[name]) for name in columns)} |")
    timed = [one["moment"] for one in rows if one["moment"] is not None]
    if timed:
        made += [
            "",
            f"- The moment is right within {_MOMENT_S:g} s in {sum(timed)} of {len(timed)} changes that begin.",
        ]
    made += ["", f"- {measured.told((one.get('measured') for one in rows), 'pairs')}.".replace("- m", "- M")]
    for one in real:
        made.append(f"- {one['name']}: {_told(one)}")
    return made


def _told(one: Mapping[str, Any]) -> str:
    says = ", ".join(_change(change) for change in one["changes"]) or one["verdict"]
    return f"{one['verdict']}, {says}" if one["changes"] else str(says)


def _change(one: Mapping[str, Any]) -> str:
    percent = one["percent"]
    size = f" {percent['value']:+.0f} % [{percent['ci95'][0]:.0f}, {percent['ci95'][1]:.0f}]" if percent else ""
    return f"{one['what']}{size}"


def chosen(asked: Sequence[Pair], limit: int | None) -> Sequence[Pair]:
    """Returns the first `limit` pairs with an effect, and as many without an effect; None: all pairs."""
    if limit is None:
        return asked
    with_effect = [one for one in asked if one.effect]
    return [*with_effect[:limit], *[one for one in asked if not one.effect][:limit]]
