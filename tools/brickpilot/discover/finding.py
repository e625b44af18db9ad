"""The finding of a discovery. verdict.json and the report are written from it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from brickpilot import __version__
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset
from brickpilot.data.feedback import Loop
from brickpilot.data.gap import Gap, Place
from brickpilot.data.periods import Period
from brickpilot.data.shown import Result, valid
from brickpilot.fit.uncertainty import Combination
from brickpilot.vehicle import composed_terms
from brickpilot.vehicle.manoeuvres import Manoeuvre
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Outputs
from brickpilot.vehicle.spread import Spread

if TYPE_CHECKING:
    import pandas

    from brickpilot.discover.yardstick import Yardstick

VerdictKind = Literal["none", "named", "ambiguous", "unknown"]
EvidenceKind = Literal["held_out", "fitted_only"]

NOMINAL_VALUES = "nominal values"
"""Name of the equivalent explanation in which wrong nominal values explain the data as well as an effect does."""


@dataclass(frozen=True)
class Parameter:
    """A fitted value, SI.

    Attributes:
        ci95: (low, high), the 95 % interval; None if the data do not determine the value.
        identified: if `ci95` is None: a combination of values that the data do determine, such as the voltage that
            overcomes a friction torque; it has the sign of `value`. None: there is no such combination.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None
    identified: Combination | None = None

    def to_json(self) -> dict[str, Any]:
        """Returns the entry of verdict.json, in which the name of `identified` is called "quantity"."""
        form = self.identified
        return vars(self) | {"identified": form and _without(form, "name") | {"quantity": form.name}}


@dataclass(frozen=True)
class Equivalent:
    """An equivalent model: an explanation that the data cannot tell from the best one.

    Attributes:
        name: one effect, several effects joined by " + ", or `NOMINAL_VALUES`.
        parameters: parameter -> value; the key is "effect.parameter" if there are several effects.
        worse_by: how much worse it predicts than the best explanation, in nats; 3 nats count as sure.
        nominal, effects: every value of its model, SI, including those that the data set states.
    """

    name: str
    parameters: Mapping[str, Parameter]
    worse_by: float
    nominal: Mapping[str, float] = dataclasses.field(default_factory=dict)
    effects: Mapping[str, Mapping[str, float]] = dataclasses.field(default_factory=dict)


