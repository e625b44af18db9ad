"""`brickpilot check`: what a data set is worth before a discovery: its timing, noise and faults, and what it can show.

The check needs one fit of the nominal model, to some of the runs if there are many. For a parameter, the check gives
the interval of this fit. For an effect, it gives the smallest size that would be named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from threadpoolctl import threadpool_limits

from brickpilot.data import facts
from brickpilot.data.audit.fault import Fault
from brickpilot.data.dataset import Dataset, OwnUnit, motor_inputs, own_units
from brickpilot.data.holdout import enough_to_fit
from brickpilot.data.shown import Result, valid
from brickpilot.discover.deadline import estimate
from brickpilot.discover.evidence import Judge
from brickpilot.discover.experiment import smallest_sizes
from brickpilot.discover.finding import Visible
from brickpilot.discover.prepare import calibrate, in_closed_loop, prepare
from brickpilot.discover.row_meaning import with_known_timing
from brickpilot.fit.uncertainty import Combination, Estimate, assess, estimates_frame
from brickpilot.readiness.advice import Advice, advise
from brickpilot.vehicle.compared_runs import comparable
from brickpilot.vehicle.headline import Headline, headline

if TYPE_CHECKING:
    import pandas

_OF_SOME = "Intervals, the sizes of effects that show and the advice are those of these runs."


@dataclass(frozen=True)
class Check(Result):
    """What a data set is worth.

    Attributes:
        faults: damaged samples, which every fit leaves out.
        explained: how much of each signal the model with these parameters explains.
        units: signal -> how the data set states it.
        parameters: nominal parameters that are fitted, with 95 % intervals.
        cannot_tell_apart: groups of parameters of which only combinations are identifiable; `combinations` has the
            physical ones.
        visible: effect -> the smallest size that would be named.
        invisible: effects that would show at no size within their range.
        advice: manoeuvres that would tell more, the best first.
        discover_s: how long `discover` will take, s: the geometric middle of the range.
        discover_range_s: the least and the longest time, s, depending on the error that is left to explain.
        notes: sentences on what was assumed or left out.
    """

    dataset: str
    vehicle: str
    frame: str
    runs: tuple[facts.RunFacts, ...]
    signals: tuple[facts.SignalFacts, ...]
    faults: tuple[Fault, ...]
    explained: Headline
    units: Mapping[str, OwnUnit]
    parameters: Mapping[str, Estimate]
    cannot_tell_apart: tuple[tuple[str, ...], ...]
    combinations: tuple[Combination, ...]
    visible: Mapping[str, Visible]
    invisible: tuple[str, ...]
    advice: tuple[Advice, ...]
    discover_s: float
    discover_range_s: tuple[float, float]
    notes: tuple[str, ...]

    def to_frame(self, table: Literal["parameters", "signals", "effects"] = "parameters") -> pandas.DataFrame:
        """Returns a table, in SI.

        Args:
            table: "parameters": the fitted nominal values with the ends of their 95 % intervals, NaN where there is
                none. "signals": facts of each signal. "effects": the smallest size of each effect that would be named.
        """
        import pandas

        if table == "signals":
            return pandas.DataFrame([vars(one) for one in self.signals])
        if table == "effects":
            sizes = [(name, one.parameter, one.size, one.unit) for name, one in self.visible.items()]
            return pandas.DataFrame(sizes, columns=["effect", "parameter", "size", "unit"])
        return estimates_frame(self.parameters)

    def to_json(self) -> dict[str, Any]:
        """Returns the object that `check --json` prints. A number that is not finite becomes None."""
        kept = {name: value for name, value in vars(self).items() if name not in ("explained", "units")}
        made: dict[str, Any] = valid(kept | {"headline": self.explained})
        return made


def check(dataset: Dataset, *, seed: int = 0, jobs: int = 2) -> Check:
    """Returns what `dataset` is worth.

    Args:
        seed: the seed of the nominal fit's random starts, which are used if nominal values are not given.
        jobs: number of simulations at the same time.

    Raises:
        InputError: no measured signal is one that the model gives, every run is held out, or the plant diverges with
            the nominal values.

    A motor that was only driven forward:

    >>> import brickpilot as bp, numpy as np, pandas as pd
    >>> time = np.arange(0.0, 2.0, 0.01)
    >>> speed = 15 * (1 - np.exp(-np.maximum(time - 0.2, 0) / 0.15)) + np.random.default_rng(1).normal(0, 0.1, 200)
    >>> forward = pd.DataFrame({"time": time, "voltage": np.where(time >= 0.195, 5.0, 0.0), "speed": speed})
    >>> dataset = bp.Dataset.from_frames({"forward": forward}, vehicle="motor", nominal={"resistance": 20.0})
    >>> worth = bp.check(dataset)
    >>> worth.to_frame("signals")[["name", "unit", "noise_sd", "colour"]].round(1)
        name   unit  noise_sd colour
    0  speed  rad/s       0.1  white
    >>> bool(worth.to_frame()["identifiable"].any())        # one step does not tell two parameters apart
    False
    >>> worth.advice[0].manoeuvre.name                      # but this would
    'forward and back at a third of the power'
    """
    with threadpool_limits(1, "blas"):  # as in `pipeline.discover`
        known = with_known_timing(dataset, None, seed=seed, jobs=jobs)
        some, note = enough_to_fit(known)
        whole = comparable(known)
        prepared, nominal = calibrate(prepare(some, None, seed=seed, jobs=jobs)[0])
        prepared, nominal = in_closed_loop(prepared, nominal, nominal)
        samples, of = (sum(len(run.time) for run in one.runs) for one in (some, known))
        seconds = estimate(prepared, nominal, times=of / samples)
        judge = Judge.of(prepared.coarse, seed)
        nothing = judge.of_explanation(nominal)
        temperature = judge.temperature(nothing, nothing)
        visible = smallest_sizes(prepared, judge, nominal, nominal)
        told = assess(prepared.fine, nominal.model, nominal.plan.uncertain)
        advice, invisible = advise(prepared, nominal, visible, temperature)
        explained = headline(whole, nominal.model, threads=jobs)
    return Check(
        dataset=dataset.name,
        vehicle=dataset.vehicle,
        frame=dataset.frame,
        runs=tuple(
            facts.of_run(one, whole.roles.by_run[one.name], motor_inputs(one, whole.measured)) for one in dataset.runs
        ),
        signals=facts.of_signals(dataset),
        faults=whole.measured.faults,
        explained=explained,
        units=own_units(dataset, explained.signals),
        parameters=told.estimates,
        cannot_tell_apart=told.groups,
        combinations=told.combinations,
        visible=visible,
        invisible=invisible,
        advice=advice,
        discover_s=seconds.middle,
        discover_range_s=(seconds.low, seconds.high),
        notes=(
            whole.roles.note,
            *([] if prepared.loop is None else [f"{prepared.loop.sentence}."]),
            *([] if note is None else [f"{note} {_OF_SOME}"]),
            *prepared.plan.notes,
            *whole.measured.notes,
            *prepared.fine.notes,
        ),
    )
