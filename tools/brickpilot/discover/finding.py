"""What discovery found. verdict.json and the report are written from it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import brickpilot
from brickpilot.data.dataset import Dataset, Fault
from brickpilot.discover.yardstick.record import Yardstick
from brickpilot.fit.replay import Outputs
from brickpilot.fit.run_values import RunValues
from brickpilot.fit.spread import Spread
from brickpilot.vehicle.model import Model

if TYPE_CHECKING:
    import pandas

VerdictKind = Literal["none", "named", "ambiguous", "unknown"]
EvidenceKind = Literal["held_out", "fitted_only"]

NOMINAL_VALUES = "nominal values"
"""Stands among the equivalent explanations where wrong nominal values explain the data as well as an effect."""


@dataclass(frozen=True)
class Identified:
    """A size in what the data identify, such as the voltage that makes up for a friction torque.

    Attributes:
        quantity: what it is, such as "voltage".
        formula: how it follows from the parameter, in the paper's symbols.
    """

    quantity: str
    formula: str
    value: float
    unit: str
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Parameter:
    """A fitted value, SI.

    Attributes:
        ci95: (low, high); None if the data do not determine it.
        identified: then, the form in which they do; None: in none.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None
    identified: Identified | None = None


@dataclass(frozen=True)
class Equivalent:
    """An equivalent model: an explanation that the data cannot tell from the best one.

    Attributes:
        name: an effect, several joined by " + ", or `NOMINAL_VALUES`.
        parameters: parameter -> value; the key is "effect.parameter" if there are several effects.
        worse_by: how much lower its log likelihood is than that of the best one.
        nominal, effects: every value of its model, SI, those that the data set states included.
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
        law: what its law is called, as in "FAMILY, but DIFFERENCE"; see `catalogue.law`.
        confidence: how often it comes first when stretches of the runs are drawn again, 0..1.
        removed: the share of the cost above that of noise that the explanation removes on the fit runs, 0..1.
        claimed: the verdict says that it is there. False: it explains the fit runs best, and nothing proves it.
        equivalents: the explanations that the data cannot tell from it.
    """

    name: str
    mechanism: str
    law: str
    acts_on: str
    equation: str
    confidence: float
    parameters: Mapping[str, Parameter]
    removed: float = 1.0
    claimed: bool = True
    equivalents: tuple[Equivalent, ...] = ()


@dataclass(frozen=True)
class Place:
    """Where the gap was: a time span of one signal of one run.

    Attributes:
        share_of_gap: its share of all squared change, in noise sd, that what was added to the model makes, 0..1.
        when: what the vehicle was doing.
    """

    run: str
    signal: str
    from_s: float
    to_s: float
    share_of_gap: float
    when: str


@dataclass(frozen=True)
class Gap:
    """rms of measured less simulated in a free run, over the noise sd, sample by sample. None: no such runs."""

    before: float | None
    after: float | None


@dataclass(frozen=True)
class Evidence:
    """What proves the augmented model. It is measured last, on the model as its file says.

    Attributes:
        kind: "held_out": the held-out runs confirm the model. "fitted_only": only fit runs show what it adds.
        removed_fit, removed_held_out: the share of the cost above that of noise that it removes, at most 1; below 0
            the model is worse. None: no such runs, or no cost above noise.
        draws: how often the cost on held-out runs falls when stretches of them are drawn again, 0..1; None: no such
            runs.
        contradicted: held-out runs speak against it; else they confirm it or say nothing.
        sentence: what this means, for a reader.
    """

    kind: EvidenceKind
    removed_fit: float | None
    removed_held_out: float | None
    draws: float | None
    contradicted: bool
    sentence: str


@dataclass(frozen=True)
class Budget:
    """The time that the user gave.

    Attributes:
        estimated_s: what a discovery without a limit takes on this machine, as estimated before the search.
        exhausted: something was left out to keep to it.
        skipped: what was left out, in order.
    """

    seconds: float
    estimated_s: float
    exhausted: bool
    skipped: tuple[str, ...]


@dataclass(frozen=True)
class Rank:
    """One explanation that was tried.

    Attributes:
        names: its effects.
        parameters: "effect.parameter" -> value, SI.
        gap: rms of its residual on the fit runs, over that of noise.
        removed: the share of the cost above that of noise that it removes, 0..1.
        why: a sentence on why it was taken or lost.
    """

    names: tuple[str, ...]
    parameters: Mapping[str, float]
    gap: float
    removed: float
    why: str


@dataclass(frozen=True)
class Whiteness:
    """How white the residual of a signal is.

    Attributes:
        correlation: autocorrelation at lags 1, 2, ... of `lag_s` seconds each.
        bound: white noise stays within it 95 % of the time.
    """

    lag_s: float
    correlation: tuple[float, ...]
    bound: float
    white: bool


