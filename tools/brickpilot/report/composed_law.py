"""Writes a composed law (terms that discovery adds to an equation) as MathML, and as the C file of an effect."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from brickpilot.discover import finding
from brickpilot.report.template import render_plain
from brickpilot.vehicle.composed_terms import (
    EFFECT,
    MINUS,
    OF_A_MOTOR,
    Term,
    Writer,
    legend,
    parameters,
    sums,
    symbol,
)

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_WORD = re.compile(r"(?<![>.\w])[A-Za-z_]\w*")

# A hook is a C function by which the plant calls an effect. For each hook: symbol -> the C code of the symbol's value.
# The symbols are in an order in which C can declare them.
_STEPS, _AGE = "kept->time + 0.5 * vehicle->step", "vehicle->state.age - kept->start_age"
_NOW = " + clock * kept->start_age"
_VOLTS = "isnan(vehicle->voltage[k]) ? 0 : vehicle->voltage[k]"
_SPEED = "vehicle->state.wheel_speed[k]"
_DRIVE = {"V": _VOLTS, "other": "isnan(command[1 - k]) ? 0 : command[1 - k]", "w": _SPEED, "t": _STEPS + _NOW}
_LOSS = {"w": "speed + 0.5 * (speed - kept->speed[k])", "t": _STEPS + _NOW}
_WHEEL = {
    "V": _VOLTS,
    "i": "vehicle->state.current[k]",
    "w": _SPEED,
    "theta": f"vehicle->state.wheel_angle[k] + 0.5 * vehicle->step * {_SPEED}",
    "t": _STEPS + _NOW,
}
_BODY = {
    "half": "0.5 * vehicle->step",
    "u": "vehicle->middle.surge",
    "r": "vehicle->middle.yaw_rate",
    "psi": "vehicle->middle.heading",
    "x": "vehicle->state.x + half * (vehicle->state.surge * cos(psi) - vehicle->state.sway * sin(psi))",
    "y": "vehicle->state.y + half * (vehicle->state.surge * sin(psi) + vehicle->state.sway * cos(psi))",
    "t": f"{_AGE} + half{_NOW}",
    "patch": "window((x - patch_x) / patch_half_width)",
    "half_track": "vehicle->parameter[PARAMETER_HALF_TRACK]",
    "sprung_surge": "sprung_push(kept->surge, frequency, damping, vehicle->surge_rate, kept->step)",
    "sprung_yaw": "sprung_push(kept->yaw, frequency, damping, vehicle->yaw_accel, kept->step)",
}
_MOTOR = {"r": "0", "psi": "0", "x": "lever(vehicle) * vehicle->state.wheel_angle[0] + half * u", "y": "0"}
_FLOOR = {"patch": _BODY["patch"]}
_SENSOR = {
    "u": "vehicle->state.surge",
    "r": "vehicle->state.yaw_rate",
    "a": "vehicle->output[OUTPUT_ACCEL_SURGE]",
    "b": "vehicle->output[OUTPUT_ACCEL_SWAY]",
    "i_left": "vehicle->state.current[0]",
    "i_right": "vehicle->state.current[1]",
    "w": _SPEED,
    "theta": "vehicle->state.wheel_angle[k]",
    "t": _AGE + _NOW,
}
_HOOKS = {
    "drive": (("drive_gain", "drive_add"), _DRIVE),
    "motor": (("wheel_loss",), _LOSS),
    "wheel": (("wheel_dry", "wheel_gain", "wheel_push"), _WHEEL),
    "body": (("surge_dry", "surge_loss", "surge_push", "yaw_dry", "yaw_loss", "yaw_push"), _BODY),
    "floor": (("floor_add",), _FLOOR),
    "sensor": (("encoder_gain", "gyro_add", "accel_surge_add", "accel_sway_add"), _SENSOR),
}
_KEEPING = frozenset({"wheel_loss", "surge_dry", "yaw_dry", "encoder_gain", "gyro_add"})
_ACTS_ON = {"drive": "drive", "wheel": "wheel", "surge": "body", "yaw": "body", "floor": "body"}
_ON_THE_FLOOR = frozenset({"body", "sensor"})  # hooks that need the slope of the floor


@dataclass(frozen=True)
class _Hook:
    """One hook: a C function by which the plant calls the effect.

    Attributes:
        locals: symbol -> the C code that computes it.
        sums: name -> a sum of terms in C; "surge_loss" sums the terms with place "surge" and kind "loss".
        keeps: whether the hook uses the effect's memory.
    """

    locals: Mapping[str, str]
    sums: Mapping[str, str]
    keeps: bool

    @property
    def common(self) -> dict[str, str]:
        """The locals whose code does not use the number k of a wheel."""
        return {symbol: code for symbol, code in self.locals.items() if "[k]" not in code}

    @property
    def of_a_wheel(self) -> dict[str, str]:
        return {symbol: code for symbol, code in self.locals.items() if "[k]" in code}


def of_finding(found: finding.Finding) -> dict[str, str]:
    """Returns file name -> text of the C file of the composed term; empty: there is no composed term."""
    term = found.term
    if term is None:
        return {}
    name = term.source.removesuffix(".c")
    return {term.source: render(term.law, term.settings, name=name, vehicle=found.dataset.vehicle)}


def render(terms: Sequence[Term], settings: Mapping[str, float], *, name: str, vehicle: str) -> str:
    """Returns the text of ``NAME.c``: an effect with these terms alone; their coefficients are the effect's presets.

    Args:
        settings: name -> value of each parameter that shapes terms; the composed effect has these parameters, too.
        name: name of the effect and of the file; a C identifier in lower case.
        vehicle: the only kind of vehicle that the effect acts on.

    Raises:
        ValueError: no term is given, `name` is no C identifier, a setting is missing, or a term cannot act on
            this vehicle.
    """
    if not terms or not _NAME.fullmatch(name):
        raise ValueError(f"no effect can be made of {len(terms)} terms and the name {name!r}")
    missing = {setting for term in terms for setting in term.basis.tuned} - settings.keys()
    if missing:
        raise ValueError(f"no value for {', '.join(sorted(missing))}")
    motor = vehicle == "motor"
    if motor and any(term.basis.sided or term.basis.place not in OF_A_MOTOR for term in terms):
        raise ValueError("a term does not act on a motor")
    hooks = {site: _hook(site, terms, settings, motor=motor) for site in _HOOKS}
    used = {symbol for hook in hooks.values() for symbol in hook.locals}
    words = _words(code for hook in hooks.values() for code in (*hook.sums.values(), *hook.locals.values()))
    if "sprung_push" in words:
        words.add("PI")
    memory = _memory(hooks, used)
    floor = hooks.pop("floor")
    sites = [
        site
        for site, hook in hooks.items()
        if hook.sums or (site == "wheel" and _WHEEL_KEEPS & memory.keys()) or (floor.sums and site in _ON_THE_FLOOR)
    ]
    if memory.keys() & {"start_age", "speed[2]"}:
        sites.insert(0, "start")
    shaping = [(info, float(settings[info.name]), info.meaning) for info in parameters() if info.name in settings]
    content = {
        "name": name,
        "laws": _laws(terms),
        "words": words,
        "memory": memory,
        "count": 1 if motor else 2,
        "motor": motor,
        "motor_hook": hooks.pop("motor"),
        "floor": floor,
        "sites": sites,
        "parameters": [(term.basis.info, float(term.coefficient), "coefficient") for term in terms] + shaping,
        "repr": repr,
        "general": EFFECT,
        "acts_on": _ACTS_ON.get(terms[0].basis.place, "sensor"),
        "mechanism": terms[0].basis.mechanism,
    }
    return render_plain("composed_effect.c", **content, **hooks)


def _hook(site: str, terms: Sequence[Term], settings: Mapping[str, float], *, motor: bool) -> _Hook:
    kinds, sources = _HOOKS[site]
    sources = {name: f"value[{name.upper()}]" for name in settings} | sources
    if motor and site == "body":
        sources |= _MOTOR
    sums = {kind: text for kind in kinds if (text := _sum(terms, kind))}
    needed = _words(sums.values()) | ({"half_track"} if "yaw_loss" in sums else set())
    if site == "body" and any(term.basis.place == "floor" for term in terms):
        needed |= {"x", "psi"}
    while more := _words(sources[word] for word in needed if word in sources) - needed:
        needed |= more
    found = {symbol: code for symbol, code in sources.items() if symbol in needed}
    return _Hook(found, sums, "kept" in needed or bool(_KEEPING & sums.keys()))


def _sum(terms: Sequence[Term], kind: str) -> str:
    """Returns the sum of the terms of one kind; terms with opposite signs left and right share a factor of 1 or -1."""
    chosen = [term.basis for term in terms if f"{term.basis.place}_{term.basis.kind}" == kind]
    place = kind.split("_")[0]

    def added(sided: bool) -> str:
        return " + ".join(
            f"value[{one.name.upper()}] * {_bracketed(one.expression.replace('sprung', f'sprung_{place}'))}"
            for one in chosen
            if one.sided == sided
        )

    sides = f"(k == 0 ? 1 : -1) * ({added(True)})" if added(True) else ""
    return " + ".join(part for part in (added(False), sides) if part)


def _bracketed(expression: str) -> str:
    return expression if expression.isidentifier() or expression.isdigit() else f"({expression})"


def _words(texts: Iterable[str]) -> set[str]:
    return {word for text in texts for word in _WORD.findall(text)}


_WHEEL_KEEPS = frozenset({"time", "dry_surge", "dry_yaw"})


def _memory(hooks: Mapping[str, _Hook], used: set[str]) -> dict[str, str]:
    """Returns field -> comment, for each needed field of the effect's memory."""
    body = hooks["body"].sums
    fields: dict[str, tuple[bool, str]] = {
        "start_age": ("t" in used, "s"),
        "time": (any("t" in hooks[site].locals for site in ("drive", "motor", "wheel")), "s since the run's start"),
        "speed[2]": (bool(hooks["motor"].sums), "rad/s, of the wheels a body step ago"),
        "step": (bool({"sprung_surge", "sprung_yaw"} & used), "s, the last body step"),
        "surge[2]": ("sprung_surge" in used, "m, m/s: of the sprung mass"),
        "yaw[2]": ("sprung_yaw" in used, "rad, rad/s: of the sprung mass"),
        "dry_surge": ("surge_dry" in body, "N"),
        "dry_yaw": ("yaw_dry" in body, "N m"),
        "wheel_error[2]": ("encoder_gain" in hooks["sensor"].sums, "rad/s, of the rotation sensors"),
        "wheel_angle[2]": ("encoder_gain" in hooks["sensor"].sums, "rad, of the rotation sensors"),
        "error": ("gyro_add" in hooks["sensor"].sums, "rad/s"),
        "angle": ("gyro_add" in hooks["sensor"].sums, "rad"),
    }
    return {field: comment for field, (needed, comment) in fields.items() if needed}


