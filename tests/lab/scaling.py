"""How time grows with the amount of work (runs, samples, candidates), and what more workers gain.

Times of one process are processor times, because other programs on the machine hardly change processor times. The fixed
cost of a call, such as loading and checking, is measured at a very small size. This cost is subtracted from each time,
and the small size from each size, so the exponent describes only the growing part. The time of a campaign's flights is
the processor time of its worker and of this process. The gain by more workers is measured in wall time, from the first
result to the last.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from brickpilot import catalogue
from brickpilot.bench import speed
from brickpilot.campaign import runs, workers
from brickpilot.campaign.run_parts import Part, PartProgress, run_parts
from brickpilot.data.reading import Dataset
from brickpilot.discover import parts, pipeline, prepare
from brickpilot.discover.screen import screen
from brickpilot.fit.calibration import calibrate
from brickpilot.fit.comparison import compare
from brickpilot.fit.problem import Problem
from brickpilot.vehicle import flight, plant, scenario
from brickpilot.vehicle.model import Model, rcx
from scipy import stats
from threadpoolctl import threadpool_limits

Progress = Callable[[int, int, str], None]
Work = Callable[[int], Callable[[], object]]
"""Size -> a function that does the work of this size; the time to create the function does not count."""

_PERIOD_S = 0.01
_RUNS = 4
_FLIGHT_S = 20.0
_NOISE = {"yaw_rate": 0.02, "wheel_speed_left": 0.1, "wheel_speed_right": 0.1}
_KNOWN = (
    "mass", "yaw_inertia", "half_track", "wheel_radius", "wheel_inertia", "resistance", "emf_constant",
    "torque_constant", "viscous_friction", "rolling_friction",
)  # fmt: skip


@dataclass(frozen=True)
class Sweep:
    """Work of growing size.

    Attributes:
        name: the name under which its figures are stored.
        what: the work in words.
        unit: the unit of a size.
        sizes: three or more sizes.
        work: size -> the work.
        least: a very small size, subtracted from each size; its time is subtracted from each time. 0: no subtraction.
        repeats: repeats of each size.
    """

    name: str
    what: str
    unit: str
    sizes: Sequence[int]
    work: Work
    least: int = 1
    repeats: int = 3


@dataclass(frozen=True)
class Measured:
    """The processor times of a sweep, s: ``seconds`` (sizes, repeats), from which ``fixed_s`` is already subtracted."""

    name: str
    what: str
    unit: str
    sizes: tuple[int, ...]
    seconds: tuple[tuple[float, ...], ...]
    least: int
    fixed_s: float

    @property
    def law(self) -> PowerLaw:
        """The power law of `seconds` as a function of the size minus `least`."""
        return fit([size - self.least for size in self.sizes], self.seconds)

    @property
    def times_work(self) -> float:
        """Ratio of the largest to the smallest amount of work, each minus `least`."""
        return (self.sizes[-1] - self.least) / (self.sizes[0] - self.least)

    @property
    def times_as_long(self) -> float:
        """Ratio of the time of the largest amount of work to the time of the smallest."""
        return min(self.seconds[-1]) / min(self.seconds[0])


@dataclass(frozen=True)
class Crowd:
    """Flights per second of a campaign, (repeats,) for each number of workers."""

    workers: tuple[int, ...]
    flights: int
    flights_per_s: tuple[tuple[float, ...], ...]
    cores: int

    @property
    def gains(self) -> list[float]:
        """Ratio of the flights per second to those with one worker, for each number of workers."""
        best = [max(rates) for rates in self.flights_per_s]
        return [rate / best[0] for rate in best]


@dataclass(frozen=True)
class Scaling:
    """All results of `brickpilot bench --scaling`, and the machine."""

    machine: str
    sweeps: tuple[Measured, ...]
    crowd: Crowd


def recording(samples: int) -> Dataset:
    """Returns a data set of `samples` samples: four runs of a robot with one bearing effect, from a fixed seed."""
    random = np.random.default_rng(0)
    bearings = (one for one in catalogue.effects() if one.mechanism == "bearing" and not one.variant_of)
    hidden = min(bearings, key=lambda one: len(one.parameters))
    values = {one.name: one.preset for one in hidden.parameters}
    truth = Model("truth", "diff_drive", "coupled", rcx().parameters, {hidden.name: values})
    frames = {}
    for run in range(_RUNS):
        count = max(samples // _RUNS, 10)
        time_s = np.arange(count, dtype=np.float64) * _PERIOD_S
        volts = np.repeat(random.uniform(-6, 6, (count // 60 + 1, 2)), 60, axis=0)[:count]
        [simulated] = plant.simulate([(truth, plant.OpenLoopRun(time_s, volts))])
        signals = {name: simulated.outputs[name] + random.normal(0, sd, count) for name, sd in _NOISE.items()}
        columns = {"time": time_s, "voltage_left": volts[:, 0], "voltage_right": volts[:, 1], **signals}
        frames[f"run {run}"] = pd.DataFrame(columns)
    known = {name: rcx().parameters[name] for name in _KNOWN}
    return Dataset.from_frames(frames, vehicle="diff_drive", nominal=known)


def sweeps() -> list[Sweep]:
    """Returns the sweeps that are measured; together they take two minutes of processor time."""
    thousand = 1000
    return [
        Sweep(
            "simulate_runs",
            "free runs of 2 s, simulated in one call",
            "runs",
            (256, 512, 1024, 2048, 4096),
            _simulation,
        ),
        Sweep(
            "compare_samples",
            "compare: every run replayed and held against its samples",
            "samples",
            tuple(k * thousand for k in (64, 96, 144, 216, 324, 486)),
            _on_recording(lambda data: compare(data, rcx())),
            least=100,
        ),
        Sweep(
            "calibrate_samples",
            "calibrate: the fit of the nominal parameters",
            "samples",
            tuple(k * thousand for k in (64, 96, 144, 216, 324, 486)),
            _on_recording(calibrate),
            least=100,
        ),
        Sweep(
            "discover_samples",
            "discover: one round of screening all effects",
            "samples",
            tuple(k * thousand for k in (4, 8, 16, 32)),
            _screening,
            least=400,
            repeats=2,
        ),
        Sweep(
            "discover_candidates",
            "discover: one round of screening, of the library's candidates several times over",
            "candidates",
            (57, 114, 228, 456),
            _candidates,
            repeats=2,
        ),
        Sweep(
            "discover_whole_samples",
            "discover: from the data to the verdict",
            "samples",
            tuple(k * thousand for k in (1, 2, 4, 8, 16)),
            _on_recording(lambda data: pipeline.discover(data, jobs=1)),
            least=0,
            repeats=1,
        ),
    ]


def measure(
    progress: Progress,
    chosen: Sequence[Sweep] | None = None,
    flights_of: Sequence[int] = (64, 128, 256, 512, 1024),
    crowd_flights: int = 600,
    repeats: int = 2,
) -> Scaling:
    """Measures all sweeps, a campaign's flights, and the gain by workers, for 1 worker to 1 more than cores.

    Args:
        progress: called with (done, total, text).
        chosen: the sweeps; None: `sweeps`.
        flights_of: numbers of flights of the campaign with one worker.
        crowd_flights: number of flights for each number of workers.
        repeats: repeats of each number of flights.
    """
    chosen = sweeps() if chosen is None else chosen
    total, found = len(chosen) + 2, []
    with threadpool_limits(1, "blas"):
        for done, sweep in enumerate(chosen):
            progress(done, total, sweep.what)
            found.append(_measure(sweep))
    progress(total - 2, total, "flights of a campaign")
    found.insert(1, _campaign(flights_of, repeats))
    progress(total - 1, total, "workers of a campaign")
    return Scaling(speed.this_machine(), tuple(found), _crowd(crowd_flights, repeats))


def _measure(sweep: Sweep) -> Measured:
    fixed = min(_processor_times(sweep.work(sweep.least), 3)) if sweep.least else 0.0
    rows = []
    for size in sweep.sizes:
        work = sweep.work(size)
        rows.append(tuple(max(one - fixed, 1e-9) for one in _processor_times(work, sweep.repeats)))
    return Measured(sweep.name, sweep.what, sweep.unit, tuple(sweep.sizes), tuple(rows), sweep.least, fixed)


def _processor_times(work: Callable[[], object], repeats: int) -> list[float]:
    found = []
    for _ in range(repeats):
        began = time.process_time()
        work()
        found.append(time.process_time() - began)
    return found


def _simulation(size: int) -> Callable[[], object]:
    time_s, model = np.arange(200, dtype=np.float64) * _PERIOD_S, rcx()
    volts = np.tile([5.0, 3.0], (200, 1))
    jobs = [(model, plant.OpenLoopRun(time_s, volts)) for _ in range(size)]
    return lambda: plant.simulate(jobs, signals=("yaw_rate",))


def _on_recording(function: Callable[[Dataset], object]) -> Work:
    def work(samples: int) -> Callable[[], object]:
        data = recording(samples)
        return lambda: function(data)

    return work


def _screening(samples: int, times: int | None = None) -> Callable[[], object]:
    """Returns a function that screens all effects, or `times` candidates: effects repeat until there are so many."""
    prepared, _ = prepare.prepare(recording(samples), None, seed=0, jobs=1)
    prepared, nominal = prepare.calibrate(prepared)
    here = Problem(prepared.coarse, nominal.plan).keeping(nominal.point, len(nominal.point))
    every = parts.library_parts(nominal.model, here.data.signals)
    many = every if times is None else [every[k % len(every)] for k in range(times)]
    return lambda: screen(here, nominal.point, many, excitation=prepared.excitation)


def _candidates(count: int) -> Callable[[], object]:
    return _screening(4000, count)


def _plans(count: int) -> Iterator[Part]:
    mission = dataclasses.replace(scenario.load(scenario.packaged()["mission"]), duration=_FLIGHT_S)
    for seed in range(count):
        plan = flight.plan(mission, rcx(), profile="coupled", sensors="imu+encoders", seed=seed)
        yield Part(f"{seed:06}", plan)


def flown_by(plan: flight.Plan) -> float:
    """Flies a plan, and returns the processor time that this worker has used since its start, s."""
    runs.row(plan)
    return time.process_time()


@dataclass(frozen=True)
class _Flown:
    """The time of a campaign's flights after the first one, s."""

    wall_s: float
    processor_s: float


