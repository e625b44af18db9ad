"""A campaign file, which `brickpilot campaign` reads, states many flights and the inputs that differ between them.

    [campaign]
    name     = "tolerances"
    design   = "monte_carlo"      # the default; or "latin_hypercube", "sobol", "grid", "saltelli", "morris"
    runs     = 1000               # number of runs; for sobol a power of two. Other designs have another key:
                                  # grid: repeats, runs at each point; saltelli: samples of (inputs + 2) runs,
                                  # a power of two; morris: trajectories of (inputs + 1) runs
    seed     = 0                  # seed of all draws; with a run's number it gives the noise of the run
    scenario = "mission"          # a packaged mission or a file beside this one; a list makes it an input
    sensors  = "imu+encoders"     # as in `brickpilot run`; or a list
    profile  = "coupled"
    model    = "model.toml"       # files beside this one, as in `brickpilot run`; all are optional
    gains    = "gains.toml"
    compensation = "compensation.toml"
    robots   = "data"             # each run has a robot that calibrate.json or verdict.json beside the model allows

    [vary]                        # each input: a number, a list, or a distribution
    parameter.mass               = { distribution = "normal", mean = 0.9, sd = 0.05 }     # low, high: truncate it
    parameter.battery_voltage    = { distribution = "uniform", low = 7.5, high = 9.5 }    # or "loguniform"
    effect.NAME.PARAMETER        = { distribution = "lognormal", median = 0.01, sd_of_log = 0.5 }
    effect.NAME.chance           = 0.3                           # probability that a run has the effect
    sensor.gyro_noise_sd         = { distribution = "choice", values = [0.01, 0.02], weights = [3, 1] }
    gain.heading_kp              = [10, 12, 14]      # equally likely values; the axis of a grid
    start.heading_deg            = 5                 # fixed

    [route]                       # waypoints drawn in a box, instead of the scenario's route
    waypoints = 6
    x_m = [-1.5, 1.5]
    y_m = [-1.5, 1.5]
    least_leg_m = 0.5             # least distance from the start to the first point, and so on
    duration_s = 90               # duration of the flight; default: the scenario's

    [[faults]]                    # as in a scenario; from_s, to_s and rate may be distributions
    kind = "drop"
    from_s = 5
    to_s = { distribution = "uniform", low = 6, high = 20 }
    rate = { distribution = "uniform", low = 0, high = 0.5 }
    chance = 0.5                  # probability that a run has the fault

`ranges` and `effects` of `inputs.py` list what `[vary]` takes.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from brickpilot import __version__
from brickpilot.campaign import inputs, robots
from brickpilot.campaign.inputs import Input
from brickpilot.campaign.robots import Allowed
from brickpilot.constants import STEP_S
from brickpilot.data.toml_file import TomlFile
from brickpilot.errors import InputError
from brickpilot.vehicle import compensation, gains, model, scenario
from brickpilot.vehicle.compensation import Compensation
from brickpilot.vehicle.gains import Gains
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.scenario import Fault, Scenario

COUNTS = {
    "monte_carlo": "runs", "latin_hypercube": "runs", "sobol": "runs", "grid": "repeats", "saltelli": "samples",
    "morris": "trajectories",
}  # fmt: skip
"""Design -> the key that states its size."""

MOST_RUNS = 1_000_000
_KEYS = ("name", "design", "seed", "scenario", "sensors", "profile", "model", "gains", "compensation", "robots")
ROBOTS = ("model", "data")
"""The source of all values that `[vary]` does not state: the model, or robots with drawn values that the data allow."""


@dataclass(frozen=True)
class Box:
    """The box in which routes are drawn, in m: each route has `waypoints` points, and legs of at least `least_leg`."""

    waypoints: int
    x: tuple[float, float]
    y: tuple[float, float]
    least_leg: float
    duration: float | None


@dataclass(frozen=True)
class Campaign:
    """A campaign file, with the content of all files that it names.

    Attributes:
        count: the number of runs, repeats, samples or trajectories: see COUNTS.
        inputs: all inputs of runs, in the file's order, including inputs with a fixed value.
        faults: name -> a fault, with the values that are equal in all runs.
        box: the box of drawn routes; None: the routes are those of the scenarios.
        robots: the robots from which each run draws one; None: all runs have the model's values.
    """

    name: str
    design: str
    count: int
    seed: int
    scenarios: tuple[Scenario, ...]
    sensors: tuple[str, ...]
    profile: str | None
    model: Model
    gains: Gains | None
    compensation: Compensation | None
    inputs: tuple[Input, ...]
    faults: Mapping[str, Fault] = field(default_factory=dict)
    box: Box | None = None
    robots: Allowed | None = field(default=None, repr=False)

    @property
    def drawn(self) -> tuple[Input, ...]:
        """The inputs in which runs differ: the dimensions of the design."""
        return tuple(input_ for input_ in self.inputs if input_.distribution.varies)

    @property
    def block_runs(self) -> int:
        """The number of runs in a block: see `designs.block`."""
        return {"saltelli": len(self.drawn) + 2, "morris": len(self.drawn) + 1}.get(self.design, 1)

    @property
    def runs(self) -> int:
        """The number of runs."""
        if self.design == "grid":
            return self.count * math.prod(input_.levels for input_ in self.drawn if input_.distribution.listed)
        return self.count * self.block_runs

    @property
    def over_a_link(self) -> bool:
        """Whether runs may have faults, which need a link."""
        return bool(self.faults) or any(scenario_.faults for scenario_ in self.scenarios)

    def identity(self) -> str:
        """Returns a hash of the files' contents, without their names: it differs if the results may differ."""
        allowed = "" if self.robots is None else self.robots.identity()
        return hashlib.sha256(f"{__version__} {self!r} {allowed}".encode()).hexdigest()