def _laws(terms: Sequence[Term]) -> list[str]:
    """Returns the laws as the plant's table writes them, with the names of their parameters."""
    return [
        f"{one.target} += {one.sign.replace('c *', f'{one.name} *')}{_bracketed(one.expression)}{one.factor}"
        for one in (term.basis for term in terms)
    ]


def as_html(term: finding.Term) -> str:
    """Returns the equation of a composed term and the meaning of its symbols, escaped."""
    return f"{mathml(term.law, term.settings)}<p>{legend(term.law, term.settings)}</p>"


def mathml(terms: Sequence[Term], settings: Mapping[str, float]) -> str:
    """Returns the sum that the terms add to each quantity, as escaped presentation MathML."""
    out = _Math()
    return "".join(
        f'<math display="block"><mi>Δ</mi>{out.symbol(target)}<mo>=</mo>{added}</math>'
        for target, added in sums(terms, settings, out)
    )


class _Math(Writer):
    """Writes presentation MathML, escaped."""

    def number(self, value: float) -> str:
        return f"<mn>{value:.4g}</mn>"

    def symbol(self, name: str) -> str:
        shown = html.escape(symbol(name))
        letter, _, index = shown.partition("_")
        return f"<msub><mi>{letter}</mi><mi>{index}</mi></msub>" if index else f"<mi>{shown}</mi>"

    def power(self, base: str, exponent: int) -> str:
        return f"<msup>{base}<mn>{exponent}</mn></msup>"

    def product(self, factors: list[str]) -> str:
        return "".join(
            one if k == 0 else f"<mo>{'·' if one.startswith('<mn>') else '&#8290;'}</mo>{one}"
            for k, one in enumerate(factors)
        )

    def bracket(self, inner: str) -> str:
        return f"<mrow><mo>(</mo>{inner}<mo>)</mo></mrow>"

    def call(self, name: str, inner: str) -> str:
        if name == "fabs":
            return f"<mrow><mo>|</mo>{inner}<mo>|</mo></mrow>"
        if name == "sqrt":
            return f"<msqrt>{inner}</msqrt>"
        return f"<mi>{'sgn' if name == 'sign' else name}</mi>{self.bracket(inner)}"

    def over(self, above: str, below: str) -> str:
        return f"<mfrac><mrow>{above}</mrow><mrow>{below}</mrow></mfrac>"

    def operator(self, sign: str) -> str:
        return f"<mo>{sign}</mo>"

    def minus(self) -> str:
        return f"<mo>{MINUS}</mo>"
