"""Findings made by hand, one for each verdict, for runs of the plant; and a parser for the HTML page of a finding."""

from __future__ import annotations

import dataclasses
from html.parser import HTMLParser
from pathlib import Path

from brickpilot import catalogue
from brickpilot.data import reading
from brickpilot.data.audit.audit import Fault
from brickpilot.data.dataset import Dataset
from brickpilot.data.gap import Place, gaps
from brickpilot.data.holdout import Roles
from brickpilot.discover.finding import (
    Effect,
    Equivalent,
    Evidence,
    Experiment,
    Finding,
    NominalChange,
    NominalFinding,
    Parameter,
    Rank,
    RunValues,
    Share,
    Step,
    Term,
    Visible,
    Whiteness,
)
from brickpilot.discover.yardstick import Fit, Predictable, SignalFit, Yardstick
from brickpilot.vehicle import composed_terms
from brickpilot.vehicle.manoeuvres import Manoeuvre
from brickpilot.vehicle.replay import RUN_KINDS, Replay
from synthetic import robot, write

NOISE = {"yaw_rate": 0.014, "wheel_speed_left": 0.05, "wheel_travel_right": 0.0004}
ROLES = {"straight": "fit", "straight_back": "fit", "spin": "held_out", "curve": "fit"}
TRUTH = dataclasses.replace(robot(), effects={"coulomb_friction": {"torque": 0.006}})
COMMAND = "brickpilot discover bench --out 'a & b' --seed 7"
MINUS, DASH = "\N{MINUS SIGN}", "\N{EN DASH}"
VERDICTS = ("none", "named", "ambiguous", "unknown")

TORQUE = Parameter(0.0061, "N m", (0.0058, 0.0064))
FRICTION = Effect("coulomb_friction", "bearing", "coulomb_friction", "wheel", 0.99, {"torque": TORQUE})
DEADBAND = Equivalent("actuator_deadband", {"voltage": Parameter(0.43, "V", None)}, 3.2)
PAIR = Equivalent(
    "rolling_sqrt + gyro_bias",
    {"rolling_sqrt.torque": Parameter(0.0021, "N m", None), "gyro_bias.bias": Parameter(0.011, "rad/s", None)},
    7.9,
)
RAMP = Manoeuvre(
    "a slow ramp", 8.0, ((0.0, 0.0), (4.0, 3.0), (8.0, 0.0)), ((0.0, 0.0), (1.0, 0.0), (1.0, 2.5), (8.0, 0.0))
)
MOVED = NominalFinding("resistance", 22.0, 27.3, "ohm", 4.8, ("payload_mass",))
ASKED = Experiment("Drive a slow ramp.", ("coulomb_friction", "actuator_deadband"), 14.2, "yaw_rate", RAMP)
TERM = Term(
    "wheel torque",
    f"ΔT = {MINUS}0.006 sgn(w)",
    "composed_bench.c",
    composed_terms.terms_of({"wheel_dry_constant": 0.006}),
    {},
    0.923,
)
DIFFERS = RunValues(
    "supply_gain",
    RUN_KINDS["supply_gain"].words,
    RUN_KINDS["supply_gain"].unit,
    {"spin": (0.022, (0.018, 0.026)), "curve": (-0.022, (-0.026, -0.018))},
)
HELD = {
    "none": (Share((), 0.97, ()),),
    "named": (Share(("coulomb_friction",), 0.98, ("bearing",)),),
    "ambiguous": (
        Share(("coulomb_friction",), 0.61, ("bearing",)),
        Share(("actuator_deadband",), 0.24, ("drive",)),
        Share(("rolling_sqrt", "gyro_bias"), 0.11, ("bearing", "sensor")),
    ),
    "unknown": (Share(("coulomb_friction",), 0.5, ("bearing",)), Share(("supply_gain",), 0.46, ("supply",))),
}
RANKING = (
    Rank(("coulomb_friction",), {"coulomb_friction.torque": 0.0061}, 1.02, 0.998, "It holds 98 % of the weight."),
    Rank(
        ("actuator_deadband",),
        {"actuator_deadband.voltage": 0.43},
        2.9,
        0.75,
        "It predicts worse by 812.0, where 3 is sure.",
    ),
    *(Rank((name,), {}, 9.0, 0.1, f"Not {name}.") for name in [one.name for one in catalogue.effects()][:12]),
)


def measured(folder: Path) -> Dataset:
    """Returns four runs of the robot with dry friction and noise; the third run is held out."""
    written = write(folder, TRUTH, NOISE, "", roles=list(ROLES.values()))
    return dataclasses.replace(reading.read(written), name="bench-7")


def all_verdicts(folder: Path) -> dict[str, Finding]:
    """Returns a finding for each verdict, all for the same runs."""
    data = measured(folder)
    return {kind: finding(data, kind) for kind in VERDICTS}


