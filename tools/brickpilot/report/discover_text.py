"""Words and numbers of discovery's page: what an effect is called in plain English, and values in handy units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from brickpilot import catalogue
from brickpilot.discover.finding import Effect, Finding, Gap, Parameter

ROLES = {"fit": "fitted", "held_out": "held out"}
OVER_NOISE = 1.1
"""Times the noise: what has more left is told of."""

NARROW = "\N{NO-BREAK SPACE}"
_UNSEEN = "runs it has not seen"
_DASH = "\N{EN DASH}"

_PREFIXES = ((1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"), (1e6, "M"))
_TAKES_PREFIX = frozenset({"N", "V", "A", "H", "W", "Ω", "m", "s", "rad"})  # as the first factor of a unit


@dataclass(frozen=True)
class Shown:
    """A value as it is printed; `low` and `high` are empty where there is no interval, `unit` where there is none."""

    value: str
    low: str
    high: str
    unit: str

    def __str__(self) -> str:
        unit = f"{NARROW}{self.unit}" if self.unit else ""
        return f"{self.value}{unit}" + (f" ({self.low} to {self.high})" if self.low else "")


def say(name: str) -> str:
    """A name of the program as it is read out."""
    return name.replace("_", " ")


def words(effect: str) -> str:
    """What the simulator lacks, in plain English; the name itself where nobody wrote any."""
    known = catalogue.effects_of((effect,))
    return known[0].words if known else say(effect)


def explanation(names: str | Sequence[str]) -> str:
    """Effects in words, each with its name behind it in parentheses. Names may be joined by " + "."""
    chosen = names.split(" + ") if isinstance(names, str) else names
    return " with ".join(f"{words(name)} ({name})" for name in chosen)


def unit_text(unit: str) -> str:
    """A unit as it is printed: "N m s/rad" with spaces that do not break, "m/s²", "Ω"; nothing for a plain number."""
    if unit == "1":
        return ""
    return unit.replace("ohm", "Ω").replace("^2", "²").replace("^3", "³").replace(" ", NARROW)


def scaled(size: float, unit: str) -> tuple[float, str]:
    """(factor, unit): what a value about as large as `size` is divided by, to be printed in that unit."""
    shown = unit_text(unit)
    first = shown.split(NARROW)[0].split("/")[0]
    if shown in ("kg", f"kg{NARROW}m²") and 0 < abs(size) < 0.1:
        return 1e-3, shown[1:]
    if first not in _TAKES_PREFIX or shown == "s/m" or not (size and math.isfinite(size)) or 0.1 <= abs(size) < 1e4:
        return 1.0, shown
    if first == "s" and abs(size) >= 1.0:
        return 1.0, shown
    factor, prefix = max((one for one in _PREFIXES if one[0] <= abs(size) * (1 + 1e-9)), default=_PREFIXES[0])
    return factor, prefix + shown


def plain(value: float, digits: int = 6) -> str:
    """A number without trailing zeros and with a true minus sign."""
    text = f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e")
    return ("0" if text == "-0" else text).replace("-", "\N{MINUS SIGN}")


def quantity(value: float, unit: str, ci95: tuple[float, float] | None = None) -> Shown:
    """A value in a unit of daily use, with as many digits as its interval bears out, or three."""
    factor, shown = scaled(value, unit)
    ends = [] if ci95 is None else [one / factor for one in ci95]
    width = (ends[1] - ends[0]) / 2 if ends and all(math.isfinite(one) for one in ends) else 0.0
    value /= factor
    if width > 0:
        size = math.floor(math.log10(width) + 1e-9)
        decimals = (1 if width / 10**size < 2 - 1e-9 else 0) - size
    else:
        decimals = 2 - math.floor(math.log10(abs(value))) if value and math.isfinite(value) else 0

    def text(one: float) -> str:
        if not math.isfinite(one):
            return "without limit"
        rounded = round(one, decimals) + 0.0  # no minus zero
        return f"{rounded:.{max(decimals, 0)}f}".replace("-", "\N{MINUS SIGN}")

    low, high = [text(one) for one in ends] or ("", "")
    return Shown(text(value), low, high, shown)


def trusted(value: float, sd: float | None, unit: str) -> str:
    """A value with the standard deviation that it is trusted to, both in one unit: "28.4 ± 0.9 mm"."""
    if not sd:
        return str(quantity(value, unit))
    factor, shown = scaled(value, unit)
    return f"{plain(value / factor, 4)} ± {plain(sd / factor, 2)}" + (f"{NARROW}{shown}" if shown else "")


def signed(value: float, decimals: int) -> str:
    """A change with its sign; what rounds to nothing has none."""
    rounded = round(value, decimals) + 0.0
    return f"{rounded:+.{decimals}f}".replace("-", "\N{MINUS SIGN}") if rounded else f"{0:.{decimals}f}"


def gap_text(gap: float | None) -> str:
    """A gap in multiples of the noise: three digits, at most two decimals."""
    if gap is None or not math.isfinite(gap):
        return _DASH
    return f"{gap:.2f}" if gap < 10 else f"{gap:.1f}" if gap < 100 else f"{gap:.0f}" if gap < 1e4 else plain(gap, 3)


def percent(share: float) -> str:
    """ "44 %"; "under 1 %" and "over 99 %" rather than a rounded nothing or everything."""
    if 0 < share < 0.01:
        return f"under 1{NARROW}%"
    return f"over 99{NARROW}%" if 0.99 < share < 1 else f"{100 * share:.0f}{NARROW}%"


def listed(items: Sequence[str], last: str = "and") -> str:
    """ "a, b and c"."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} {last} {items[-1]}" if items else ""