def load(
    path: Path, *, count: int | None = None, seed: int | None = None, shares: Mapping[str, float] | None = None
) -> Campaign:
    """Reads and checks a campaign file.

    Args:
        count, seed: values that replace those of the file.
        shares: relative sd of nominal values that nobody measured, see `robots.Allowed`; `robots = "data"` needs them.

    Raises:
        InputError: the message names the file, line and key.
    """
    toml = TomlFile(path)
    toml.known_keys((), toml.data, ("campaign", "vary", "route", "faults"), ("campaign",))
    head = toml.table(("campaign",), toml.data["campaign"])
    design = toml.choice(("campaign", "design"), head.get("design", "monte_carlo"), COUNTS)
    for name in set(COUNTS.values()) - {COUNTS[design]}:
        if name in head:
            toml.refuse(("campaign", name), f"does not belong to {design}, which takes {COUNTS[design]}")
    toml.known_keys(("campaign",), head, (*_KEYS, COUNTS[design]), ("name",))
    scenarios, sensors = _scenarios(toml, head), _choices(toml, head, "sensors", scenario.SENSORS)
    chosen = [
        inputs.labelled("scenario", [scenario_.name for scenario_ in scenarios]),
        inputs.labelled("sensors", sensors),
    ]
    varied = inputs.parse(toml, sensors)
    faults, of_faults = inputs.faults(toml, min(scenario_.duration for scenario_ in scenarios))
    files = {
        key: toml.file_beside(("campaign", key), head[key]) for key in ("model", "gains", "compensation") if key in head
    }
    robot = model.load(files["model"]) if "model" in files else model.rcx()
    campaign = Campaign(
        name=toml.file_name(("campaign", "name"), head["name"]),
        design=design,
        count=_count(toml, head, design, count),
        seed=_whole(toml, ("campaign", "seed"), head.get("seed", 0), 0, 2**63 - 1) if seed is None else seed,
        scenarios=scenarios,
        sensors=sensors,
        profile=toml.choice(("campaign", "profile"), head["profile"], scenario.PROFILES) if "profile" in head else None,
        model=robot,
        gains=gains.load(files["gains"]) if "gains" in files else None,
        compensation=compensation.load(files["compensation"]) if "compensation" in files else None,
        inputs=tuple(input_ for input_ in (*chosen, *varied, *of_faults) if input_ is not None),
        faults=faults,
        box=_box(toml),
        robots=_robots(toml, head, robot, files.get("model"), shares),
    )
    _check(toml, campaign)
    return campaign


def _robots(
    toml: TomlFile, head: Mapping[str, Any], model: Model, file: Path | None, shares: Mapping[str, float] | None
) -> Allowed | None:
    """Returns the robots that the data allow; None: the campaign file does not ask for them. `file`: model.toml."""
    if toml.choice(("campaign", "robots"), head.get("robots", ROBOTS[0]), ROBOTS) == ROBOTS[0]:
        return None
    if file is None:
        toml.refuse(("campaign", "robots"), "needs campaign.model: a file that calibrate or discover wrote")
    if shares is None:
        raise ValueError("shares are needed to draw robots")
    return dataclasses.replace(robots.read(model, file, shares), devices=inputs.devices())


