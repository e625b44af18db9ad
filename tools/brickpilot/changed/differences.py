"""What may differ between two recordings of one machine: differences as parts of an explanation, and their search.

A difference belongs to one of the recordings. It is either a change of a value that the machine always has, such as its
friction, its load or the delay of its link; or an effect of the library that the other recording does not show.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from brickpilot import catalogue
from brickpilot.catalogue import ParameterInfo
from brickpilot.data.dataset import Nominal
from brickpilot.data.signals import Array
from brickpilot.discover import numbers
from brickpilot.discover.deadline import Deadline
from brickpilot.discover.explanation import Explanation
from brickpilot.discover.parts import Excitation, Part, library_parts, scale_of
from brickpilot.discover.screen import Trial, screen
from brickpilot.discover.search import Width
from brickpilot.fit.parameters import Free, Plan
from brickpilot.fit.problem import Problem
from brickpilot.vehicle.combinations import loss
from brickpilot.vehicle.model import Model
from brickpilot.vehicle.replay import ADDED, RUN_KINDS, in_recording

MOST_DIFFERENCES = 3  # largest number of differences in an explanation
_NEW = 10  # number of effects of the library that are fitted, besides the values that the machine always has
_LEAST = 0.1  # least size at which a difference is tried, as a share of the usual size
_MOST = 3.0  # largest change of a value that has an `sd`, in this sd; a larger change means another machine
_SHARES = (-0.95, 20.0)  # range of a constant's relative change: the value becomes 0.05 to 21 times as large
_STARTS = (0.5, -0.5)  # start values of the change of a value that the machine always has, as shares of the usual size


@dataclass(frozen=True)
class Constant:
    """A nominal value that may change from one recording to the next.

    Attributes:
        odds: prior odds that the value changed.
        sd: sd of the usual change, as a share of the value; 0: the change may have any size.
        mechanism: the part of the machine that the change stands for, such as "bearing".
        words: the name of the value, as the subject of a sentence.
    """

    odds: float
    sd: float
    mechanism: str
    words: str


CONSTANTS = {
    "viscous_friction": Constant(numbers.COMMON, 0.0, "bearing", "braking that grows with speed"),  # grease, a brake
    "mass": Constant(numbers.USUAL, 0.0, "body", "the mass"),  # a load
    "wheel_inertia": Constant(numbers.USUAL, 0.0, "body", "the inertia that a motor turns"),  # another load
    "yaw_inertia": Constant(numbers.RARE, 0.0, "body", "the inertia against turning"),
    # Tyres wear; with other wheels, the machine would be another machine.
    "wheel_radius": Constant(numbers.RARE, numbers.RULER, "tyre", "the radius of the wheels"),
    "half_track": Constant(numbers.RARE, numbers.RULER, "tyre", "the width of the track"),
}
"""The constants of a machine that may change. A motor's windings and magnets do not change, so they are left out."""

_OWN_OF_RUNS = ("supply_gain", "delay")  # without "start": a late start of a log is no difference of the machine


