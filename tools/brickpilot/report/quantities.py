"""Writes values as text, with a convenient unit, the digits that the uncertainty supports, and true minus signs."""

from __future__ import annotations

import math
from dataclasses import dataclass

DASH = "\N{EN DASH}"
"""The text for a missing value."""

ROLES = {"fit": "fit run", "held_out": "held-out run"}
"""Role of a run -> its name on pages."""

RUNS = {"held_out": "held-out runs", "fit": "fit runs"}
"""Role -> the words for the runs with this role, in the order in which pages show them."""

_SPACE = "\N{NO-BREAK SPACE}"
_MINUS = "\N{MINUS SIGN}"

_PREFIXES = ((1e-9, "n"), (1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"), (1e6, "M"))
_TAKES_PREFIX = frozenset({"N", "V", "A", "H", "W", "Ω", "m", "s", "rad"})  # get a prefix as the first factor of a unit


@dataclass(frozen=True)
class Shown:
    """A value as text. `low` and `high` are empty if the value has no interval; `unit` is empty if it has no unit."""

    value: str
    low: str
    high: str
    unit: str

    def __str__(self) -> str:
        unit = f"{_SPACE}{self.unit}" if self.unit else ""
        return f"{self.value}{unit}" + (f" ({self.low} to {self.high})" if self.low else "")


def say(name: str) -> str:
    """Returns a name of the program with blanks instead of underscores."""
    return name.replace("_", " ")


def ascii_text(text: str) -> str:
    """Returns text for a terminal: with blanks, minus signs and dashes of ASCII."""
    return text.replace(_MINUS, "-").replace(DASH, "-").replace(_SPACE, " ").replace("< -", "<-")


def unit_text(unit: str) -> str:
    """Returns a unit as text: "N m s/rad" with spaces that do not break, "m/s²", "Ω"; nothing for a plain number."""
    if unit == "1":
        return ""
    return unit.replace("ohm", "Ω").replace("^2", "²").replace("^3", "³").replace(" ", _SPACE)


def scaled(size: float, unit: str) -> tuple[float, str]:
    """Returns (factor, unit text); a value of about `size`, divided by the factor, is in the unit of the text."""
    shown = unit_text(unit)
    first = shown.split(_SPACE)[0].split("/")[0]
    if shown in ("kg", f"kg{_SPACE}m²") and 0 < abs(size) < 0.1:
        return 1e-3, shown[1:]
    if first not in _TAKES_PREFIX or shown == "s/m" or not (size and math.isfinite(size)) or 0.1 <= abs(size) < 1e4:
        return 1.0, shown
    if first == "s" and abs(size) >= 1.0:
        return 1.0, shown
    factor, prefix = max((one for one in _PREFIXES if one[0] <= abs(size) * (1 + 1e-9)), default=_PREFIXES[0])
    return factor, prefix + shown


def plain(value: float, digits: int = 6) -> str:
    """Returns a number without trailing zeros and with a true minus sign."""
    text = f"{value:.{digits}g}".replace("e-0", "e-").replace("e+0", "e")
    return ("0" if text == "-0" else text).replace("-", _MINUS)


def quantity(value: float, unit: str, ci95: tuple[float, float] | None = None) -> Shown:
    """Returns a value in a convenient unit, with the digits that its interval supports, or with three digits."""
    half = (ci95[1] - ci95[0]) / 2 if ci95 is not None and all(map(math.isfinite, ci95)) else 0.0
    factor, shown = scaled(value if abs(value) > half / 10 else half, unit)  # near 0, the interval gives the scale
    ends = [] if ci95 is None else [one / factor for one in ci95]
    value, width = value / factor, half / factor
    if width > 0:
        decimals = _decimals(width)
    else:
        decimals = 2 - math.floor(math.log10(abs(value))) if value and math.isfinite(value) else 0

    low, high = [_fixed(one, decimals) for one in ends] or ("", "")
    return Shown(_fixed(value, decimals), low, high, shown)


def _fixed(value: float, decimals: int) -> str:
    """Returns a number with `decimals` decimals; negative `decimals` round to tens, hundreds and so on."""
    if not math.isfinite(value):
        return "without limit"
    rounded = round(value, decimals) + 0.0  # turns -0 into 0
    return f"{rounded:.{max(decimals, 0)}f}".replace("-", _MINUS)


def _decimals(half: float) -> int:
    """Returns how many decimals show two digits of an interval's half width, or one digit if its first is not 1."""
    size = math.floor(math.log10(half) + 1e-9)
    return (1 if half / 10**size < 2 - 1e-9 else 0) - size


def in_words(value: float, unit: str, ci95: tuple[float, float] | None = None) -> tuple[str, str]:
    """Returns a size, and its interval or an empty text, for a sentence: "12 %" and " (12 to 13 %)".

    The size has as many digits as in `quantity`; a number without a unit is a share, shown in percent.
    """
    per, shown = (0.01, "%") if unit == "1" else scaled(value, unit)
    ends = [one / per for one in ci95 or ()]
    suffix = f"{_SPACE}{shown}" if shown else ""
    if not ends or not all(math.isfinite(one) for one in ends):
        return f"{plain(float(f'{value / per:.2g}'))}{suffix}", ""
    half = (ends[1] - ends[0]) / 2
    decimals = min(_decimals(half), 6) if half > 0 else 6
    text, low, high = (_fixed(one, decimals) for one in (value / per, *ends))
    return f"{text}{suffix}", f" ({low} to {high}{suffix})"


def trusted(value: float, sd: float | None, unit: str) -> str:
    """Returns a value with its standard deviation, both in one unit: "28.4 ± 0.9 mm"."""
    if not sd:
        return str(quantity(value, unit))
    factor, shown = scaled(value, unit)
    return f"{plain(value / factor, 4)} ± {plain(sd / factor, 2)}" + (f"{_SPACE}{shown}" if shown else "")


def signed(value: float, decimals: int) -> str:
    """Returns a change with its sign; a change that rounds to zero has no sign."""
    rounded = round(value, decimals) + 0.0
    return f"{rounded:+.{decimals}f}".replace("-", _MINUS) if rounded else f"{0:.{decimals}f}"


def gap_text(gap: float | None) -> str:
    """Returns a gap in multiples of the noise, with three digits and at most two decimals."""
    if gap is None or not math.isfinite(gap):
        return DASH
    return f"{gap:.2f}" if gap < 10 else f"{gap:.1f}" if gap < 100 else f"{gap:.0f}" if gap < 1e4 else plain(gap, 3)


def percent(share: float) -> str:
    """Returns a share as "44 %"; "under 1 %" and "over 99 %" instead of a rounded 0 or 100 %."""
    if 0 < share < 0.01:
        return f"under 1{_SPACE}%"
    return f"over 99{_SPACE}%" if 0.99 < share < 1 else f"{100 * share:.0f}{_SPACE}%"


def number(value: float | None) -> str:
    """Returns a number with four digits; a dash if there is no number."""
    return DASH if value is None or not math.isfinite(value) else f"{value:.4g}"


def fit_number(value: float | None) -> str:
    """Returns a fit in percent without its unit: "93.1", "99.62" near 100, "< -999"; a dash if there is no fit."""
    if value is None:
        return DASH
    if value < -999:
        return f"< {_MINUS}999"
    return f"{value:.2f}" if value >= 99 else f"{value:.1f}".replace("-", _MINUS)


def fit_text(value: float | None) -> str:
    """Returns a fit as text: "93.1 %"; a dash if there is no fit."""
    return DASH if value is None else f"{fit_number(value)}{_SPACE}%"
