"""The runs on discovery's page: measured and simulated superimposed, and the map of what either simulation leaves."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot import catalogue
from brickpilot.data.dataset import Run
from brickpilot.discover.finding import Finding, Place
from brickpilot.discover.locate import residual
from brickpilot.fit.replay import SUMMED, measured_rates
from brickpilot.report.discover_plots import Curve, superimposed
from brickpilot.report.discover_text import OVER_NOISE, ROLES, gap_text, say

Array = NDArray[np.float64]

_SHOWN = 4  # figures that stand open; the others are folded away
_POINTS, _POINTS_FOLDED = 700, 300  # drawn of a curve


@dataclass(frozen=True)
class Left:
    """One signal of one run and what either simulation leaves of it, (n,) each, SI; NaN is a gap.

    `measured`, `nominal`, `augmented`: as drawn, a signal that sums up from its first sample. `before`, `after`:
    measured minus simulated.
    """

    run: Run
    signal: str
    measured: Array
    nominal: Array
    augmented: Array
    before: Array
    after: Array
    noise_sd: float

    @property
    def gaps(self) -> tuple[float, float]:
        """rms over noise sd, before and after."""
        before, after = (float(np.sqrt(np.nanmean(one**2))) / self.noise_sd for one in (self.before, self.after))
        return before, after


Key = tuple[str, str]
"""Run and signal."""


def left_over(finding: Finding) -> dict[Key, Left]:
    """What either simulation leaves of all that was judged: measured, or the rate of a position that was."""
    found = {}
    for run in finding.dataset.runs:
        run = dataclasses.replace(run, outputs={**measured_rates(run), **run.outputs})
        nominal, augmented = (finding.simulated[which][run.name] for which in ("nominal", "augmented"))
        for signal, noise_sd in finding.noise_sd.items():
            if signal not in run.outputs or signal not in nominal or not np.isfinite(run.outputs[signal]).any():
                continue
            measured, before, after = run.outputs[signal], nominal[signal], augmented[signal]
            found[run.name, signal] = Left(
                run=run,
                signal=signal,
                measured=_drawn(run, signal, measured),
                nominal=_drawn(run, signal, before),
                augmented=_drawn(run, signal, after),
                before=residual(run, signal, before),
                after=residual(run, signal, after),
                noise_sd=noise_sd,
            )
    return found


def _drawn(run: Run, signal: str, values: Array) -> Array:
    if signal not in SUMMED:
        return values
    return np.asarray(values - values[np.flatnonzero(np.isfinite(run.outputs[signal]))[0]])


def figures(
    finding: Finding, left: Mapping[Key, Left]
) -> tuple[list[dict[str, Any]], list[tuple[str, str, list[dict[str, Any]]]]]:
    """The figures that stand open, and the others as (run, role, figures)."""
    places = {(one.run, one.signal): one for one in finding.where}
    by_gap = sorted(left, key=lambda key: -left[key].gaps[0])
    chosen = _varied([key for key in places if key in left] or by_gap)
    unseen = [key for key in by_gap if finding.roles[key[0]] == "held_out"]
    if unseen and not any(key in unseen for key in chosen):
        chosen.append(unseen[0])  # the proof belongs in sight
    shown = [_figure(finding, left[key], places.get(key), _POINTS) for key in chosen]
    folded = []
    for run in finding.dataset.runs:
        keys = [key for key in left if key[0] == run.name and key not in chosen]
        if keys:
            drawn = [_figure(finding, left[key], places.get(key), _POINTS_FOLDED) for key in keys]
            folded.append((run.name, ROLES[finding.roles[run.name]], drawn))
    return shown, folded


def _varied(order: Sequence[Key]) -> list[Key]:
    """The first few (run, signal) of which no two show the same, as far as there are: new signals and runs first."""
    chosen: list[Key] = []
    while len(chosen) < min(_SHOWN, len(order)):
        runs, signals = ([key[part] for key in chosen] for part in (0, 1))
        rest = [key for key in order if key not in chosen]
        chosen.append(min(rest, key=lambda key: (signals.count(_kind(key[1])), runs.count(key[0]), order.index(key))))
    return sorted(chosen, key=order.index)


def _figure(finding: Finding, left: Left, place: Place | None, points: int) -> dict[str, Any]:
    """One signal of one run, measured and simulated, and the errors below."""
    above, below = [Curve("measured", left.run.time, left.measured)], []
    if finding.verdict != "none":
        above.append(Curve("nominal", left.run.time, left.nominal))
        below.append(Curve("nominal", left.run.time, left.before))
    above.append(Curve("augmented", left.run.time, left.augmented))
    below.append(Curve("augmented", left.run.time, left.after))
    role = ROLES[finding.roles[left.run.name]]
    before, after = left.gaps
    chart = superimposed(
        catalogue.outputs()[left.signal],
        above,
        below,
        left.noise_sd,
        None if place is None else (place.from_s, place.to_s),
        title=f"{left.run.name}, {role}: {say(left.signal)} measured and simulated, and the error below: "
        f"{gap_text(before)} times the noise before, {gap_text(after)} after",
        points=points,
    )
    return {
        "run": left.run.name,
        "role": role,
        "signal": say(left.signal),
        "error": _change(finding, before, after),
        "chart": chart,
    }


def _change(finding: Finding, before: float, after: float) -> str:
    """What became of an error, in words."""
    start, end = gap_text(before), gap_text(after)
    if finding.verdict == "none" or start == end:
        return f"the error is {end} times the noise"
    return f"the error {'falls' if after < before else 'grows'} from {start} to {end} times the noise"


def gap_map(finding: Finding, left: Mapping[Key, Left]) -> dict[str, Any]:
    """Every run and signal with its gap before and after. `shade`: 0 at the noise to 1 at the largest gap."""
    most = max((np.log(max(one.gaps[0], 1.0)) for one in left.values()), default=0.0) or 1.0
    rows = []
    for run in finding.dataset.runs:
        cells: list[dict[str, Any] | None] = []
        for signal in finding.noise_sd:
            one = left.get((run.name, signal))
            if one is None:
                cells.append(None)
                continue
            before, after = one.gaps
            shade = float(np.log(max(before, 1.0)) / most) if before > OVER_NOISE else 0.0
            cells.append({"before": gap_text(before), "after": gap_text(after), "shade": f"{shade:.2f}"})
        rows.append((run.name, ROLES[finding.roles[run.name]], cells))
    return {"signals": [say(name) for name in finding.noise_sd], "rows": rows}


def _kind(signal: str) -> str:
    """What a signal measures, whichever the side."""
    return signal.removesuffix("_left").removesuffix("_right")