@dataclass(frozen=True)
class Difference(Part):
    """One difference of one recording. `effect` is the difference's name; `free` has its keys in `Model.by_run`.

    Attributes:
        recording: the recording that differs.
        what: the name of a nominal parameter, of a value of runs ("delay"), of an effect or of "effect.parameter".
        log_odds, mechanism, contains: as for every `Part`.
        rows: key -> the parameter's row of the catalogue, but with the range of the difference.
        known: key -> the prior of the difference.
    """

    recording: str = ""
    what: str = ""
    log_odds: float = 0.0
    rows: Mapping[str, ParameterInfo] = dataclasses.field(default_factory=dict, hash=False)
    known: Mapping[str, Nominal] = dataclasses.field(default_factory=dict, hash=False)
    mechanism: str = ""
    contains: tuple[str, ...] = ()

    is_periodic = False
    made_of = ()

    @property
    def is_new(self) -> bool:
        """Whether the difference is an effect that the other recording does not have."""
        return bool(self.fixed)

    @property
    def infos(self) -> dict[str, ParameterInfo]:
        return dict(self.rows)

    def starting(self, base: Plan, values: Mapping[str, float]) -> Plan:
        effects = {name: dict(table) for name, table in base.model.effects.items()}
        by_run = {key: dict(table) for key, table in base.model.by_run.items()}
        for key, value in {**self.fixed, **{key: own for key, own in values.items() if key not in self.free}}.items():
            effect, _, parameter = key.partition(".")
            effects.setdefault(effect, {})[parameter] = value
        for key in self.free:
            by_run.setdefault(key, {})[self.recording] = values.get(key, 0.0)
        free = tuple(self._free(key) for key in self.free)
        return base.joined(dataclasses.replace(base.model, effects=effects, by_run=by_run), free)

    def _free(self, key: str) -> Free:
        info, known = self.rows[key], self.known.get(key)
        size = known.sd if known is not None and known.sd else info.trial
        natural = 0.0 if known is not None or info.role in ("limit", "switch") else info.trial
        return Free(f"{key}@{self.recording}", info, known, unit=size, natural=natural)

    def removed_from(self, model: Model) -> Model:
        by_run = {
            key: {name: value for name, value in table.items() if name != self.recording or key not in self.free}
            for key, table in model.by_run.items()
        }
        by_run = {key: table for key, table in by_run.items() if table}  # a key with a value of another recording stays
        gone = {key.partition(".")[0] for key in self.fixed} - {key.partition(".")[0] for key in by_run}
        effects = {name: table for name, table in model.effects.items() if name not in gone}
        return dataclasses.replace(model, effects=effects, by_run=by_run)

    def owns(self, free: Free) -> bool:
        return free.run == self.recording and free.name.partition("@")[0] in self.free

    def values_in(self, model: Model) -> Mapping[str, float]:
        return {key: model.by_run[key][self.recording] for key in self.free}


def own_differences(model: Model, nominal: Collection[str], recording: str) -> Iterator[Difference]:
    """Yields the possible differences in values that a machine always has: constants, values of runs, effects' sizes.

    Args:
        nominal: the nominal parameters that the vehicle's equations use.
    """

    def own(
        key: str, row: ParameterInfo, most: float, size: float, odds: float, mechanism: str, sd: float = 0.0,
        least: float | None = None,
    ) -> Difference:  # fmt: skip
        """Returns a difference in one value: its range is `least` (None: -`most`) to `most`; `size` is usual."""
        info = dataclasses.replace(
            row, name=key, minimum=-most if least is None else least, maximum=most, preset=0.0, trial=size, role="size",
            scan=(), limits="", arm_of="", optional=False,
        )  # fmt: skip
        known = {key: Nominal(0.0, sd)} if sd else {}
        name = f"{key}@{recording}"
        return Difference(name, (key,), {}, recording, key, math.log(odds), {key: info}, known, mechanism)

    for name, constant in CONSTANTS.items():
        row, odds, mechanism, sd = catalogue.parameter(name), constant.odds, constant.mechanism, constant.sd
        if name in ADDED:
            yield own(name, row, row.maximum, _brakes(model) / 3, odds, mechanism, sd)
        elif name in nominal and model.parameters.get(name, 0.0) != 0:
            if sd:
                yield own(name, row, _MOST * sd, sd, odds, mechanism, sd)
            else:
                yield own(name, row, _SHARES[1], 0.5, odds, mechanism, least=_SHARES[0])
    for kind in _OWN_OF_RUNS:
        of = RUN_KINDS[kind]
        row = dataclasses.replace(catalogue.parameter("mass"), unit=of.unit)
        yield own(kind, row, _MOST * of.sd, of.sd, numbers.USUAL, of.mechanism, of.sd)
    for effect, table in model.effects.items():
        for row in catalogue.effect(effect).parameters:
            if row.role == "size" and (table.get(row.name) or row.in_volts):
                size = max(abs(table[row.name]), _LEAST * (row.preset or row.trial) * scale_of(row.unit, model))
                mechanism = row.mechanism or catalogue.effect(effect).mechanism
                yield own(f"{effect}.{row.name}", row, row.maximum, size, numbers.COMMON, mechanism)