@dataclass(frozen=True)
class Manoeuvre:
    """An experiment to run: break points (s, V) of each motor's command, linear between. A step repeats its time."""

    name: str
    duration_s: float
    voltage_left: tuple[tuple[float, float], ...]
    voltage_right: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Experiment:
    """What to do next.

    Attributes:
        advice: sentences for the user.
        separates: the rivals.
        separation: rms difference between the rivals in `signal`, in noise sd.
        signal: where they differ most, or the signal to measure as well.
        manoeuvre: None where no manoeuvre helps; `advice` says what does.
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
    """A nominal value as stated and as fitted. `leaves_prior`: the fit moved it by more than three of its sd."""

    before: float
    after: float
    unit: str
    sd: float | None
    leaves_prior: bool


@dataclass(frozen=True)
class NominalFinding:
    """A nominal value that left what was stated of it, whatever else the verdict says.

    Attributes:
        stated, fitted: SI.
        sd_away: how many sd of the stated value lie between them.
        rivals: effects that explain the data as well, with the value as it was stated; several joined by " + ".
    """

    parameter: str
    stated: float
    fitted: float
    unit: str
    sd_away: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class TermMatch:
    """A law of the library that does nearly the same to the data as a composed term.

    Attributes:
        law: what it is called, as in "FAMILY, but DIFFERENCE".
        correlation: 0 to 1, between what it and what the term do to the signals.
        is_equal: the term is this law under another name.
    """

    effect: str
    law: str
    mechanism: str
    correlation: float
    is_equal: bool


@dataclass(frozen=True)
class Term:
    """A composed term.

    Attributes:
        place: where it acts.
        equation, html: the equation as plain text and as MathML.
        file_name, source: its C file.
        matches: laws of the library that do nearly the same to the data, with the correlation of what they do.
        removed_held_out: the share of the gap on held-out runs that it removes; None if no run is held out.
    """

    place: str
    equation: str
    html: str
    file_name: str
    source: str
    removed_held_out: float | None
    matches: tuple[TermMatch, ...] = ()


@dataclass(frozen=True)
class Finding:
    """All that discovery says about a data set.

    Attributes:
        effects: the named effects; for `ambiguous` the best explanation, with its rivals in `equivalents`; for
            `unknown` the best names, which are not claimed, or those beside a term, which are.
        mechanism: the kind of cause that explains most; None if nothing is missing or nothing points at one.
        law_differs: what the claimed effects leave is more than noise: their laws are not quite right, or something
            smaller is missing too. None: no effect is claimed.
        evidence: None if no effect and no term was added.
        gap: "fit", "held_out" -> gap. `by_signal` is over all runs.
        nominal_model: the calibrated nominal model.
        augmented: the model that is written to model.toml.
        simulated: "nominal", "augmented" -> run -> outputs.
        ranking: every explanation that was fitted, the best first.
        power: effect -> the smallest size that would have been named. Effects that nothing here excites are absent.
        notes: sentences on what was assumed, left out or not identifiable.
        held_out_stretches: fit run -> first and last time of the samples that were held out of it, s on its clock.
        yardstick: fit in percent before, after and attainable.
        run_values: what differs from run to run, each kind once.
        spread: how the fitted parameters may lie about their estimates, all together; None: nothing was fitted.
    """

    dataset: Dataset
    verdict: VerdictKind
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
    yardstick: Yardstick = dataclasses.field(default_factory=Yardstick)
    budget: Budget | None = None
    run_values: tuple[RunValues, ...] = ()
    law_differs: bool | None = None
    spread: Spread | None = None

    def to_frame(self, table: Literal["effects", "ranking"] = "effects") -> pandas.DataFrame:
        """Returns a table.

        Args:
            table: "effects": a row for each parameter of each effect, in SI, with the ends of its 95 % interval, NaN
                where the data do not determine it. "ranking": a row for each explanation that was tried, the best
                first, with the share of the error above noise that it removes on the fit runs.
        """
        import pandas

        if table == "ranking":
            ranks = [(" + ".join(one.names), one.gap, one.removed, one.why) for one in self.ranking]
            return pandas.DataFrame(ranks, columns=["effects", "gap", "removed", "why"])
        nothing = (float("nan"), float("nan"))
        rows = [
            (effect.name, effect.claimed, effect.confidence, name, one.value, one.unit, *(one.ci95 or nothing))
            for effect in self.effects
            for name, one in effect.parameters.items()
        ]
        columns = ["effect", "claimed", "confidence", "parameter", "value", "unit", "low", "high"]
        return pandas.DataFrame(rows, columns=columns)

    def _repr_html_(self) -> str:
        """Returns the table that a notebook shows; the pages' room makes it, which this one must not know."""
        return brickpilot.to_html(self)
