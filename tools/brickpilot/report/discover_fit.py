"""Fit in percent before, after and attainable: the headline of discovery, its table and its chart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from brickpilot.data.agreement import mean_fit
from brickpilot.data.dataset import OwnUnit, own_unit
from brickpilot.discover.finding import Finding
from brickpilot.discover.yardstick import Fit, Predictable, SignalFit
from brickpilot.report import plot
from brickpilot.report.headline_text import DEFINITION, HORIZONS, RUNS, plain
from brickpilot.report.quantities import DASH, fit_number, fit_text, percent, quantity

_HEADLINE = "free_run"
_MINUS = "\N{MINUS SIGN}"
_SAME = 0.05  # percentage points: fits that differ by less are called equal


@dataclass(frozen=True)
class Headline:
    """The mean fit over all signals in free runs, in percent. `role`: the role of these runs, "held_out" or "fit"."""

    role: str
    before: float
    after: float
    attainable: float

    @property
    def runs(self) -> str:
        return RUNS[self.role]


def headline(finding: Finding, role: str | None = None) -> Headline | None:
    """Returns the mean fit of the held-out runs, or of the fit runs if none is held out; None if there is none."""
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
    least = f"at least {fit_text(one.attainable)} is attainable"
    if abs(one.after - one.before) < _SAME:
        return f"the fit on {one.runs} is {fit_text(one.after)}, and {least}"
    verb = "rises" if one.after > one.before else "falls"
    return f"the fit on {one.runs} {verb} from {fit_text(one.before)} to {fit_text(one.after)}, and {least}"


def shown(finding: Finding) -> dict[str, Any]:
    """Returns the yardstick's part of the page."""
    roles = [(one, role) for role in ("held_out", "fit") if (one := headline(finding, role)) is not None]
    return {
        "fit_definition": DEFINITION,
        "fit_cards": [
            (one.runs.removeprefix("the "), fit_number(one.before), fit_number(one.after), fit_number(one.attainable))
            for one, _ in roles
        ],
        "fit_horizons": [text for name, text in HORIZONS.items() if name in finding.yardstick.horizons],
        "fit_tables": [(one.runs.removeprefix("the "), _table(finding, role)) for one, role in roles],
        "fit_chart": _chart(finding),
        "fit_repeats": _repeats(finding),
        "predictable": [
            (HORIZONS[name], sentences(one)) for name, one in finding.yardstick.predictable.items() if sentences(one)
        ],
    }


def sentences(one: Predictable) -> str:
    """Returns the predictable share of the error, and how much of this share the model removes; empty if unknown."""
    if one.share is None and one.held_out is None:
        return ""
    known = [f"{percent(value)} on {runs}" for value, runs in _by_role(one.share, one.held_out) if value is not None]
    text = f"Of the calibrated model's squared error, a black box predicts {' and '.join(known)}"
    text += " that it has not seen."
    gone = [
        f"{_removed(value)} on {runs}"
        for value, runs in _by_role(one.removed, one.removed_held_out)
        if value is not None
    ]
    if gone:
        text += f" The augmented model takes away {' and '.join(gone)} of what is predictable."
    return text


def lines(finding: Finding) -> list[str]:
    """Returns the table of fits for a terminal: a line for each signal, a column for each horizon."""
    one = headline(finding)
    if one is None:
        return []
    horizons = [name for name in HORIZONS if name in finding.yardstick.horizons]
    head = f"fit in %, {one.runs}: before, after, attainable"
    error = "rms error"
    found = [f"{head:48}" + "".join(f"{HORIZONS[name]:>24}" for name in horizons) + f"{error:>34}"]
    for signal, fits in finding.yardstick.signals.items():
        cells = [_of(fits[name], one.role) if name in fits else Fit(None, None, None) for name in horizons]
        values = [" ".join(f"{_ascii(value):>7}" for value in (f.before, f.after, f.attainable)) for f in cells]
        errors = plain(_errors(cells[0], own_unit(finding.dataset, signal))) if cells else ""
        found.append((f"{signal:48}" + "".join(f"{value:>24}" for value in values) + f"{errors:>34}").rstrip())
    return found


def _errors(fit: Fit, own: OwnUnit) -> str:
    """Returns the rms error before and after in the unit of the data set; empty if the error is not known."""
    sizes = [one.rms_error for one in (fit.numbers_before, fit.numbers_after)]
    shown = [str(quantity(own.size(size), own.unit)) for size in sizes if size is not None]
    return " to ".join(dict.fromkeys(shown))


def _ascii(value: float | None) -> str:
    return fit_number(value).replace(_MINUS, "-").replace(DASH, "-").replace(" ", "")


def _of(fit: SignalFit, role: str) -> Fit:
    return fit.held_out if role == "held_out" else fit.fit


def _by_role(fit: float | None, held_out: float | None) -> list[tuple[float | None, str]]:
    return [(fit, "fit runs"), (held_out, "held-out runs")]


def _removed(share: float) -> str:
    return percent(share) if share >= 0 else f"{_MINUS}{percent(-share)} (it makes the error larger)"


def _table(finding: Finding, role: str) -> list[tuple[str, list[dict[str, str] | None]]]:
    """Returns for each signal its cells, one for each horizon; None where the horizon is absent."""
    horizons = [name for name in HORIZONS if name in finding.yardstick.horizons]
    rows = []
    for signal, fits in finding.yardstick.signals.items():
        own = own_unit(finding.dataset, signal)
        rows.append((_say(signal), [_cell(_of(fits[name], role), own) if name in fits else None for name in horizons]))
    return rows


def _cell(fit: Fit, own: OwnUnit) -> dict[str, str] | None:
    if fit.before is None:
        return None
    return {
        "before": fit_number(fit.before),
        "after": fit_number(fit.after),
        "attainable": fit_number(fit.attainable),
        "errors": _errors(fit, own),
    }


def _repeats(finding: Finding) -> str:
    """Returns a sentence on the fit that repeats of the same inputs allow; empty if no run is repeated."""
    fits: Mapping[str, Mapping[str, SignalFit]] = finding.yardstick.signals
    known = [(_say(name), one[_HEADLINE].repeatability) for name, one in fits.items() if _HEADLINE in one]
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
            rows.append((_say(signal), fit.before, fit.after, fit.attainable))
    text = "; ".join(f"{name} {fit_number(a)} to {fit_number(b)}, attainable {fit_number(c)}" for name, a, b, c in rows)
    title = f"Fit in percent in free runs of {one.runs}: {text}"
    return plot.fits(rows, single=finding.verdict == "none", title=title)


def _say(signal: str) -> str:
    return signal.replace("_", " ")
