"""The lines that `brickpilot check` prints: the content of a data set, and what discovery can find in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from brickpilot.data.dataset import FRAME_WORDS
from brickpilot.discover.deadline import Span
from brickpilot.readiness.data_check import Check
from brickpilot.report import headline_text
from brickpilot.report.discover_text import listed
from brickpilot.report.quantities import ascii_text, quantity

_KNOWN = {
    "data": "from the runs",
    "data and prior": "from the runs and what is stated",
    "prior alone": "as stated; the runs add nothing",
    "not narrowed by the data": "not known: the runs do not tell",
}
_COLUMNS = 3  # number of effects, with their sizes, in a printed line


def lines(found: Check) -> Iterator[str]:
    """Yields the lines; values are in SI units with suitable prefixes."""
    seconds = sum(run.duration_s for run in found.runs)
    samples = sum(run.samples for run in found.runs)
    yield f"{found.dataset}: a {found.vehicle}, {len(found.runs)} runs of {seconds:.0f} s in all, {samples} samples"
    if found.vehicle != "motor":
        yield f"frame {found.frame}: {FRAME_WORDS[found.frame]}"
    yield from _runs(found)
    yield from _signals(found)
    yield f"damaged samples: {_faults(found)}"
    yield from _parameters(found)
    yield from headline_text.lines(found.explained, found.units)
    yield from _effects(found)
    yield from _advice(found)
    yield f"brickpilot discover will take {Span(*found.discover_range_s)}"
    for note in found.notes:
        yield f"note: {note}"


def _runs(found: Check) -> Iterator[str]:
    yield f"{'run':26}{'role':10}{'manoeuvre':46}{'samples':>8}{'s':>8}{'step ms':>9}{'99 % below':>11}"
    for run in found.runs:
        timing = f"{1e3 * run.step_s:>9.4g}{1e3 * run.late_s:>11.4g}"
        yield f"{run.name:26}{run.role:10}{run.manoeuvre:46}{run.samples:>8}{run.duration_s:>8.4g}{timing}"


def _signals(found: Check) -> Iterator[str]:
    yield f"{'signal':26}{'rms':>16}{'noise sd':>16}  {'noise is':16}{'converter step':>16}{'missing':>9}"
    for one in found.signals:
        sizes = [ascii_text(str(quantity(size, one.unit))) for size in (one.rms, one.noise_sd, one.resolution)]
        step = sizes[2] if one.resolution else "none found"
        yield f"{one.name:26}{sizes[0]:>16}{sizes[1]:>16}  {one.colour:16}{step:>16}{100 * one.missing:>8.1f}%"


def _faults(found: Check) -> str:
    if not found.faults:
        return "none found"
    kinds = Counter(fault.kind for fault in found.faults)
    spans = listed([f"{kind} {count} times" if count > 1 else f"{kind} once" for kind, count in kinds.items()])
    return f"{spans}; every fit leaves them out (see the notes)"


def _parameters(found: Check) -> Iterator[str]:
    if not found.parameters:
        yield "nominal values: all are stated without an sd, so none is fitted"
        return
    yield "nominal values, fitted to the runs with no effect added:"
    for name, one in found.parameters.items():
        shown = quantity(one.value, one.unit, one.ci95 if one.identifiable else None)
        yield f"  {name:24}{ascii_text(str(shown)):42}{_KNOWN.get(one.basis, one.basis)}"
    for group in found.cannot_tell_apart:
        yield f"  only combinations are known of {listed(group)}"
    for known in found.combinations:
        yield f"  {known.name:24}{ascii_text(str(quantity(known.value, known.unit, known.ci95))):42}{known.formula}"


def _effects(found: Check) -> Iterator[str]:
    count = len(found.visible) + len(found.invisible)
    yield f"of {count} effects these runs would show {len(found.visible)}, from this size on:"
    cells = [f"{name} {ascii_text(str(quantity(one.size, one.unit)))}" for name, one in found.visible.items()]
    for first in range(0, len(cells), _COLUMNS):
        yield "  " + "".join(f"{cell:44}" for cell in cells[first : first + _COLUMNS]).rstrip()
    if found.invisible:
        yield f"  at no size: {', '.join(found.invisible)}"


def _advice(found: Check) -> Iterator[str]:
    if not found.advice:
        yield "no manoeuvre of brickpilot's list would tell much more"
        return
    yield f"to tell more, {'run' if found.vehicle == 'motor' else 'drive'} as well:"
    for one in found.advice:
        gains = {"would show": one.effects, "would tell more of": one.parameters}
        text = "; ".join(f"{verb} {', '.join(names)}" for verb, names in gains.items() if names)
        yield f'  "{one.manoeuvre.name}", {one.manoeuvre.duration_s:g} s: {text}'