def no_further(model: Model, recording: str) -> Model:
    """Returns a model whose differences stay in the ranges of their parameters: a size of 0 cannot fall further.

    A larger difference has no further influence, so the data cannot determine it.
    """
    by_run = {key: dict(table) for key, table in model.by_run.items()}
    there = in_recording(model, recording, ("",))
    for key, table in by_run.items():
        effect, dot, name = key.partition(".")
        if dot and recording in table:
            table[recording] = there.effects.get(effect, {}).get(name, 0.0) - model.effects[effect][name]
        elif key in ADDED and recording in table:
            table[recording] = there.parameters[key] - model.parameters[key]
    return dataclasses.replace(model, by_run=by_run)


def _brakes(model: Model) -> float:
    """Returns a wheel's braking torque divided by its speed, in N m s/rad: D / R, with D of `vehicle.combinations`."""
    values = model.parameters
    if not values.get("resistance"):
        return loss(values)
    return loss(values) + values["torque_constant"] * values["emf_constant"] / values["resistance"]


def new_differences(model: Model, measured: Collection[str], recording: str) -> Iterator[Difference]:
    """Yields the effects of the library that the machine may have in one recording alone.

    Some effects are left out: those whose phase a fit has to find, and those that act like a value which the machine
    always has (a delay, or a nominal parameter under another name).
    """
    for part in library_parts(model, measured):
        effect = catalogue.effect(part.effect)
        if part.is_periodic or effect.acts_on == "timing" or any(row.same_as for row in effect.parameters):
            continue
        rows, off = dict[str, ParameterInfo](), dict[str, float]()
        for row in effect.parameters:
            key = f"{effect.name}.{row.name}"
            rows[key] = dataclasses.replace(row, name=key, trial=row.preset or row.trial)
            off[key] = 0.0 if row.name in part.free else part.fixed.get(row.name, row.preset)
        yield Difference(
            f"{effect.name}@{recording}", tuple(f"{effect.name}.{name}" for name in part.free), off, recording,
            effect.name, part.log_odds, rows, {}, part.mechanism,
            tuple(f"{name}@{recording}" for name in effect.contains),
        )  # fmt: skip


@dataclass
class Differences:
    """All possible differences between two recordings, as a `Source` of a search.

    Every value that the machine always has is fitted, from two starts, also if the screening does not find it: the
    screening is linear, and would miss a value that is near 0 in one recording and large in the other.

    Attributes:
        nominal: the nominal parameters that the vehicle's equations use.
        recording: the later recording, in which values that the machine always has may differ.
        new_in: the recordings that may have an effect that the other recording lacks.
        most: largest number of differences in an explanation.
    """

    nominal: Collection[str]
    recording: str
    excitation: Excitation
    new_in: Sequence[str]
    most: int

    word, width = "difference", Width(rough=40, fine=12, least=12, paired=12, swapped=0)

    def screened(self, problem: Problem, point: Array, deadline: Deadline) -> list[Trial]:
        """Returns trials of values that the machine always has, and then of the new effects that explain most."""
        base = problem.plan.at(point)

        def lacks(part: Difference) -> bool:
            return not any(part.recording in base.by_run.get(key, {}) for key in part.free)

        starts = [
            Trial(part, {key: sign * info.trial for key, info in part.rows.items()}, 0.0, math.inf)
            for part in own_differences(base, self.nominal, self.recording)
            if lacks(part)
            for sign in _STARTS
        ]
        if not self.new_in:
            return starts
        new: dict[str, Trial] = {}
        fresh = [part for name in self.new_in for part in new_differences(base, problem.data.signals, name)]
        for trial in screen(problem, point, fresh, excitation=self.excitation, deadline=deadline):
            new.setdefault(trial.part.name, trial)
        return [*starts, *list(new.values())[:_NEW]]

    def nearby(self, problem: Problem, current: Explanation, fits: Sequence[Explanation]) -> list[Trial]:
        return []
