"""Logs of two robots with planted wiring faults, simulated by engines other than the plant; also a program.

PYTHONPATH=tests:tests/python python -m miswired_logs [LOGS]  # prints a table: fault, robots, logs judged right
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np
import pandas
from brickpilot.data.audit.view import Channels
from brickpilot.data.audit.wiring import mended, miswired
from brickpilot.data.audit.wiring_motion import SURE, Miswired
from brickpilot.data.dataset import Dataset
from hidden import measure
from hidden.manoeuvre import catalogue, varied
from hidden.recipe import Recipe, Vehicle
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Log = dict[str, Vector]
"""Signal -> values of one run, in SI and the paper's frame; the time is one of the signals."""

COUNTS = 960  # encoder counts per turn
FULL_V = 9.0  # V at full duty
ROBOTS = {
    "mujoco": Vehicle(),
    "planar": Vehicle(mass=2.4, yaw_inertia=0.02, half_track=0.11, wheel_radius=0.035, wheel_inertia=2e-3,
                      resistance=4.0, inductance=2e-3, torque_constant=0.3, emf_constant=0.3),
}  # fmt: skip
DRIVES = ("forward_half", "spin_right", "curve_left", "left_alone", "ramp_through_zero", "square_waves")


def nominal(robot: str) -> dict[str, float]:
    """Returns the robot's values that the experimenter measured, SI."""
    return {
        "wheel_radius": ROBOTS[robot].wheel_radius,
        "half_track": ROBOTS[robot].half_track,
        "battery_voltage": FULL_V,
    }


def logs(robot: str, seed: int, hidden: Mapping[str, Mapping[str, float]] | None = None) -> list[Log]:
    """Returns four runs of a robot: duty, encoder counts as angles, and a gyro."""
    random = np.random.default_rng(seed)
    every = catalogue(0.5)
    chosen = ["curve_left", *random.choice([name for name in DRIVES if name != "curve_left"], 3, replace=False)]
    runs = varied([every[name] for name in chosen], random)
    recipe = Recipe(name="wired", engine=robot, vehicle=ROBOTS[robot], runs=runs, hidden=hidden or {}, seed=seed)
    found: list[Log] = []
    for run, track, sensed in zip(
        runs, measure.tracks(recipe), measure.sense(measure.tracks(recipe), recipe), strict=True
    ):
        _, left, right = run.held(recipe.sample_s)
        keep = slice(None, None, 3)  # a row about every 9 ms
        every_step = max(1, round(recipe.sample_s / track.oversample_s))
        log: Log = {
            "time": track.time[::every_step][keep],
            "duty_left": left[keep] / FULL_V,
            "duty_right": right[keep] / FULL_V,
        }
        for side in ("left", "right"):
            angle = np.cumsum(sensed[f"wheel_speed_{side}"]) * recipe.sample_s
            log[f"wheel_angle_{side}"] = np.floor(angle[keep] / (2 * np.pi) * COUNTS) / COUNTS * 2 * np.pi
        gyro = sensed["yaw_rate"]
        log["yaw_rate"] = (gyro + random.normal(0.0, 0.014, gyro.size))[keep]
        found.append(log)
    return found


def _scaled(*names: str, by: float = -1.0) -> Callable[[Log], Log]:
    return lambda log: log | {name: by * log[name] for name in names}


def _swapped(stem: str) -> Callable[[Log], Log]:
    left, right = f"{stem}_left", f"{stem}_right"
    return lambda log: log | {left: log[right], right: log[left]}


def _stuck(*names: str) -> Callable[[Log], Log]:
    return lambda log: log | {name: np.full_like(log[name], log[name][0]) for name in names}


def _as_voltage(log: Log) -> Log:
    kept = {name: values for name, values in log.items() if not name.startswith("duty")}
    return kept | {f"voltage_{side}": np.round(255 * log[f"duty_{side}"]) for side in ("left", "right")}


FAULTS: dict[str, Callable[[Log], Log]] = {
    "encoders swapped": _swapped("wheel_angle"),
    "motors swapped": _swapped("duty"),
    "left encoder reversed": _scaled("wheel_angle_left"),
    "right encoder reversed": _scaled("wheel_angle_right"),
    "both encoders reversed": _scaled("wheel_angle_left", "wheel_angle_right"),
    "left motor reversed": _scaled("duty_left"),
    "right motor reversed": _scaled("duty_right"),
    "both motors reversed": _scaled("duty_left", "duty_right"),
    "gyro reversed": _scaled("yaw_rate"),
    "left encoder dead": _stuck("wheel_angle_left"),
    "right encoder dead": _stuck("wheel_angle_right"),
    "both encoders dead": _stuck("wheel_angle_left", "wheel_angle_right"),
    "gyro in degrees": _scaled("yaw_rate", by=180 / np.pi),
    "gyro in rpm": _scaled("yaw_rate", by=30 / np.pi),
    "1440 counts taken as 960": _scaled("wheel_angle_left", "wheel_angle_right", by=1.5),
    "wheel radius half of it": _scaled("wheel_angle_left", "wheel_angle_right", by=0.5),
    "left counts of another encoder": _scaled("wheel_angle_left", by=1.5),
    "time in ms": _scaled("time", by=1e3),
    "time in us": _scaled("time", by=1e6),
    "PWM taken as volts": _as_voltage,
    "left PWM of another scale": _scaled("duty_left", by=0.25),
}
"""Fault -> function that puts the fault into one run."""