def _choices(toml: TomlFile, head: Mapping[str, Any], key: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the value of a key, or the values of its list; the default, `known[0]`, if the key is absent."""
    given = head.get(key, known[0])
    values = given if isinstance(given, list) else [given]
    if not values or len({str(value) for value in values}) < len(values):
        toml.refuse(("campaign", key), "needs a value, or a list of values that differ")
    return tuple(toml.choice(("campaign", key), value, known) for value in values)


def _scenarios(toml: TomlFile, head: Mapping[str, Any]) -> tuple[Scenario, ...]:
    given = head.get("scenario", "mission")
    names = given if isinstance(given, list) else [given]
    scenarios = []
    for name in names:
        text = toml.text(("campaign", "scenario"), name)
        packaged = scenario.packaged()
        if text not in packaged and not (toml.path.parent / text).exists():
            known = ", ".join(packaged)
            toml.refuse(("campaign", "scenario"), f"{text!r} is no file, and no scenario of that name; known: {known}")
        scenarios.append(scenario.load(packaged.get(text) or toml.file_beside(("campaign", "scenario"), text)))
        if scenarios[-1].kind != "mission":
            toml.refuse(("campaign", "scenario"), f"{text!r} is a manoeuvre; a campaign flies missions")
    if not scenarios or len({scenario_.name for scenario_ in scenarios}) < len(scenarios):
        toml.refuse(("campaign", "scenario"), "needs a scenario, or a list of scenarios with different names")
    return tuple(scenarios)


def _whole(toml: TomlFile, key: tuple[str, str], value: Any, low: int, high: int) -> int:
    """Returns a whole number as an int, because a float may not hold all its digits."""
    toml.number(key, value, low, high)
    if int(value) != value:
        toml.refuse(key, f"{value} is not a whole number")
    return int(value)


def _count(toml: TomlFile, head: Mapping[str, Any], design: str, given: int | None) -> int:
    key = ("campaign", COUNTS[design])
    preset = 1 if design == "grid" else 1000
    if design not in ("monte_carlo", "latin_hypercube", "grid") and key[1] not in head and given is None:
        toml.refuse(key, "is missing")
    value = head.get(key[1], preset) if given is None else given
    count = _whole(toml, key, value, 1, MOST_RUNS)
    if design in ("sobol", "saltelli") and count & (count - 1):
        below = 1 << (count.bit_length() - 1)
        toml.refuse(key, f"{count} is not a power of two, as {design} needs; {below} and {2 * below} are")
    return count


def _box(toml: TomlFile) -> Box | None:
    if "route" not in toml.data:
        return None
    table = toml.table(("route",), toml.data["route"])
    needed = ("waypoints", "x_m", "y_m")
    toml.known_keys(("route",), table, (*needed, "least_leg_m", "duration_s"), needed)
    waypoints = _whole(toml, ("route", "waypoints"), table["waypoints"], 1, 32)
    x, y = (_ends(toml, name, table[name]) for name in ("x_m", "y_m"))
    across = min(x[1] - x[0], y[1] - y[0])
    least = toml.number(("route", "least_leg_m"), table.get("least_leg_m", across / 4), 0.01, across / 2, "m")
    duration = table.get("duration_s")
    if duration is not None:
        duration = toml.number(("route", "duration_s"), duration, STEP_S, 3600.0, "s")
    return Box(waypoints, x, y, least, duration)


def _ends(toml: TomlFile, name: str, value: object) -> tuple[float, float]:
    key = ("route", name)
    if not isinstance(value, list) or len(value) != 2:
        toml.refuse(key, "needs [from, to]")
    possible = inputs.ranges()["start"]["x_m"]
    low, high = (toml.number(key, end, possible.low, possible.high, "m") for end in value)
    if high - low < 0.1:
        toml.refuse(key, "needs a box of 0.1 m or more")
    return low, high


def _check(toml: TomlFile, campaign: Campaign) -> None:
    """Refuses a campaign that no design can fly."""
    if campaign.model.vehicle == "motor":
        toml.refuse(("campaign", "model"), "is a motor, but a campaign flies a diff_drive or skid_steer")
    axes = [input_ for input_ in campaign.drawn if input_.distribution.listed]
    if campaign.design == "grid" and not axes:
        toml.refuse(("vary",), "a grid needs a list of values, as gain.heading_kp = [10, 12, 14]")
    if campaign.design not in ("monte_carlo", "grid") and not campaign.drawn:
        toml.refuse(("vary",), f"has nothing that varies, and {campaign.design} draws only that")
    if campaign.runs > MOST_RUNS:
        key = ("campaign", COUNTS[campaign.design]) if campaign.design != "grid" else ("vary",)
        toml.refuse(key, f"would be {campaign.runs} runs, more than {MOST_RUNS}")
    if campaign.profile == "paper" and campaign.compensation is not None:
        raise InputError("needs the profile coupled", file=toml.path, field="campaign.compensation")
