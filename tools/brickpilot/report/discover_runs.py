"""The runs on discovery's page: measured and simulated signals in one figure, and the gaps by run and signal."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from brickpilot.data.dataset import Run, own_unit
from brickpilot.data.motion import measured_rates
from brickpilot.data.signals import SUMMED
from brickpilot.discover.finding import Finding
from brickpilot.report.discover_text import OVER_NOISE, gap_change
from brickpilot.report.plot import Array, Simulated, points_for, superimposed
from brickpilot.report.quantities import ROLES, gap_text, say

_SHOWN = 4  # number of figures that the page shows at first; the reader can unfold all others


@dataclass(frozen=True)
class Compared:
    """One signal of one run, measured and simulated, in arrays of shape (n,); NaN is a dropout.

    Attributes:
        unit: the unit of all values; unit and sign are those of the data set.
        measured: the measured values; a position counts from its first sample, here and in the simulations.
        nominal, augmented: the values that the calibrated nominal model and the augmented model simulate.
        noise_sd: the standard deviation of a measured sample's noise.
    """

    run: Run
    signal: str
    unit: str
    measured: Array
    nominal: Array
    augmented: Array
    noise_sd: float

    @property
    def gaps(self) -> tuple[float, float]:
        """Returns the gap of the calibrated nominal model and of the augmented model."""
        residuals = (self.measured - one for one in (self.nominal, self.augmented))
        before, after = (float(np.sqrt(np.nanmean(one**2))) / self.noise_sd for one in residuals)
        return before, after


Key = tuple[str, str]
"""Names of a run and of a signal."""


def compared_signals(finding: Finding) -> dict[Key, Compared]:
    """Returns every compared signal with its simulations; for a measured position, its velocity is compared too."""
    found = {}
    for run in finding.dataset.runs:
        run = dataclasses.replace(run, outputs={**measured_rates(run), **run.outputs})
        nominal, augmented = (finding.simulated[which][run.name] for which in ("nominal", "augmented"))
        for signal, noise_sd in finding.noise_sd.items():
            own = own_unit(finding.dataset, signal)
            if signal not in run.outputs or signal not in nominal or not np.isfinite(run.outputs[signal]).any():
                continue
            measured, before, after = (
                own.value(1.0) * _drawn(run, signal, values)
                for values in (run.outputs[signal], nominal[signal], augmented[signal])
            )
            found[run.name, signal] = Compared(run, signal, own.unit, measured, before, after, own.size(noise_sd))
    return found


def _drawn(run: Run, signal: str, values: Array) -> Array:
    if signal not in SUMMED:
        return values
    return np.asarray(values - values[np.flatnonzero(np.isfinite(run.outputs[signal]))[0]])


def figures(
    finding: Finding, compared: Mapping[Key, Compared]
) -> tuple[list[dict[str, Any]], list[tuple[str, str, list[dict[str, Any]]]]]:
    """Returns the figures that the page shows at first, and the folded figures as (run, role, figures)."""
    chosen = _chosen(finding, compared, _SHOWN)
    points = points_for(len(compared))
    folded = []
    for run in finding.dataset.runs:
        keys = [key for key in compared if key[0] == run.name and key not in chosen]
        if keys:
            drawn = [_figure(finding, compared[key], points) for key in keys]
            folded.append((run.name, ROLES[finding.roles[run.name]], drawn))
    return [_figure(finding, compared[key], points) for key in chosen], folded


def telling_figures(finding: Finding, count: int) -> list[dict[str, Any]]:
    """Returns up to about `count` figures, of the signals and runs that show the missing effect most clearly."""
    compared = compared_signals(finding)
    return [_figure(finding, compared[key], points_for(count)) for key in _chosen(finding, compared, count)]


def _chosen(finding: Finding, compared: Mapping[Key, Compared], count: int) -> list[Key]:
    """Returns the runs and signals whose squared gap falls most, with at least one held-out run if there is one."""

    def removed(key: Key) -> tuple[float, float]:
        before, after = compared[key].gaps
        return before**2 - after**2, before

    by_gap = sorted(compared, key=removed, reverse=True)
    chosen = _varied(by_gap, count)
    held_out = [key for key in by_gap if finding.roles[key[0]] == "held_out"]
    if held_out and not any(key in held_out for key in chosen):
        chosen.append(held_out[0])  # at least one of the first figures shows a held-out run
    return chosen


def _varied(order: Sequence[Key], count: int) -> list[Key]:
    """Returns `count` keys of `order`. Keys of new signals and runs are preferred, then keys early in `order`."""
    chosen: list[Key] = []
    while len(chosen) < min(count, len(order)):
        runs, kinds = [run for run, _ in chosen], [_kind(signal) for _, signal in chosen]
        rest = [key for key in order if key not in chosen]
        chosen.append(min(rest, key=lambda key: (kinds.count(_kind(key[1])), runs.count(key[0]), order.index(key))))
    return sorted(chosen, key=order.index)


def _figure(finding: Finding, one: Compared, points: int) -> dict[str, Any]:
    """Returns the figure of one signal of one run, with its caption."""
    places = (place for place in finding.where if (place.run, place.signal) == (one.run.name, one.signal))
    place = next(places, None)  # the place with the largest share of the gap comes first
    simulated: Simulated = {"before": ("orange", one.nominal), "after": ("blue", one.augmented)}
    if finding.verdict == "none":
        simulated = {"simulated": ("blue", one.augmented)}
    role = ROLES[finding.roles[one.run.name]]
    gaps = [gap_text(gap) for gap in one.gaps]
    chart = superimposed(
        one.run.time,
        say(one.signal),
        one.unit,
        one.measured,
        simulated,
        run=one.run.name,
        title=f"{one.run.name}, {role}: {say(one.signal)} measured and simulated, and the residual below: "
        f"the gap is {gaps[0]} times the noise before and {gaps[1]} after",
        points=points,
        noise_sd=one.noise_sd,
        stretch=None if place is None else (place.from_s, place.to_s),
    )
    return {
        "run": one.run.name,
        "role": role,
        "signal": say(one.signal),
        "change": f"the gap {gap_change(None if finding.verdict == 'none' else one.gaps[0], one.gaps[1])}",
        "chart": chart,
    }


def gap_map(finding: Finding, compared: Mapping[Key, Compared]) -> dict[str, Any]:
    """Returns each run's gap in each signal, before and after. `shade` is 0 at the noise and 1 at the largest gap."""
    most = max((np.log(max(one.gaps[0], 1.0)) for one in compared.values()), default=0.0) or 1.0

    def cell(one: Compared | None) -> dict[str, str] | None:
        if one is None:
            return None
        before, after = one.gaps
        shade = float(np.log(max(before, 1.0)) / most) if before > OVER_NOISE else 0.0
        return {"before": gap_text(before), "after": gap_text(after), "shade": f"{shade:.2f}"}

    rows = [
        (run.name, ROLES[finding.roles[run.name]], [cell(compared.get((run.name, name))) for name in finding.noise_sd])
        for run in finding.dataset.runs
    ]
    return {"signals": [say(name) for name in finding.noise_sd], "rows": rows}


def _kind(signal: str) -> str:
    """Returns a signal's name without its side."""
    return signal.removesuffix("_left").removesuffix("_right")