def finding(data: Dataset, kind: str) -> Finding:
    """Returns a finding of verdict `kind` for `data`: its simulations and gaps are computed, the rest is invented."""
    nominal = robot()
    augmented = nominal if kind == "none" else TRUTH
    simulated = dict(zip(("nominal", "augmented"), Replay(data).simulate([nominal, augmented]), strict=True))
    roles = {run.name: run.role for run in data.runs}
    by_role, by_signal = gaps(data, simulated, Roles(roles, ""), NOISE)
    effects = {
        "named": (FRICTION,),
        "ambiguous": (dataclasses.replace(FRICTION, equivalents=(DEADBAND, PAIR)),),
    }
    where = (
        Place("spin", "yaw_rate", 0.2, 1.31, 0.44, "turning"),
        Place("curve", "yaw_rate", 0.1, 1.9, 0.21, "speed > 0"),
    )
    white = Whiteness(0.03, tuple(0.01 * (-1) ** lag for lag in range(20)), 0.05, True)
    coloured = Whiteness(0.03, tuple(0.8**lag for lag in range(20)), 0.05, False)
    return Finding(
        dataset=data,
        verdict=kind,
        yardstick=Yardstick(),
        mechanism=None if kind == "none" else "bearing",
        evidence=None if kind == "none" else Evidence("held_out", 0.99, 0.98, 1.0, False, "Held-out runs confirm it."),
        effects=effects.get(kind, ()),
        where=() if kind == "none" else where,
        gap=by_role,
        by_signal=by_signal,
        nominal={
            "resistance": NominalChange(22.0, 27.3, "ohm", 1.1, True),
            "wheel_radius": NominalChange(0.0408, 0.0406, "m", 0.0003, False),
            "viscous_friction": NominalChange(0.0, 1.8e-5, "N m s/rad", None, False),
        },
        nominal_findings=(MOVED,) if kind == "none" else (),
        next_experiment=ASKED if kind == "ambiguous" else None,
        ranking=() if kind == "none" else RANKING,
        whiteness={"yaw_rate": white, "wheel_speed_left": coloured},
        power={"gyro_bias": Visible("bias", 0.0021, "rad/s"), "battery_sag": Visible("resistance", 0.41, "ohm")},
        term=TERM if kind == "unknown" else None,
        nominal_model=nominal,
        augmented=augmented,
        simulated=simulated,
        roles=roles,
        faults=tuple(Fault("curve", "yaw_rate", "frozen", 0.1 * k, 0.1 * k + 0.03) for k in range(23)),
        notes=("The data set states which runs are held out.", "A note with <script>alert(1)</script> in it."),
        noise_sd=NOISE,
        explanations=HELD[kind],
        steps=(Step("weigh", kind, "The evidence <b>says</b> so."),),
        predictable_left={"yaw_rate": 0.31 if kind == "unknown" else 0.04},
        elapsed_s=6.24,
        seed=7,
    )


def yardstick(none: bool) -> Yardstick:
    """Returns a yardstick for the verdict `none` or another; its second signal hardly moves on the held-out run."""
    after, removed = (74.9, None) if none else (96.25, 0.97)
    rate = SignalFit(Fit(81.2, after, 97.0), Fit(74.9, after, 98.0), 98.4)
    still = SignalFit(Fit(-1234.5, after, 99.614), Fit(None, None, None), None)
    share = Predictable(0.88, 0.9, removed, removed)
    horizons = ("free_run", "1_s", "0.2_s")
    signals = {"yaw_rate": dict.fromkeys(horizons, rate), "wheel_speed_left": dict.fromkeys(horizons[:2], still)}
    return Yardstick(signals, {"free_run": share}, ())


class Page(HTMLParser):
    """The elements of a page, and the text of each section and table row. Every element has to be closed."""

    VOID = frozenset({"meta", "br", "hr", "img", "input", "link"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.within: list[str | None] = []
        self.sections: dict[str, str] = {}
        self.rows: list[list[str]] = []
        self.text = ""
        self.scripts: list[str] = []
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len(dict(attrs)) == len(attrs), f"an attribute twice in <{tag}>"
        self.elements.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)
            self.within.append(dict(attrs).get("id") if tag == "section" else None)
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        self.within.pop()

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
            return
        text = data.replace("\N{NO-BREAK SPACE}", " ")
        self.text += text
        for section in filter(None, self.within):
            self.sections[section] = self.sections.get(section, "") + text
        if self.open and any(tag in ("th", "td") for tag in self.open) and "svg" not in self.open:
            self.rows[-1][-1] += text

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    def row(self, *start: str) -> list[str]:
        """Returns the only row of a table that begins with these cells."""
        (only,) = (row for row in map(self._clean, self.rows) if row[: len(start)] == list(start))
        return only

    @staticmethod
    def _clean(row: list[str]) -> list[str]:
        return [" ".join(cell.split()) for cell in row]