@dataclass(frozen=True)
class Effect:
    """One effect of the best explanation.

    Attributes:
        mechanism: the kind of cause; see `EffectInfo.mechanism`.
        law: the name of its law, as in "FAMILY, but DIFFERENCE"; see `catalogue.law`.
        confidence: the share, 0..1, of the weight of `Finding.explanations` that explanations with this effect hold.
        removed: the explanation's evidence on a scale from 0 (the nominal model) to 1 (a residual of noise alone).
        claimed: whether the verdict claims the effect. False: the effect explains the fit runs best, without proof.
        equivalents: the explanations that the data cannot tell from the best one.
    """

    name: str
    mechanism: str
    law: str
    acts_on: str
    confidence: float
    parameters: Mapping[str, Parameter]
    removed: float = 1.0
    claimed: bool = True
    equivalents: tuple[Equivalent, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """The proof of the augmented model. It is measured last, on the model as read back from its file.

    Attributes:
        kind: "held_out": the held-out runs confirm the model. "fitted_only": only fit runs show what the model adds.
        removed_fit, removed_held_out: the share of the nominal model's cost above noise that the model removes, at most
            1; negative: the model is worse. None: there are no such runs, or no cost is above noise.
        draws: share, 0..1, of the bootstrap draws of stretches in which the model predicts the held-out runs better
            than the nominal model does; None: nothing is held out.
        contradicted: whether the held-out runs excite what the model adds, and contradict it.
        sentence: what these numbers mean, for the reader of a report.
    """

    kind: EvidenceKind
    removed_fit: float | None
    removed_held_out: float | None
    draws: float | None
    contradicted: bool
    sentence: str


@dataclass(frozen=True)
class Share:
    """One of the explanations that hold 95 % of the weight together.

    Attributes:
        effects: the names of its parts; empty: the nominal model alone.
        weight: its weight, 0..1.
        mechanisms: the kinds of cause of its parts.
    """

    effects: tuple[str, ...]
    weight: float
    mechanisms: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """A stage that set or changed the verdict.

    Attributes:
        stage: "weigh", "adequacy", "budget", "runs", "samples" or "seal": see `pipeline`.
        verdict: the verdict after this stage.
        why: a sentence.
    """

    stage: str
    verdict: VerdictKind
    why: str


@dataclass(frozen=True)
class Predictor:
    """The model that predicts best, if the user asked for it. It claims no cause.

    Attributes:
        model: the model that `--predictor` writes.
        parts: the names of its parts.
        fit_percent: signal -> "fit" or "held_out" -> fit of free runs, in percent; None: no such runs.
    """

    model: Model
    parts: tuple[str, ...]
    fit_percent: Mapping[str, Mapping[str, float | None]]


@dataclass(frozen=True)
class RunValues:
    """Values of one kind that differ from run to run.

    Attributes:
        kind: the name of this kind of value in verdict.json.
        words: the subject of `sentence`; it names what differs.
        unit: the SI unit; "1": the values are shares.
        runs: fit run -> value and its 95 % interval. The value of a held-out run is unknown: 0 is used.
    """

    kind: str
    words: str
    unit: str
    runs: Mapping[str, tuple[float, tuple[float, float]]]

    def to_json(self) -> dict[str, Any]:
        """Returns the entry of verdict.json."""
        runs = {name: {"value": value, "ci95": list(ci95)} for name, (value, ci95) in self.runs.items()}
        return {"kind": self.kind, "unit": self.unit, "runs": runs, "sentence": self.sentence()}

    def sentence(self) -> str:
        """Returns a sentence that states the range of the values."""
        size, suffix = (100.0, " %") if self.unit == "1" else (1.0, f" {self.unit}")
        least = min(self.runs, key=lambda name: self.runs[name][0])
        most = max(self.runs, key=lambda name: self.runs[name][0])
        low, high = (size * self.runs[name][0] for name in (least, most))
        return (
            f"{self.words} differs from run to run: from {low:+.2g}{suffix} ({least}) to {high:+.2g}{suffix} ({most}) "
            "beside the value of the model. The value of a held-out run is not known, so it was simulated without one."
        )


@dataclass(frozen=True)
class Budget:
    """The time limit that the user gave.

    Attributes:
        estimated_s: time of a discovery without a limit on this machine, estimated before the search.
        exhausted: whether work was left out to keep the limit.
        skipped: the work that was left out, in order.
    """

    seconds: float
    estimated_s: float
    exhausted: bool
    skipped: tuple[str, ...]


@dataclass(frozen=True)
class Rank:
    """One explanation that was tried.

    Attributes:
        names: the names of its parts.
        parameters: "effect.parameter" -> value, SI.
        prediction_error: ratio of error to noise on left-out stretches, computed from the log density, not from an rms.
        removed: its evidence on a scale from 0 (the nominal model) to 1 (a residual of noise alone).
        why: a sentence that says why it was chosen or not.
    """

    names: tuple[str, ...]
    parameters: Mapping[str, float]
    prediction_error: float
    removed: float
    why: str


@dataclass(frozen=True)
class Whiteness:
    """How white the residual of a signal is.

    Attributes:
        correlation: autocorrelation at lags 1, 2, ... of `lag_s` seconds each.
        bound: the correlation of white noise at a lag is between -`bound` and `bound` with 95 % probability.
    """

    lag_s: float
    correlation: tuple[float, ...]
    bound: float
    white: bool


@dataclass(frozen=True)
class Experiment:
    """What to do next.

    Attributes:
        advice: sentences for the user.
        separates: the names of the rivals that the manoeuvre separates.
        separation: rms difference between the rivals in `signal`, in noise sd.
        signal: the signal in which the rivals differ most, or a further signal to measure.
        manoeuvre: None: no manoeuvre helps, and `advice` says what to do instead.
    """

    advice: str
    separates: tuple[str, ...]
    separation: float
    signal: str | None
    manoeuvre: Manoeuvre | None


@dataclass(frozen=True)
class Visible:
    """The smallest size of an effect that discovery would have named in these data."""

    parameter: str
    size: float
    unit: str


@dataclass(frozen=True)
class NominalChange:
    """A nominal value as stated and as fitted. `leaves_prior`: whether they are further apart than chance explains."""

    before: float
    after: float
    unit: str
    sd: float | None
    leaves_prior: bool


@dataclass(frozen=True)
class NominalFinding:
    """A nominal value whose fit is further from the stated value than chance explains, whatever the verdict is.

    Attributes:
        stated, fitted: SI.
        sd_away: the distance between the two values, in sd of the stated value.
        rivals: explanations that predict as well with the stated value; several effects are joined by " + ".
    """

    parameter: str
    stated: float
    fitted: float
    unit: str
    sd_away: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Term:
    """A composed term.

    Attributes:
        acts_on: where it acts.
        equation: plain text, with the meaning of its symbols.
        source: the name of its C file.
        law, settings: its basis terms with coefficients, and the parameters that shape these terms, SI.
        removed_held_out: the share of the held-out cost above noise that the model removes; None: nothing is held out.
    """

    acts_on: str
    equation: str
    source: str
    law: tuple[composed_terms.Term, ...]
    settings: Mapping[str, float]
    removed_held_out: float | None


@dataclass(frozen=True)
class Finding(Result):
    """All that discovery says about a data set.

    Attributes:
        effects: the effects of the best explanation; for `unknown`, candidates (not claimed) or the effects beside a
            composed term (claimed). Empty for `none`.
        mechanism: the kind of cause that explains most; None if nothing is missing or no mechanism was found.
        law_differs: True: the claimed effects leave more than noise in some signal, so their laws are not quite right,
            or a smaller effect is missing too. None: no effect is claimed, or a composed term stands beside them.
        evidence: what proves the augmented model; None: no effect and no term was added.
        gap: "fit" or "held_out" -> the `Gap` of these runs. by_signal: signal -> the `Gap` of all runs.
        nominal_model: the calibrated nominal model.
        augmented: the model that is written to model.toml.
        simulated: "nominal", "augmented" -> run -> outputs.
        ranking: every explanation that was weighed, the best first.
        power: effect -> the smallest size that would have been named. Effects that the runs do not excite are absent.
        notes: sentences on what was assumed, left out or not identifiable.
        held_out_stretches: fit run -> first and last time of the samples held out of this run, s on the run's clock.
        yardstick: fit, in percent, of the nominal model and of the augmented model, and the attainable fit.
        explanations: the explanations that together hold 95 % of the weight, the heaviest first.
        steps: the stages that set or changed the verdict; the last step gives `verdict`.
        predictable_left: signal -> the share of the best explanation's squared residual that a black box predicts.
        predictor: the model that predicts best; None: the user did not ask for it.
        closed_loop: the feedback loop in which the runs were recorded; None: no command depends on an output.
        disturbances: signal -> a disturbance periodic in time; searched for only if there is a feedback loop.
        run_values: the values that differ from run to run, one entry for each kind.
        spread: the joint uncertainty of all fitted parameters; None: nothing was fitted.
    """

    dataset: Dataset
    verdict: VerdictKind
    yardstick: Yardstick
    mechanism: str | None
    evidence: Evidence | None
    effects: tuple[Effect, ...]
    where: tuple[Place, ...]
    gap: Mapping[str, Gap]
    by_signal: Mapping[str, Gap]
    nominal: Mapping[str, NominalChange]
    nominal_findings: tuple[NominalFinding, ...]
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
    held_out_stretches: Mapping[str, tuple[float, float]] = dataclasses.field(default_factory=dict)
    explanations: tuple[Share, ...] = ()
    steps: tuple[Step, ...] = ()
    predictable_left: Mapping[str, float] | None = None
    predictor: Predictor | None = None
    closed_loop: Loop | None = None
    disturbances: Mapping[str, Period] = dataclasses.field(default_factory=dict)
    budget: Budget | None = None
    run_values: tuple[RunValues, ...] = ()
    law_differs: bool | None = None
    spread: Spread | None = None

    def to_frame(self, table: Literal["effects", "ranking"] = "effects") -> pandas.DataFrame:
        """Returns a table.

        Args:
            table: "effects": a row for each parameter of each effect, in SI, with the ends of its 95 % interval; the
                ends are NaN if the data do not determine the parameter. "ranking": a row for each explanation that was
                tried, the best first; for `removed` see `Rank`.
        """
        import pandas

        if table == "ranking":
            ranks = [(" + ".join(one.names), one.prediction_error, one.removed, one.why) for one in self.ranking]
            return pandas.DataFrame(ranks, columns=["effects", "prediction_error", "removed", "why"])
        nothing = (float("nan"), float("nan"))
        rows = [
            (effect.name, effect.claimed, effect.confidence, name, one.value, one.unit, *(one.ci95 or nothing))
            for effect in self.effects
            for name, one in effect.parameters.items()
        ]
        columns = ["effect", "claimed", "confidence", "parameter", "value", "unit", "low", "high"]
        return pandas.DataFrame(rows, columns=columns)


_AS_THEY_ARE = (
    "verdict", "mechanism", "law_differs", "explanations", "steps", "predictable_left", "closed_loop", "disturbances",
    "effects", "where", "nominal", "spread", "nominal_findings", "run_values", "power", "ranking", "roles",
    "held_out_stretches", "notes", "elapsed_s", "budget", "seed",
)  # fmt: skip


def verdict_json(found: Finding) -> dict[str, Any]:
    """Returns the object of verdict.json: see report/verdict.schema.json. A number that is not finite becomes None."""
    experiment, manoeuvre = found.next_experiment, found.next_experiment and found.next_experiment.manoeuvre
    made: dict[str, Any] = valid(
        {name: getattr(found, name) for name in _AS_THEY_ARE}
        | {
            "evidence": found.evidence and found.evidence.kind,
            "proof": found.evidence,
            "fit_percent": found.yardstick.fit_json(),
            "predictable": found.yardstick.predictable_json(),
            "predictor": found.predictor and _without(found.predictor, "model"),
            "gap": {**found.gap, "unit": "residual rms / noise sd", "by_signal": found.by_signal},
            "data_faults": found.faults,
            # Scripts expect the manoeuvre's name and break points at the top level of `next_experiment`.
            "next_experiment": experiment
            and _without(experiment, "manoeuvre") | ({"name": None} if manoeuvre is None else vars(manoeuvre)),
            "term": found.term and _without(found.term, "law", "settings"),
            "frame": {"values": "FRD", "dataset": found.dataset.frame},
            "input_timing": found.dataset.input_timing,
            "version": __version__,
        }
    )
    return made


def _without(record: object, *names: str) -> dict[str, Any]:
    """Returns the fields of a record except `names`."""
    return {key: value for key, value in vars(record).items() if key not in names}
