"""The fit before and after discovery, and the attainable fit, as a headline, a table and a chart."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot.data.agreement import mean_fit
from brickpilot.data.dataset import own_unit
from brickpilot.discover.finding import Finding
from brickpilot.discover.yardstick import Fit, Predictable, SignalFit
from brickpilot.report import plot
from brickpilot.report.headline_text import DEFINITION, HORIZONS
from brickpilot.report.quantities import RUNS, ascii_text, fit_number, fit_text, percent, quantity, say

_HEADLINE = "free_run"
_SAME = 0.05  # percentage points: fits with a smaller difference are called equal


@dataclass(frozen=True)
class Headline:
    """The mean fit over all signals in free runs, in percent. `role`: the role of these runs, "held_out" or "fit"."""

    role: str
    before: float
    after: float
    attainable: float

    @property
    def runs(self) -> str:
        """The words for the runs with this role: "held-out runs" or "fit runs"."""
        return RUNS[self.role]


def headline(finding: Finding, role: str | None = None) -> Headline | None:
    """Returns the mean fit of the held-out runs, or of the fit runs if no run is held out; None: no fit is known."""
    for one in ("held_out", "fit") if role is None else (role,):
        fits = {
            name: _of(signals[_HEADLINE], one)
            for name, signals in finding.yardstick.signals.items()
            if _HEADLINE in signals
        }
        means = [
            mean_fit({name: getattr(fit, which) for name, fit in fits.items()})
            for which in ("before", "after", "attainable")
        ]
        if None not in means:
            before, after, attainable = (float(mean or 0.0) for mean in means)
            return Headline(one, before, after, attainable)
    return None


def change(one: Headline) -> str:
    """Returns "the fit on the held-out runs rises from 61.2 % to 93.1 %, and at least 95.0 % is attainable"."""
    verb = "rises" if one.after > one.before else "falls"
    size = f"{verb} from {fit_text(one.before)} to {fit_text(one.after)}"
    if abs(one.after - one.before) < _SAME:
        size = f"is {fit_text(one.after)}"
    return f"the fit on the {one.runs} {size}, and at least {fit_text(one.attainable)} is attainable"


def shown(finding: Finding) -> dict[str, Any]:
    """Returns the values for the part of the page that shows the fits."""
    return {
        "fit_definition": DEFINITION,
        "fits": [one for role in RUNS if (one := headline(finding, role)) is not None],
        "fit_horizons": _horizons(finding),
        "fit_errors": _errors,
        "fit_chart": _chart(finding),
        "fit_repeats": _repeats(finding),
        "predictable": [
            (HORIZONS[name], sentences(one)) for name, one in finding.yardstick.predictable.items() if sentences(one)
        ],
    }


def sentences(one: Predictable) -> str:
    """Returns the predictable share of the error and the part of it that the augmented model removes, if known."""
    if one.share is None and one.held_out is None:
        return ""
    known = _by_role(percent, one.share, one.held_out)
    text = f"Of the calibrated model's squared error, a black box predicts {' and '.join(known)}"
    text += " that it has not seen."
    if gone := _by_role(_removed, one.removed, one.removed_held_out):
        text += f" The augmented model takes away {' and '.join(gone)} of what is predictable."
    return text


def lines(finding: Finding) -> list[str]:
    """Returns the table of fits for a terminal: a line for each signal, a column for each horizon."""
    one = headline(finding)
    if one is None:
        return []
    horizons = _horizons(finding)
    head = f"fit in %, the {one.runs}: before, after, attainable"
    rows = [f"{head:48}" + "".join(f"{text:>24}" for text in horizons.values()) + f"{'rms error':>34}"]
    for signal, by_horizon in finding.yardstick.signals.items():
        fits = [_of(by_horizon[name], one.role) if name in by_horizon else Fit(None, None, None) for name in horizons]
        row = f"{signal:48}"
        for fit in fits:
            texts = [ascii_text(fit_number(value)) for value in (fit.before, fit.after, fit.attainable)]
            row += f"{' '.join(f'{text:>7}' for text in texts):>24}"
        row += ascii_text(_errors(finding, signal, fits[0])).rjust(34) if fits else ""
        rows.append(row.rstrip())
    return rows


def _horizons(finding: Finding) -> dict[str, str]:
    """Returns horizon -> its name in tables, for the horizons that were compared."""
    return {name: text for name, text in HORIZONS.items() if name in finding.yardstick.horizons}


def _errors(finding: Finding, signal: str, fit: Fit) -> str:
    """Returns the rms error before and after in the unit of the data set; empty if the error is not known."""
    own, sizes = own_unit(finding.dataset, signal), [fit.numbers_before.rms_error, fit.numbers_after.rms_error]
    texts = [str(quantity(own.size(size), own.unit)) for size in sizes if size is not None]
    return " to ".join(dict.fromkeys(texts))


def _of(fit: SignalFit, role: str) -> Fit:
    return fit.held_out if role == "held_out" else fit.fit


def _by_role(text: Callable[[float], str], fit: float | None, held_out: float | None) -> list[str]:
    """Returns a text for each known share, such as "40 % on fit runs"."""
    shares = {"fit": fit, "held_out": held_out}
    return [f"{text(share)} on {RUNS[role]}" for role, share in shares.items() if share is not None]


def _removed(share: float) -> str:
    return percent(share) if share >= 0 else f"\N{MINUS SIGN}{percent(-share)} (it makes the error larger)"


def _repeats(finding: Finding) -> str:
    """Returns a sentence on the fit that a perfect model would reach on repeated runs; empty if no run is repeated."""
    fits: Mapping[str, Mapping[str, SignalFit]] = finding.yardstick.signals
    known = [(say(name), one[_HEADLINE].repeatability) for name, one in fits.items() if _HEADLINE in one]
    listed = [f"{name} {fit_text(value)}" for name, value in known if value is not None]
    if not listed:
        return ""
    return (
        f"Some runs repeat the same inputs. They differ so much that a perfect model would reach: {', '.join(listed)}."
    )


def _chart(finding: Finding) -> Any:
    one = headline(finding)
    if one is None:
        return None
    rows = []
    for signal, fits in finding.yardstick.signals.items():
        fit = _of(fits[_HEADLINE], one.role) if _HEADLINE in fits else None
        if fit is not None and fit.before is not None:
            rows.append((say(signal), fit.before, fit.after, fit.attainable))
    text = "; ".join(f"{name} {fit_number(a)} to {fit_number(b)}, attainable {fit_number(c)}" for name, a, b, c in rows)
    title = f"Fit in percent in free runs of the {one.runs}: {text}"
    return plot.fits(rows, single=finding.verdict == "none", title=title)
