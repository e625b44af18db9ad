"""Engine "planar": drives `planar_plant` through a sequence of runs and adds texture, as in a real log.

Texture is small random vibration in the accelerations and roughness under the wheels; the seed determines both. No
model describes texture.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import butter, sosfilt

from hidden.by_run import delays
from hidden.manoeuvre import Manoeuvre
from hidden.planar_effects import install
from hidden.planar_plant import HEADING, PLAY, ROTOR, SURGE, SWAY, WHEEL, YAW, Plant
from hidden.recipe import GRAVITY, OVERSAMPLE_S, Floats, Hidden, Onset, Track, Vehicle

VIBRATION_BAND_HZ = (30.0, 80.0)
VIBRATION = 0.03  # rms m/s^2 per m/s of rim speed
YAW_VIBRATION = 0.15  # rms rad/s^2 per m/s of rim speed
ROUGHNESS = 4e-4  # rms slope under each wheel
ROUGH_WAVES_M = (0.04, 0.4)
ROUGH_CELL_M = 0.001
ROUGH_CELLS = 8192
ROUGH_ROLLS = 0.3  # wheel speed, rad/s, that halves the roughness force; at rest the force is 0, as in a hollow

STEPS_PER_SAMPLE = 2
CARRYING = frozenset({"battery_discharge", "motor_heating"})
"""The effects whose charge or heat a run leaves to the next run."""

CARRY_ERROR = 1e-5  # largest error of the charge and heat that carry over, as a share of the largest value


class Roughness:
    """Forces of small slopes of the ground under each wheel, by rolled distance; an element of `plant.loads`."""

    def __init__(self, plant: Plant, seeds: Sequence[np.random.SeedSequence], scale: float) -> None:
        length = ROUGH_CELLS * ROUGH_CELL_M
        place = 2 * np.pi * np.arange(ROUGH_CELLS) / ROUGH_CELLS
        waves = np.unique(np.round(length / np.geomspace(*ROUGH_WAVES_M, 8)))  # whole waves: the table is periodic
        phase = np.stack([np.random.default_rng(seed).uniform(0, 2 * np.pi, (2, len(waves))) for seed in seeds], axis=1)
        slopes = np.zeros((2, plant.runs, ROUGH_CELLS))
        for k, wave in enumerate(waves):
            slopes += np.sin(wave * place + phase[:, :, k, np.newaxis])
        self.force = (scale * ROUGHNESS * np.sqrt(2 / len(waves)) * 0.5 * plant.mass * GRAVITY * slopes).ravel()
        self.base = ROUGH_CELLS * np.arange(2 * plant.runs).reshape(2, plant.runs)
        self.cells = plant.radius / ROUGH_CELL_M

    def __call__(self, plant: Plant) -> None:
        cell = (self.cells * plant.angle).astype(np.int64) % ROUGH_CELLS
        speed = np.abs(plant.wheel)
        push = self.force[self.base + cell] * (speed / (speed + ROUGH_ROLLS))
        plant.force[0] += push[0] + push[1]
        plant.force[2] += plant.vehicle.half_track * (push[0] - push[1])


def simulate(
    vehicle: Vehicle,
    hidden: Hidden,
    runs: Sequence[Manoeuvre],
    seed: int,
    sample_s: float = 0.003,
    *,
    texture: float = 1.0,
) -> list[Track]:
    """Drives the runs: see `recipe.Engine`. `texture` scales vibration and roughness. Sensor effects do not act here.

    Raises:
        ValueError: this plant does not know an effect.
        KeyError: a parameter of an effect is missing.
    """
    course = _Runs(runs, seed, sample_s, texture)

    def drive(charge: Floats, heat: Floats) -> tuple[Plant, Floats]:
        plant = course.plant(vehicle, hidden, charge, heat)
        return plant, course.drive(plant)

    plant, record = _in_sequence(drive, len(runs), carries=bool(CARRYING & set(hidden)))
    return [course.track(plant, record, number) for number in range(len(runs))]


def simulate_from(
    begins: Onset, vehicle: Vehicle, hidden: Hidden, runs: Sequence[Manoeuvre], seed: int, sample_s: float = 0.003
) -> list[Track]:
    """Drives the runs as `simulate` does, but the effects act from the moment `begins`: a whole number of ms.

    In the run in which they begin, the vehicle with the effects goes on from the state of the vehicle without them.

    Raises:
        ValueError: an effect carries charge or heat over to the next run, so it cannot begin within a run.
    """
    if carrying := CARRYING & set(hidden):
        raise ValueError(f"{', '.join(sorted(carrying))}: cannot begin within a run")
    course, cold = _Runs(runs, seed, sample_s, 1.0), np.zeros((3, len(runs)))
    first, number = round(begins.at_s / OVERSAMPLE_S), begins.run
    handover = _Handover(number, first * STEPS_PER_SAMPLE)
    plants = [course.plant(vehicle, acting, cold[0], cold[1:]) for acting in ({}, hidden)]
    without, with_effects = (course.drive(plant, handover) for plant in plants)
    with_effects[:first, :, number] = without[:first, :, number]
    made = []
    for run in range(len(runs)):
        before, after = (course.track(plant, without if run < number else with_effects, run) for plant in plants)
        made.append(before if run < number else after if run > number else _spliced(before, after, first))
    return made


def _spliced(before: Track, after: Track, first: int) -> Track:
    """Returns the samples of `before` up to sample `first`, then those of `after`."""
    joined: dict[str, Any] = {
        name: np.concatenate([own[:first], getattr(after, name)[first:]])
        for name, own in vars(before).items()
        if isinstance(own, np.ndarray)
    }
    return replace(after, **joined)


class _Runs:
    """The runs, how long they last, and the seeds of their texture."""

    def __init__(self, runs: Sequence[Manoeuvre], seed: int, sample_s: float, texture: float) -> None:
        self.runs, self.sample_s, self.texture = runs, sample_s, texture
        self.samples = np.array([round(float(run.held(sample_s)[0][-1]) / OVERSAMPLE_S) for run in runs])
        self.seeds = [one.spawn(2) for one in np.random.SeedSequence(seed).spawn(len(runs))]

    def plant(self, vehicle: Vehicle, hidden: Hidden, charge: Floats, heat: Floats) -> Plant:
        """Returns the vehicle at the start of all runs, which begin with `charge` (runs,) C and `heat` (2, runs) K."""
        plant = Plant(vehicle, len(self.runs), OVERSAMPLE_S / STEPS_PER_SAMPLE)
        plant.age[:] = (np.cumsum(self.samples) - self.samples) * OVERSAMPLE_S
        install(plant, hidden)
        if self.texture > 0:
            plant.loads.append(Roughness(plant, [ground for ground, _ in self.seeds], self.texture))
        plant.assemble(charge, heat)
        return plant

    def drive(self, plant: Plant, handover: _Handover | None = None) -> Floats:
        """Drives the runs. Returns (samples, 11, runs): ten states and the supply voltage, every OVERSAMPLE_S."""
        longest = int(self.samples.max())
        command = _commands(plant, self.runs, self.sample_s, longest * STEPS_PER_SAMPLE)
        record = np.empty((longest + 1, 11, plant.runs))
        for step in range(longest * STEPS_PER_SAMPLE + 1):
            if handover is not None and step == handover.step:
                handover(plant)
            sample, within = divmod(step, STEPS_PER_SAMPLE)
            if within == 0:
                record[sample, :10], record[sample, 10] = plant.state[:10], plant.supply
                running = self.samples > sample
            if sample < longest:
                plant.advance_by(command[step], running)
        return record

    def track(self, plant: Plant, record: Floats, number: int) -> Track:
        """Returns one run of a record (samples, 11, runs) as a track."""
        own = record[: self.samples[number] + 1, :, number]
        shaken = np.random.default_rng(self.seeds[number][1])
        return _track(plant, own, self.runs[number], self.sample_s, self.texture, shaken)


class _Handover:
    """Takes the state of run `run` at step `step` from the first plant that gets there, and gives it to the second."""

    def __init__(self, run: int, step: int) -> None:
        self.run, self.step = run, step
        self.state: Floats | None = None

    def __call__(self, plant: Plant) -> None:
        own = plant.state[:, self.run]
        if self.state is None:
            self.state = own.copy()
            return
        own[: len(self.state)] = self.state
        if plant.rotor_share:  # the motor's side of the play turns with the wheel, in the middle of the play
            own[ROTOR], own[PLAY] = own[WHEEL], 0.0


def _in_sequence(
    drive: Callable[[Floats, Floats], tuple[Plant, Floats]], count: int, *, carries: bool
) -> tuple[Plant, Floats]:
    """Drives all runs together, repeatedly, until each run starts with the previous run's final charge and heat.

    The end values depend nearly linearly on the start values. So a secant through two passes predicts the next start.
    """
    start = np.zeros((3, count))
    before: tuple[Floats, Floats] | None = None
    for _ in range(count + 1):
        plant, record = drive(start[0], start[1:])
        end = np.vstack([plant.charge[np.newaxis], plant.heat])
        ahead = np.zeros_like(start)
        slope = np.ones_like(start)
        if before is not None:
            moved = start - before[0]
            np.divide(end - before[1], moved, out=slope, where=np.abs(moved) > 1e-12)
        for k in range(count - 1):
            ahead[:, k + 1] = end[:, k] + slope[:, k] * (ahead[:, k] - start[:, k])
        enough = CARRY_ERROR * np.abs(ahead).max(axis=1, keepdims=True)
        if not carries or np.all(np.abs(ahead - start) <= enough):
            break
        before, start = (start, end), ahead
    return plant, record


def _commands(plant: Plant, runs: Sequence[Manoeuvre], sample_s: float, steps: int) -> Floats:
    """Returns (steps, 2, runs): the mean voltages, V, that arrive in each step. A delay may be a fraction of a step."""
    out = np.zeros((steps, 2, plant.runs))
    clock = np.asarray(np.arange(steps + 1) * plant.step, dtype=np.float64)
    late = np.broadcast_to(plant.late_start, plant.runs)
    for k, run in enumerate(runs):
        if plant.frames:
            out[:, :, k] = _by_frames(run, sample_s, clock[:-1] + 0.5 * plant.step, k, *plant.frames)
            continue
        edges = np.maximum(clock - plant.command_delay, late[k])
        time, *sides = run.held(sample_s)
        time = np.append(time, max(time[-1], edges[-1]) + sample_s)
        for side, held in enumerate(sides):
            area = np.concatenate([[0.0], np.cumsum(held * np.diff(time))])
            out[:, side, k] = np.diff(np.interp(edges, time, area)) / plant.step
    return out


def _by_frames(run: Manoeuvre, sample_s: float, time: Floats, number: int, delay: float, jitter: float) -> Floats:
    """Returns (n, 2): the voltages that arrive at each `time` (n,) s if each frame of commands has its own delay."""
    given_at, left, right = run.held(sample_s)
    sent = time - delays(time, number, delay, jitter)
    held = np.searchsorted(given_at, sent, side="right") - 1
    return np.where(sent[:, np.newaxis] >= 0, np.column_stack([left, right])[np.maximum(held, 0)], 0.0)


def _track(
    plant: Plant, record: Floats, run: Manoeuvre, sample_s: float, texture: float, rng: np.random.Generator
) -> Track:
    """Returns the samples (n, 11) of one run as a track."""
    time = np.arange(len(record), dtype=np.float64) * OVERSAMPLE_S
    given_at, left, right = run.held(sample_s)
    held = np.searchsorted(given_at, time + 1e-9, side="right") - 1
    u, v, r, heading = record[:, SURGE], record[:, SWAY], record[:, YAW], record[:, HEADING]
    cosine, sine = np.cos(heading), np.sin(heading)
    rim = plant.vehicle.wheel_radius * 0.5 * np.abs(record[:, WHEEL]).sum(axis=1)
    shake = texture * rim[:, np.newaxis] * _vibration(len(time), rng) * (VIBRATION, VIBRATION, YAW_VIBRATION)
    x, y = _integral(u * cosine - v * sine), _integral(u * sine + v * cosine)
    slope, wave = plant.waves or (0.0, 1.0)
    fall_x = GRAVITY * (plant.downhill[0] + slope * np.sin(2 * np.pi * x / wave))
    fall_y = GRAVITY * plant.downhill[1]
    return Track(
        time=time,
        command_left=left[held],
        command_right=right[held],
        surge=u,
        sway=v,
        yaw_rate=r,
        yaw_angle=heading,
        accel_surge=_rate(u) - _mean(v * r + fall_x * cosine + fall_y * sine) + shake[:, 0],
        accel_sway=_rate(v) + _mean(u * r + fall_x * sine - fall_y * cosine) + shake[:, 1],
        yaw_accel=_rate(r) + shake[:, 2],
        wheel_speed_left=record[:, 2],
        wheel_speed_right=record[:, 3],
        current_left=record[:, 0],
        current_right=record[:, 1],
        battery=record[:, 10],
        x=x,
        y=y,
    )


def _rate(speed: Floats) -> Floats:
    """Returns the mean derivative over the interval before each sample; 0 at the first sample."""
    return np.diff(speed, prepend=speed[0]) / OVERSAMPLE_S


def _mean(value: Floats) -> Floats:
    """Returns the mean over the interval before each sample."""
    before = np.concatenate([value[:1], value[:-1]])
    return 0.5 * (before + value)


def _integral(speed: Floats) -> Floats:
    step = _mean(speed) * OVERSAMPLE_S
    step[0] = 0.0
    return np.cumsum(step)


def _vibration(count: int, rng: np.random.Generator) -> Floats:
    """Returns (count, 3): band-limited noise of rms 1 in VIBRATION_BAND_HZ, without initial transient."""
    filters = butter(2, VIBRATION_BAND_HZ, btype="bandpass", fs=1 / OVERSAMPLE_S, output="sos")
    settling = 500
    noise: Floats = np.asarray(sosfilt(filters, rng.standard_normal((settling + count, 3)), axis=0))[settling:]
    noise /= np.sqrt(np.mean(noise**2, axis=0))
    return noise