def _fly(count: int, jobs: int) -> _Flown:
    """Flies `count` flights after the first one. The processor time is correct only with one worker."""
    moments: list[tuple[float, float]] = []

    def keep(_: Part, worker_s: float) -> None:
        moments.append((time.perf_counter(), worker_s + time.process_time()))

    run_parts(
        flown_by,
        _plans(count + 1),
        keep=keep,
        workers=workers.Local(jobs),
        progress=PartProgress(lambda *_: None, total=count + 1),
    )
    return _Flown(moments[-1][0] - moments[0][0], moments[-1][1] - moments[0][1])


def _campaign(sizes: Sequence[int], repeats: int) -> Measured:
    rows = [tuple(_fly(size, 1).processor_s for _ in range(repeats)) for size in sizes]
    what = f"campaign: flights of {_FLIGHT_S:.0f} s, one worker"
    return Measured("campaign_flights", what, "flights", tuple(sizes), tuple(rows), 0, 0.0)


def _crowd(count: int, repeats: int) -> Crowd:
    numbers = tuple(range(1, speed.cores() + 2))
    rates = [tuple(count / _fly(count, jobs).wall_s for _ in range(repeats)) for jobs in numbers]
    return Crowd(numbers, count, tuple(rates), speed.cores())


def as_dict(found: Scaling) -> dict[str, Any]:
    """Returns all results for JSON, the exponents with their 95 % intervals first."""
    return {
        "machine": found.machine,
        "sweeps": {
            one.name: {
                "what": one.what,
                "unit": one.unit,
                "exponent": {"value": one.law.exponent, "ci95": [one.law.low, one.law.high]},
                "growth": one.law.verdict,
                "times_work": one.times_work,
                "times_as_long": one.times_as_long,
                "sizes": list(one.sizes),
                "seconds": [list(row) for row in one.seconds],
                "least": one.least,
                "fixed_s": one.fixed_s,
            }
            for one in found.sweeps
        },
        "workers": {
            "cores": found.crowd.cores,
            "flights": found.crowd.flights,
            "numbers": list(found.crowd.workers),
            "gain": found.crowd.gains,
            "flights_per_s": [list(row) for row in found.crowd.flights_per_s],
        },
    }