def verdict(finding: Finding) -> str:
    """The verdict as a sentence or two that need nothing else to be understood."""
    if finding.verdict == "none":
        return _none(finding)
    if finding.verdict == "unknown":
        return _unknown(finding)
    if finding.verdict == "ambiguous":
        return _ambiguous(finding)
    many = len(finding.effects) > 1
    start = f"The simulator lacks {_number_word(len(finding.effects))} effects: " if many else "The simulator lacks "
    named = _with_sizes(finding.effects)
    return f"{start}{named}; with {'them' if many else 'it'} {_falls(finding)}."


def sizes(parameters: Mapping[str, Parameter]) -> str:
    """The values of an effect in a row; a lone one goes without its name."""
    shown = {name: str(quantity(one.value, one.unit, one.ci95)) for name, one in parameters.items()}
    return next(iter(shown.values())) if len(shown) == 1 else listed([f"{say(k)} {v}" for k, v in shown.items()])


def _with_sizes(effects: Sequence[Effect]) -> str:
    """Effects in a row, each with its sizes; semicolons where commas would be one thing too many."""
    said = [f"{explanation(one.name)}, {sizes(one.parameters)}" for one in effects]
    return f"{'; '.join(said[:-1])}; and {said[-1]}" if len(said) > 1 else "".join(said)


def alternatives(effects: Sequence[Effect]) -> list[str]:
    """Every explanation that the data cannot tell from the best one, which comes first: names joined by " + "."""
    first = " + ".join(one.name for one in effects)
    return list(dict.fromkeys([first, *(rival.name for one in effects for rival in one.equivalents)]))


def _none(finding: Finding) -> str:
    role, gap = _proof(finding)
    if gap.after is None:
        return "Nothing is missing that these data could show."
    left = f"on {role} the re-calibrated simulator is {gap_text(gap.after)} times the noise away from the measurement"
    if gap.after > 1.3:
        return f"No effect is named: {left}, but nothing that was tried takes enough of it away to be believed."
    return f"Nothing is missing that these data could show: {left}, and 1 would be noise alone."


def _ambiguous(finding: Finding) -> str:
    rivals = alternatives(finding.effects)
    said = listed([explanation(one) for one in rivals], "or")
    sentence = f"Something is missing, and these data fit {_number_word(len(rivals))} explanations alike: {said}."
    sentence += f" With the first of them {_falls(finding)}."
    return sentence + (f" {finding.next_experiment.advice}" if finding.next_experiment else "")


def _unknown(finding: Finding) -> str:
    found = _with_sizes(finding.effects)
    start = f"The simulator lacks {found}; beside that s" if found else "S"
    sentence = f"{start}omething is missing that no effect of the library explains."
    if finding.term is None:
        return f"{sentence} With all that is named, {_falls(finding)}."
    equation = finding.term.equation.partition(". ")[0]  # what its symbols are stands further down the page
    term = f"{sentence} A term composed for it, {equation},"
    role, gap = _proof(finding)
    if role != _UNSEEN:
        return f"{term} is added: {_falls(finding)}."
    removed = percent(finding.term.removed_held_out)
    return (
        f"{term} takes away {removed} of the gap on {role}, where the error falls from {gap_text(gap.before)} "
        f"to {gap_text(gap.after)} times the noise."
    )


def _proof(finding: Finding) -> tuple[str, Gap]:
    """The runs that prove it: those held out, or where there are none, those fitted."""
    held_out = finding.gap.get("held_out")
    if held_out is not None and held_out.after is not None:
        return _UNSEEN, held_out
    return "the runs it was fitted to", finding.gap.get("fit", Gap(None, None))


def _falls(finding: Finding) -> str:
    role, gap = _proof(finding)
    if gap.after is None:
        return "how far the error falls could not be measured"
    proof = "" if role == _UNSEEN else ", and no run was held out to prove it"
    return f"the error on {role} falls from {gap_text(gap.before)} to {gap_text(gap.after)} times the noise{proof}"


def _number_word(count: int) -> str:
    return {2: "two", 3: "three", 4: "four", 5: "five"}.get(count, str(count))