WORDS = {
    "encoders swapped": "encoder are swapped", "left encoder dead": "left encoder stands still",
    "right encoder dead": "right encoder stands still", "both encoders dead": "both encoders stand still",
    "gyro in degrees": "is 57.3 times",
    "gyro in rpm": "is 9.55 times",
    "1440 counts taken as 960": "as far as yaw_rate says", "wheel radius half of it": "as far as yaw_rate says",
    "left counts of another encoder": "times as far as wheel_angle",
    "time in ms": "1000 times too long", "time in us": "1e+06 times too long", "PWM taken as volts": "PWM of 255",
    "left PWM of another scale": "full drive",
}  # fmt: skip
"""Fault -> words that its sentence contains, for faults that are named; some of these faults are also corrected."""


def channels(log: Log) -> Channels:
    inputs = {name: values for name, values in log.items() if name.startswith(("duty", "voltage"))}
    return Channels(log["time"], inputs, {n: v for n, v in log.items() if n not in inputs and n != "time"})


def dataset(runs: Sequence[Log], robot: str) -> Dataset:
    """Returns the logs of a robot as a data set, with the values that the experimenter measured."""
    frames = {f"run_{number}": pandas.DataFrame(log) for number, log in enumerate(runs)}
    return Dataset.from_frames(frames, vehicle="diff_drive", frame="FRD", nominal=nominal(robot))


def _mirrored(log: Log) -> Iterator[Log]:
    """Yields a log and three logs that no check can tell from the first: driven backwards, mirrored, and both."""
    sides = [name for name in log if name.endswith(("_left", "_right"))]
    turned = _swapped("duty")(_swapped("wheel_angle")(_scaled("yaw_rate")(log)))
    for one in (log, turned):
        yield one
        yield _scaled(*sides, "yaw_rate")(one)


def is_right(truth: Sequence[Log], found: Sequence[Miswired], faults: Sequence[str], spoilt: Sequence[Log]) -> bool:
    """Returns whether each fault is named, or the log is corrected, with enough certainty."""
    said = " ".join(one.text for one in found)
    worded = [fault for fault in faults if fault in WORDS and fault != "encoders swapped"]
    if not all(WORDS[fault] in said for fault in worded):
        return False
    if len(worded) == len(faults):
        return all(one.sure > 0.9 for one in found)
    if any(one.sure < SURE for one in found):
        return False
    now = [mended(channels(log), found) for log in spoilt]
    signs = [{**one.inputs, **one.outputs} for one in now]
    return any(
        all(_same(log, one) for log, one in zip(wanted, signs, strict=True))
        for wanted in zip(*(list(_mirrored(log)) for log in truth), strict=True)
    )


def _same(wanted: Log, found: Mapping[str, Vector]) -> bool:
    """Returns whether all channels are equal up to a positive factor. Constant channels are not compared."""
    for name, values in found.items():
        other = wanted.get(name, wanted.get(name.replace("voltage", "duty")))
        if other is None or not np.any(other) or np.ptp(values) == 0.0:
            continue
        if float(values @ other) < 0.99 * np.linalg.norm(values) * np.linalg.norm(other):
            return False
    return True


def spoil(runs: Sequence[Log], faults: Sequence[str]) -> list[Log]:
    for fault in faults:
        runs = [FAULTS[fault](log) for log in runs]
    return list(runs)


def pairs() -> list[tuple[str, str]]:
    """Returns the pairs of faults that one log can show.

    Two scales of one channel are left out, and what a dead encoder hides: other faults of encoders, the gyro's unit.
    """
    scales = [{"gyro in degrees", "gyro in rpm"}, {"time in ms", "time in us"},
              {"1440 counts taken as 960", "wheel radius half of it"}]  # fmt: skip
    scales.append({"PWM taken as volts", "left PWM of another scale"})
    hidden = {
        "left encoder dead": {"right encoder dead", "both encoders dead", "left encoder reversed"},
        "right encoder dead": {"both encoders dead", "right encoder reversed"},
        "both encoders dead": {f"{side} encoder reversed" for side in ("left", "right")}
        | {"both encoders reversed", "encoders swapped", "both motors reversed", "motors swapped"},
    }
    unseen = {*scales[0], *scales[2], "left counts of another encoder"}
    return [
        (one, other) for one, other in combinations(FAULTS, 2)
        if not any({one, other} <= same for same in scales)
        and not any(
            dead in (one, other) and ({one, other} - {dead}) & (some | unseen)
            for dead, some in hidden.items()
        )
    ]  # fmt: skip


def main(count: int) -> None:
    """Prints the table."""
    truths = {(robot, seed): logs(robot, seed) for robot in ROBOTS for seed in range(count)}
    hits: dict[str, list[bool]] = {}
    for (robot, _), truth in truths.items():
        said = miswired([channels(log) for log in truth], nominal(robot))
        hits.setdefault("none", []).append(not said)
        for faults in [(one,) for one in FAULTS] + pairs():
            spoilt = spoil(truth, faults)
            found = miswired([channels(log) for log in spoilt], nominal(robot))
            name = faults[0] if len(faults) == 1 else f"{len(pairs())} pairs"
            hits.setdefault(name, []).append(is_right(truth, found, faults, spoilt))
    for name, each in hits.items():
        print(f"| {name} | {len(ROBOTS)} | {sum(each)} of {len(each)} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 4)
