"""What held-out runs say of a change of the model: whether they show it, and whether the cost falls as it should."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from brickpilot.discover import gates
from brickpilot.discover.binned_error import BinnedOutputError
from brickpilot.discover.finding import Evidence, EvidenceKind, Gap
from brickpilot.discover.locate import residual
from brickpilot.discover.prepare import Prepared
from brickpilot.fit.replay import Outputs
from brickpilot.fit.robust import pseudo_huber_loss
from brickpilot.vehicle.model import Model

_DRAWS = 400  # of the bootstrap
_CONFIRMED = "Held-out runs confirm it."
_NO_RUNS = "No run was held out, so only the fit runs show it."
_NOT_EXCITED = "The held-out runs do not excite it, so only the fit runs show it."
_CONTRADICTED = "It explains the fit runs, but the held-out runs contradict it."
_PARTLY = "It explains the fit runs, but little of the error of the held-out runs: something else is different in them."
_MIXED = "On the held-out runs most signals improve with it, but the gap as a whole does not fall."
_GROWS = "It explains the fit runs, but the error of a free run on the held-out runs grows, so it was not added."


@dataclass(frozen=True)
class HeldOutChange:
    """What a change of the model does to the cost on held-out runs.

    Attributes:
        before, after: the cost with the smaller and with the larger model, without priors.
        claimed: the cost of the difference of the two simulations: how far the cost falls if the larger model is true.
        least: a smaller difference is not visible here.
        noise: the cost that noise alone would leave.
        draws: how often the cost falls when stretches of time are drawn again, 0..1.
    """

    before: float
    after: float
    claimed: float
    least: float
    noise: float
    draws: float

    @property
    def is_excited(self) -> bool:
        """Whether the two models differ visibly on these runs."""
        return self.claimed > self.least

    @property
    def is_confirmed(self) -> bool:
        """Whether the cost falls by enough of what the larger model claims."""
        return self.is_excited and self.before - self.after > gates.HELD_OUT_SHARE * self.claimed

    @property
    def is_contradicted(self) -> bool:
        """Whether the models differ visibly, and the cost does not fall as the larger one claims."""
        return self.is_excited and not self.is_confirmed

    @property
    def removed(self) -> float | None:
        """The share of the cost above that of noise that is removed; None if there is none."""
        return _removed(self.before, self.after, self.noise)


def held_out_change(error: BinnedOutputError, before: Model, after: Model) -> HeldOutChange:
    """Compares two models on the runs of `error`, those that are held out."""
    simulated = error.predict([before, after])
    smaller, larger = pseudo_huber_loss(error.whiten(simulated))
    claimed = pseudo_huber_loss((simulated[1] - simulated[0]) * error.weight())
    cost = float(larger.sum())
    return HeldOutChange(
        before=float(smaller.sum()),
        after=cost,
        claimed=float(claimed.sum()),
        least=gates.parameter_cost(cost, error.floor_cost()),
        noise=error.noise_cost(),
        draws=_share_of_draws(error, smaller - larger),
    )


def confirm(
    prepared: Prepared, nominal: Model, augmented: Model, simulated: Mapping[str, Mapping[str, Outputs]], gap: Gap
) -> tuple[Evidence, bool]:
    """Returns what proves `augmented`, and whether it may be written: False if free runs get worse with it.

    Args:
        augmented: as its file says.
        simulated: "nominal", "augmented" -> run -> outputs, over whole runs.
        gap: on the held-out runs, as it is reported.
    """
    fitted = prepared.fine.predict([nominal, augmented])
    before, after = (float(one.sum()) for one in pseudo_huber_loss(prepared.fine.whiten(fitted)))
    removed_fit = _removed(before, after, prepared.fine.noise_cost())
    held_out = prepared.held_out()
    if held_out is None:
        return Evidence("fitted_only", removed_fit, None, None, False, _NO_RUNS), True
    change = held_out_change(held_out, nominal, augmented)
    falls = gap.before is not None and gap.after is not None and gap.after < gap.before
    partly = (change.removed or 0.0) < gates.HELD_OUT_SHARE * (removed_fit or 0.0)
    sentence = _sentence(change, free_run_change(prepared, simulated), falls=falls, partly=partly)
    kind: EvidenceKind = "held_out" if sentence is _CONFIRMED else "fitted_only"
    contradicted = sentence not in (_CONFIRMED, _NOT_EXCITED)
    evidence = Evidence(kind, removed_fit, change.removed, change.draws, contradicted, sentence)
    return evidence, sentence is not _GROWS


def _sentence(change: HeldOutChange, error: float, *, falls: bool, partly: bool) -> str:
    """Returns what held-out runs say, from the most serious objection to none.

    Args:
        error: how many times as large the error of free runs becomes.
        falls: the gap falls.
        partly: the model removes much less of the held-out runs' cost than of the fit runs'.
    """
    if error >= (1.0 if change.is_excited else gates.FREE_RUN_GROWS):
        return _GROWS
    if not change.is_excited:
        return _NOT_EXCITED
    if change.is_contradicted:
        return _CONTRADICTED
    if not falls:
        return _MIXED
    return _PARTLY if partly else _CONFIRMED


def free_run_change(prepared: Prepared, simulated: Mapping[str, Mapping[str, Outputs]]) -> float:
    """Returns how many times as large the rms error of free runs on the held-out runs becomes.

    It is the geometric mean over the signals, so that no signal swamps the others, whatever their units and noise.
    """
    errors: dict[str, list[tuple[float, float]]] = {}
    for run in prepared.measured.runs:
        if run.name in prepared.roles.tested():
            tested = prepared.roles.samples(run, "held_out")
            for signal in sorted(run.outputs.keys() & simulated["nominal"][run.name].keys()):
                left = [residual(tested, signal, simulated[one][run.name][signal]) for one in ("nominal", "augmented")]
                errors.setdefault(signal, []).append((float(np.nansum(left[0] ** 2)), float(np.nansum(left[1] ** 2))))
    sums = [np.sum(parts, axis=0) for parts in errors.values()]
    ratios = [float(after / before) for before, after in sums if before > 0 and after > 0]
    return float(np.exp(np.mean(np.log(ratios)) / 2)) if ratios else 1.0


def _removed(before: float, after: float, noise: float) -> float | None:
    return min(1.0, (before - after) / (before - noise)) if before > noise else None


def _share_of_draws(error: BinnedOutputError, fall: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Returns how often the sum of `fall` (samples,) is above 0 when stretches of time are drawn again."""
    numbers, count = error.stretches_of(gates.CORRELATED_S)
    sums = np.bincount(numbers, fall, count)
    draws = np.random.default_rng(0).multinomial(count, np.full(count, 1 / count), size=_DRAWS)
    return float(np.mean(draws @ sums > 0))
