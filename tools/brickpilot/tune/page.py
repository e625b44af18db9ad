"""The page of `tune`: it compares old and new gains in flights of the same robots, which the search did not use."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from brickpilot.campaign import robots
from brickpilot.report.discover_text import listed
from brickpilot.report.plot import Colour, Curve, Figure, Panel, row_chart, to_html
from brickpilot.report.quantities import number
from brickpilot.report.run_page import track_to_html
from brickpilot.report.template import render
from brickpilot.tune.task import Outcome, Raw, score
from brickpilot.tune.tuner import JUDGE, Change, Rate, Tuned
from brickpilot.vehicle import flight, flight_figures
from brickpilot.vehicle.settings import settings

Array = NDArray[np.float64]

BEFORE: Colour = "orange"
AFTER: Colour = "blue"
_LOGGED = ("time_s", "true_x_m", "true_y_m", "true_heading_rad", "left_voltage_v", "right_voltage_v")
_SHOWN_S = 1.0  # time in s that a track shows after the last movement


def page(tuned: Tuned, command: str) -> str:
    """Returns the page as one self-contained HTML text; `command`: the command line that repeats the tuning."""
    judged = tuned.judged
    return render(
        "tune",
        title=f"{tuned.problem.plan.model.name}: gains before and after",
        sentence=sentence(tuned),
        tuned=tuned,
        rates=_rates(judged.rate_before, judged.rate_after),
        changes=[_row(change_) for change_ in judged.changes],
        causes=_causes(judged.before, judged.after),
        spreads=[_distribution(tuned, *one) for one in (("cross_track", "m"), ("time", "s"))],
        gains=_gains(tuned),
        ranges=_ranges(tuned),
        tracks=[_track(tuned, place, why) for place, why in _chosen(tuned)],
        trace=_trace(tuned),
        command=command,
    )


def sentence(tuned: Tuned) -> str:
    """Returns the result in words."""
    before, after = tuned.judged.rate_before, tuned.judged.rate_after
    success = (
        f"{percent(before)} of {before.robots} robots that the data allow fly the mission with the gains before, and "
        f"{percent(after)} with the gains found."
    )
    if tuned.kept_start:
        return f"{success} The gains found are not better beyond chance, so the gains before are kept."
    better = [change_.name for change_ in tuned.judged.changes if change_.robots and change_.high < 0.0]
    worse = [change_.name for change_ in tuned.judged.changes if change_.robots and change_.low > 0.0]
    more = ["the share of robots that arrive"] if after.low > before.high else []
    results = [(listed([*more, *better]), "got better"), (listed(worse), "got worse")]
    return " ".join([success, *(f"{names[0].upper()}{names[1:]} {verb}." for names, verb in results if names)])


def percent(rate: Rate) -> str:
    """Returns a rate with its interval: "93.1 % (91.3..94.5 %)"."""
    return f"{100 * rate.share:.1f} % ({100 * rate.low:.1f}..{100 * rate.high:.1f} %)"


def change(compared: Change) -> tuple[str, str, str, str]:
    """Returns the value before, the value after, the difference, and the interval of the difference, as texts."""
    if not compared.robots:
        return ("\N{EN DASH}",) * 4
    values = (compared.before, compared.after, compared.after - compared.before)
    before, after, difference = (number(value) for value in values)
    return before, after, difference, f"{number(compared.low)}..{number(compared.high)}"


def _row(compared: Change) -> dict[str, object]:
    cells = dict(zip(("before", "after", "difference", "interval"), change(compared), strict=True))
    return {"name": compared.name, "unit": compared.unit, "robots": compared.robots, **cells}


def _rates(before: Rate, after: Rate) -> Markup:
    return row_chart(
        ["before", "after"],
        {"share of robots": (AFTER, [100 * before.share, 100 * after.share])},
        [(100 * rate.low, 100 * rate.high) for rate in (before, after)],
        "robots that fly the mission",
        "%",
        title=f"success before {percent(before)}, after {percent(after)}",
        lines=[100.0],
    )


def _causes(before: Sequence[Outcome], after: Sequence[Outcome]) -> list[tuple[str, int, int]]:
    old, new = (Counter(outcome.cause for outcome in flown if outcome.cause) for flown in (before, after))
    return [(name, old[name], new[name]) for name in old | new]


def _distribution(tuned: Tuned, field: str, unit: str) -> Markup:
    """Draws the cumulative distribution of a figure over all robots, before and after."""
    name = field.replace("_", "-")
    robots_flown = len(tuned.judged.before)
    before, after = (
        np.sort([value for value in (getattr(outcome, field) for outcome in flown) if not math.isnan(value)])
        for flown in (tuned.judged.before, tuned.judged.after)
    )
    x = np.unique(np.concatenate([before, after]))
    curves = [
        Curve("before", 100 * np.searchsorted(before, x, side="right") / robots_flown, BEFORE, 1.8),
        Curve("after", 100 * np.searchsorted(after, x, side="right") / robots_flown, AFTER, 1.8),
    ]
    title = f"share of all robots with a {name} up to each value, before and after"
    return to_html(Figure(title, x, [Panel("robots", "%", curves, 180)], f"{name} of a mission", unit))


def _gains(tuned: Tuned) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for name, low, high in zip(tuned.space.names, tuned.space.low, tuned.space.high, strict=True):
        how = settings()[name]
        before, after = tuned.problem.start[name], tuned.found[name]
        rows.append(
            {
                "name": name,
                "meaning": how.meaning,
                "unit": "" if how.format.unit == "1" else how.format.unit,
                "before": number(how.value(before)),
                "after": number(how.value(after)),
                "raw": f"{before} \N{RIGHTWARDS ARROW} {after}",
                "searched": f"{number(how.value(round(low)))}..{number(how.value(round(high)))}",
                "format": how.range,
            }
        )
    return rows


def _ranges(tuned: Tuned) -> Markup:
    """Draws the ratio of each new gain to the old gain, with the range of the search."""
    space = tuned.space
    base = np.array([tuned.problem.start[name] for name in space.names]) + space.offset
    after = (np.array([tuned.found[name] for name in space.names]) + space.offset) / base
    low, high = ((end + space.offset) / base for end in (space.low, space.high))
    spans = list(zip(low.tolist(), high.tolist(), strict=True))
    return row_chart(
        list(space.names),
        {"after": (AFTER, after.tolist())},
        spans,
        "gain over the gain before",
        "",
        title="gains after over those before, in the ranges searched",
        lines=[1.0],
        log=True,
    )


def _chosen(tuned: Tuned) -> list[tuple[int, str]]:
    """Returns the places of the robots whose tracks are shown, each with the reason for the choice."""
    before, after = (
        [score(outcome, tuned.by) for outcome in flown] for flown in (tuned.judged.before, tuned.judged.after)
    )
    median = int(np.argsort(before, kind="stable")[len(before) // 2])
    picked = {median: "the robot in the middle before"}
    picked.setdefault(int(np.argmax(before)), "the worst robot before")
    picked.setdefault(int(np.argmax(after)), "the worst robot after")
    return list(picked.items())


def _track(tuned: Tuned, place: int, why: str) -> dict[str, Any]:
    (robot,) = robots.draw(tuned.problem.allowed, tuned.problem.seed, JUDGE, [place])
    lines, reached, clock = [], [], None
    sets: tuple[tuple[str, Raw, Colour], ...] = (("after", tuned.found, AFTER), ("before", tuned.problem.start, BEFORE))
    for name, gains, colour in sets:
        plan = tuned.problem.planned(robot, gains)
        log = flight.fly(plan, _LOGGED).log
        moves = np.flatnonzero(np.abs(log["left_voltage_v"]) + np.abs(log["right_voltage_v"]) > 0)
        shown = int(np.searchsorted(log["time_s"], log["time_s"][moves[-1] if len(moves) else 0] + _SHOWN_S))
        track = np.array([log["true_y_m"][:shown], log["true_x_m"][:shown]])
        if clock is None:
            clock = (log["time_s"][:shown], log["true_heading_rad"][:shown])
            times = log["time_s"], log["true_x_m"], log["true_y_m"]
            reached = flight_figures.waypoints_reached(*times, plan.scenario.waypoints, plan.acceptance).at
            lines.append(Curve(name, track, colour, 3.0))
        else:
            lines.append(Curve(name, _apart(track, len(clock[0])), colour, 1.5))
    assert clock is not None
    scenario = tuned.problem.plan.scenario
    legs = np.array([scenario.start[:2], *scenario.waypoints]).T
    lines.append(Curve("legs", legs[::-1], "grey", 1.0, dashed=True))
    circles = [
        (y, x, tuned.problem.plan.acceptance, moment is not None)
        for (x, y), moment in zip(scenario.waypoints, reached, strict=True)
    ]
    title = f"tracks of {why}, number {place}, before and after"
    drawn = track_to_html(*clock, lines, circles, link=f"robot {place}", title=title)
    before, after = (_result(flown[place]) for flown in (tuned.judged.before, tuned.judged.after))
    how = {"before": before, "after": after}
    return {"why": why, "place": place, "explanation": robot.explanation, "drawn": drawn, **how}


def _apart(track: Array, samples: int) -> Array:
    """Returns the thinned track; its number of points is never `samples`, so that the page does not play this track."""
    kept = track[:, :: max(track.shape[1] // 1000, 1)]
    return kept[:, :-1] if kept.shape[1] == samples else kept


def _result(outcome: Outcome) -> str:
    if outcome.cause:
        return f"failed: {outcome.cause}"
    return f"arrived after {outcome.time:.1f} s, cross-track {1e3 * outcome.cross_track:.0f} mm rms"


def _trace(tuned: Tuned) -> Markup | None:
    """Draws the scores of the search, and the share of successful flights."""
    generations = tuned.searched.generations
    if not generations:
        return None
    sets = np.array([float(generation.sets) for generation in generations])
    scores = [
        Curve("best of a generation", np.array([generation.best for generation in generations]), AFTER, 1.8),
        Curve("middle", np.array([generation.middle for generation in generations]), "grey"),
    ]
    success = [Curve("flights", np.array([100 * generation.success for generation in generations]), "green")]
    step = [Curve("step", np.array([generation.step for generation in generations]), "purple")]
    panels = [
        Panel("mean score", "", scores, 150, log=True),
        Panel("success", "%", success, 110),
        Panel("step of the search", "", step, 110),
    ]
    return to_html(Figure("scores over the gain sets flown", sets, panels, "gain sets flown", ""))
