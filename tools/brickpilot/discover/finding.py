"""What discovery found: the one record that verdict.json and the report are written from."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from brickpilot import __version__
from brickpilot.data.dataset import Dataset, Fault
from brickpilot.fit.replay import Outputs
from brickpilot.vehicle.model import Model

VerdictKind = Literal["none", "named", "ambiguous", "unknown"]


@dataclass(frozen=True)
class Parameter:
    """A fitted value, SI. `ci95`: (low, high); None where the data do not narrow it."""

    value: float
    unit: str
    ci95: tuple[float, float] | None


@dataclass(frozen=True)
class Equivalent:
    """Another explanation that the data cannot tell from the one given.

    Attributes:
        name: an effect, or several joined by " + ".
        parameters: "effect.parameter" where there are several effects, else the parameter -> its value.
        worse_by: fall in log likelihood beside the best one, for the data as they are.
    """

    name: str
    parameters: Mapping[str, Parameter]
    worse_by: float


@dataclass(frozen=True)
class Effect:
    """One effect that is named. `confidence`: how often it is found again when the manoeuvres are drawn anew, 0..1."""

    name: str
    acts_on: str
    equation: str
    confidence: float
    parameters: Mapping[str, Parameter]
    equivalents: tuple[Equivalent, ...] = ()


@dataclass(frozen=True)
class Place:
    """Where the gap was: a stretch of one signal of one run. `share_of_gap`: of all squared residual that went away."""

    run: str
    signal: str
    from_s: float
    to_s: float
    share_of_gap: float
    when: str


@dataclass(frozen=True)
class Gap:
    """rms of measured minus simulated over noise sd, sample by sample, from the inputs alone. None: no such runs."""

    before: float | None
    after: float | None


@dataclass(frozen=True)
class Rank:
    """One explanation that was tried, in the order of the ranking; the first is the best.

    Attributes:
        names: its effects.
        parameters: "effect.parameter" -> value, SI.
        gap: residual rms over noise sd on the fit runs with it.
        removed: share of the gap above the noise that it takes away, 0..1.
        why: a sentence on why it was taken, or lost.
    """

    names: tuple[str, ...]
    parameters: Mapping[str, float]
    gap: float
    removed: float
    why: str


@dataclass(frozen=True)
class Whiteness:
    """What is left looks like. `correlation`: at lags 1.. of `lag_s` s each; `bound`: 95 % of white noise."""

    lag_s: float
    correlation: tuple[float, ...]
    bound: float
    white: bool


@dataclass(frozen=True)
class Manoeuvre:
    """An experiment to run: break points (s, V) of either motor's command, linear between; a step repeats its time."""

    name: str
    duration_s: float
    voltage_left: tuple[tuple[float, float], ...]
    voltage_right: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Experiment:
    """What to do next. `separation`: noise sd, rms, between the rivals in the signal where they differ most.

    `manoeuvre` is None where no way of driving helps and another measurement is needed: `advice` says which.
    """

    advice: str
    separates: tuple[str, ...]
    separation: float
    signal: str | None
    manoeuvre: Manoeuvre | None


@dataclass(frozen=True)
class Visible:
    """The smallest size of an effect that these data would have shown."""

    parameter: str
    size: float
    unit: str


@dataclass(frozen=True)
class NominalChange:
    """A nominal value as stated and as fitted. `leaves_prior`: by more than three of its sd: a finding, not a fix."""

    before: float
    after: float
    unit: str
    sd: float | None
    leaves_prior: bool


@dataclass(frozen=True)
class Term:
    """A term composed for what has no name. `equation`: plain text; `html`: the same for a page; `source`: a C file."""

    place: str
    equation: str
    html: str
    file_name: str
    source: str
    removed_held_out: float


@dataclass(frozen=True)
class Finding:
    """All that discovery says of a data set.

    Attributes:
        effects: those named, the strongest first; for `ambiguous` the best explanation, its rivals in `equivalents`.
        gap: "fit", "held_out" -> gap; `by_signal` over all runs.
        nominal_model: the re-calibrated nominal model, `augmented`: what is written to model.toml.
        simulated: "nominal", "augmented" -> run -> outputs.
        ranking: every explanation that was fitted, best first.
        power: effect -> the smallest size that would have been found; of the effects that can show in these data.
        notes: what was taken for granted, left out or could not be told.
    """

    dataset: Dataset
    verdict: VerdictKind
    effects: tuple[Effect, ...]
    where: tuple[Place, ...]
    gap: Mapping[str, Gap]
    by_signal: Mapping[str, Gap]
    nominal: Mapping[str, NominalChange]
    next_experiment: Experiment | None
    ranking: tuple[Rank, ...]
    whiteness: Mapping[str, Whiteness]
    power: Mapping[str, Visible]
    term: Term | None
    nominal_model: Model
    augmented: Model
    simulated: Mapping[str, Mapping[str, Outputs]]
    roles: Mapping[str, str]
    faults: tuple[Fault, ...]
    notes: tuple[str, ...]
    noise_sd: Mapping[str, float]
    elapsed_s: float
    seed: int

    def to_json(self) -> dict[str, Any]:
        """The object of verdict.json (interfaces.md)."""
        return {
            "verdict": self.verdict,
            "effects": [_effect_json(effect) for effect in self.effects],
            "where": [dataclasses.asdict(place) for place in self.where],
            "gap": {
                **{role: dataclasses.asdict(gap) for role, gap in self.gap.items()},
                "unit": "residual rms / noise sd",
                "by_signal": {name: dataclasses.asdict(gap) for name, gap in self.by_signal.items()},
            },
            "nominal": {name: dataclasses.asdict(change) for name, change in self.nominal.items()},
            "data_faults": [fault.to_json() for fault in self.faults],
            "next_experiment": _plain(self.next_experiment),
            "term": None
            if self.term is None
            else {
                "acts_on": self.term.place,
                "equation": self.term.equation,
                "source": self.term.file_name,
                "removed_held_out": self.term.removed_held_out,
            },
            "power": {name: dataclasses.asdict(one) for name, one in self.power.items()},
            "ranking": [dataclasses.asdict(rank) for rank in self.ranking],
            "roles": dict(self.roles),
            "notes": list(self.notes),
            "elapsed_s": self.elapsed_s,
            "seed": self.seed,
            "version": __version__,
        }


def _effect_json(effect: Effect) -> dict[str, Any]:
    entry: dict[str, Any] = dataclasses.asdict(effect)
    entry.pop("equation")
    return entry


def _plain(experiment: Experiment | None) -> dict[str, Any] | None:
    """The experiment with its manoeuvre's name and break points at the top, as a script would drive it."""
    if experiment is None:
        return None
    entry = dataclasses.asdict(experiment)
    manoeuvre = entry.pop("manoeuvre")
    return entry | (manoeuvre or {"name": None})