LINEAR = 0.1
"""Growth is called linear if the exponent's 95 % interval lies within 1 +- `LINEAR`, or if `NARROW` applies."""

NARROW = 0.3
"""Growth is also linear if the interval contains 1 and lies within 1 +- `NARROW`: it excludes a root and a square."""


@dataclass(frozen=True)
class PowerLaw:
    """seconds = ``seconds_of_one`` * size ** ``exponent``, with the exponent's 95 % interval."""

    exponent: float
    low: float
    high: float
    seconds_of_one: float

    @property
    def verdict(self) -> str:
        """The growth in words: "linear", "less than linear", "more than linear", or "not determined"."""
        away = max(1 - self.low, self.high - 1)
        if away <= LINEAR or (self.low <= 1 <= self.high and away <= NARROW):
            return "linear"
        if self.high < 1:
            return "less than linear"
        return "more than linear" if self.low > 1 else "not determined"


def fit(sizes: Sequence[float], seconds: Sequence[Sequence[float]]) -> PowerLaw:
    """Fits a power law to the smallest time of each size.

    Other programs disturb the smallest time least. The interval comes from the scatter of the points about the line
    (Student's t). So the interval includes errors that repeats of one size do not show.

    Args:
        sizes: three or more sizes above 0.
        seconds: the times of each size, above 0.
    """
    x, y = np.log(sizes), np.log([min(times) for times in seconds])
    line = stats.linregress(x, y)
    half = float(stats.t.ppf(0.975, len(sizes) - 2) * line.stderr)
    slope = float(line.slope)
    return PowerLaw(slope, slope - half, slope + half, float(np.exp(line.intercept)))
