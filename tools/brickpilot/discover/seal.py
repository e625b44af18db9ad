"""The seal: held-out runs are used once, after the last choice, to test the model as read back from its file.

Held-out runs may withdraw a name, or make the nominal model its rival (`ambiguous`). They choose nothing else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brickpilot.data.dataset import Dataset, motor_inputs
from brickpilot.data.gap import Gap, gaps
from brickpilot.data.motion import cut_into_windows, run_of
from brickpilot.discover import numbers
from brickpilot.discover.evidence import Judge, bootstrap
from brickpilot.discover.finding import Evidence, EvidenceKind
from brickpilot.fit.residual import Residual, of_bins
from brickpilot.fit.robust import pseudo_huber_loss
from brickpilot.vehicle.compared_runs import Comparable
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import Outputs, Replay

if TYPE_CHECKING:
    from brickpilot.discover.prepare import Prepared

Array = NDArray[np.float64]

_CONFIRMED = "Held-out runs confirm it: it removes {} of their error above noise, and {} of that of the fit runs."
_NO_RUNS = "No run was held out, so only the fit runs show it."
_NOT_EXCITED = "The held-out runs do not excite it, so only the fit runs show it."
_WEAK = "The held-out runs speak for it, but not surely."
_CONTRADICTED = "It explains the fit runs, but the held-out runs do not confirm it: {}."
_GROWS, _RATHER = "the error of free runs grows", "in only {:.0f} of 100 draws of stretches it predicts them better"


class SealError(RuntimeError):
    """The seal was opened a second time: something was chosen after the last check."""


@dataclass(frozen=True)
class Opened:
    """The whole data set.

    Attributes:
        whole: the data set without channels that contradict the model, with an sd on every nominal value and with
            averaged start states.
        plain: the same runs as measured, prepared as in `compare` and `calibrate`, for the headline numbers.
    """

    whole: Dataset
    plain: Comparable


class Sealed:
    """A data set whose held-out runs no stage has used. It can be opened once."""

    __slots__ = ("__contents",)

    def __init__(self, whole: Dataset, plain: Comparable) -> None:
        self.__contents: Opened | None = Opened(whole, plain)

    def open(self) -> Opened:
        """Returns the whole data set.

        Raises:
            SealError: the seal was opened before.
        """
        if self.__contents is None:
            raise SealError("the held-out runs were opened before")
        contents, self.__contents = self.__contents, None
        return contents


@dataclass(frozen=True)
class Proof:
    """The test of a model on the held-out runs.

    Attributes:
        opened: the whole data set.
        evidence: the evidence for the model; None: nothing was added to the nominal model.
        simulated: "nominal", "augmented" -> run -> outputs, over whole runs.
        gap: "fit", "held_out" -> gap. `by_signal`: signal -> gap over all runs.
    """

    opened: Opened
    evidence: Evidence | None
    simulated: Mapping[str, Mapping[str, Outputs]]
    gap: Mapping[str, Gap]
    by_signal: Mapping[str, Gap]

    @property
    def is_confirmed(self) -> bool:
        return self.evidence is not None and self.evidence.kind == "held_out"

    @property
    def is_contradicted(self) -> bool:
        return self.evidence is not None and self.evidence.contradicted


def prove(
    prepared: Prepared, sealed: Sealed, nominal: Model, written: Model, by_run: Mapping[str, Mapping[str, float]]
) -> Proof:
    """Opens the seal, and returns the test of the written model on the held-out runs.

    Args:
        nominal: the calibrated nominal model.
        written: the model of the last choice, as read back from its file.
        by_run: the fitted values of single runs, as `Model.by_run`. No file holds these values. They also apply to
            held-out stretches of these runs; a wholly held-out run has no known value.
    """
    opened = sealed.open()
    outputs = Replay(opened.whole).simulate([nominal, written], threads=prepared.jobs)
    simulated = dict(zip(("nominal", "augmented"), outputs, strict=True))
    gap, by_signal = gaps(opened.whole, simulated, prepared.roles, prepared.fine.sample_noise)
    added = nominal.effects.keys() != written.effects.keys()
    fitted = dataclasses.replace(written, by_run=by_run)
    evidence = _evidence(prepared, opened, nominal, fitted, grows=gap["held_out"].grows) if added else None
    return Proof(opened, evidence, simulated, gap, by_signal)


def unproved(proof: Proof, nominal: Model) -> Proof:
    """Returns the proof of the nominal model alone, for use if the held-out runs contradict the augmented model."""
    return dataclasses.replace(
        proof,
        simulated={one: proof.simulated["nominal"] for one in ("nominal", "augmented")},
        gap={role: Gap(one.before, one.before) for role, one in proof.gap.items()},
        by_signal={name: Gap(one.before, one.before) for name, one in proof.by_signal.items()},
    )


def _evidence(prepared: Prepared, opened: Opened, nominal: Model, written: Model, *, grows: bool) -> Evidence:
    """Returns the evidence for the written model. `grows`: whether its held-out gap is larger than the nominal gap."""
    removed_fit = _removed(prepared.fine, nominal, written)
    held_out = _held_out(prepared, opened)
    if held_out is None:
        return Evidence("fitted_only", removed_fit, None, None, False, _NO_RUNS)
    judge = Judge.of(held_out, prepared.seed)
    before, after = held_out.predict([nominal, written])
    rises = judge.rises(held_out.measured - before, held_out.measured - after)
    drawn = bootstrap(judge.count) @ rises
    draws = float(np.mean(drawn > 0))
    shown = float(pseudo_huber_loss((after - before) * held_out.weight()).sum()) > numbers.CHANCE_NATS
    confirmed = shown and draws >= numbers.SURE and not grows
    contradicted = shown and (grows or float(np.median(drawn)) <= 0)  # the draws favour the nominal model
    kind: EvidenceKind = "held_out" if confirmed else "fitted_only"
    removed = _removed(held_out, nominal, written)
    shares = ["nothing" if share is None else f"{100 * share:.0f} %" for share in (removed, removed_fit)]
    against = _CONTRADICTED.format(_GROWS if grows else _RATHER.format(100 * draws))
    doubt = against if contradicted else _WEAK if shown else _NOT_EXCITED
    return Evidence(kind, removed_fit, removed, draws, contradicted, _CONFIRMED.format(*shares) if confirmed else doubt)


def _held_out(prepared: Prepared, opened: Opened) -> Residual | None:
    """Returns the residual of the held-out data, weighed like that of the fit runs; None: no data are held out."""
    tested = set(prepared.roles.tested())
    if not tested:
        return None
    whole = opened.whole
    compared = whole
    if prepared.windowed:
        inputs = {run.name: motor_inputs(run, whole) for run in whole.runs}
        lengths = [float(run.time[-1] - run.time[0]) for run in prepared.compared.runs if run.outputs]
        compared = cut_into_windows(whole, inputs, float(np.median(lengths))) or whole
    samples = dataclasses.replace(
        compared, runs=tuple(prepared.roles.samples(run, "held_out", run_of(run.name)) for run in compared.runs)
    )
    names = [run.name for run in compared.runs if run_of(run.name) in tested]
    data = of_bins(compared, prepared.plan.model, names, width_s=numbers.BIN_S, samples=samples, threads=prepared.jobs)
    return data.weighed_like(prepared.fine)


def _removed(data: Residual, nominal: Model, written: Model) -> float | None:
    """Returns the removed share, at most 1, of the nominal model's cost above noise; None: no cost is above noise."""
    before, after = (float(data.losses(model).sum()) for model in (nominal, written))
    noise = data.noise_cost()
    return min(1.0, (before - after) / (before - noise)) if before > noise else None
