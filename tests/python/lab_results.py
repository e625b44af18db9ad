"""Invented results of the benchmark, for tests of its tables and pages."""

from __future__ import annotations

from lab import scaling
from lab.result import truth_fields
from pages import HOSTILE

ENCODERS, IMU = "imu+encoders", "imu"


def effect(name, *others, **parameters):
    """Returns an effect of a verdict, with `others` as equivalents. A parameter is a value or (value, low, high)."""
    values = {
        key: {"value": one[0], "ci95": list(one[1:])} if isinstance(one, tuple) else {"value": one, "ci95": None}
        for key, one in parameters.items()
    }
    equivalents = [{"name": other, "worse_by": 1.0} for other in others]
    return {"name": name, "confidence": 1.0, "parameters": values, "equivalents": equivalents}


def result(hidden, verdict, *effects, sensors=ENCODERS, moved=8.0, **more):
    """Returns a result of the benchmark.

    Args:
        hidden: names of the hidden effects, or effect -> parameters.
        effects: the effects that the verdict names, made by `effect`.
        moved: how much the hidden effects change the yaw rate, in noise sd.
        more: entries that are added or replaced.
    """
    truth = hidden if isinstance(hidden, dict) else {name: {} for name in hidden}
    return {
        "name": "a-x1-enc",
        "engine": "mujoco",
        "seed": 1,
        "suite": None,
        "seed_offset": 0,
        "version": "0",
        "error": None,
        "hidden": truth,
        "sensors": sensors,
        "noise": 1.0,
        "nominal_error": 0.02,
        "size": 1.0,
        "visibility": {"yaw_rate": moved, "accel_surge": 0.1},
        "verdict": verdict,
        "effects": list(effects),
        "term": None,
        "elapsed_s": 5.0,
        "held_out": {"before": 5.0, "after": 1.0, "removed": 1.0, "floor": "stated"},
        "asked": None,
        "follow": None,
    } | more


def quick_results():
    """Returns results of the quick suites: five with a hidden law, three of them wrong, and 200 without a hidden law.

    The name of the first data set contains the HTML tag of a script.
    """
    laws = {
        "coulomb_friction": {"law": "same", "mechanisms": None, "names": ["coulomb_friction"]},
        "soft_supply": {"law": "other", "mechanisms": ["supply"], "names": ["battery_discharge"]},
    }
    return [
        _quick(f"{HOSTILE} same", "same", laws["coulomb_friction"], "named", effect("coulomb_friction"), cpu_s=4.25),
        _quick("same-b", "same", laws["coulomb_friction"], "named", effect("yaw_scrub"), cpu_s=6.5, after=3.0),
        _quick("same-c", "same", laws["coulomb_friction"], "unknown", mechanism="bearing", cpu_s=5.0, after=4.0),
        _quick("other-a", "other", laws["soft_supply"], "unknown", mechanism="supply", cpu_s=9.0),
        _quick("other-b", "other", laws["soft_supply"], "none", cpu_s=2.0, after=5.0),
        *(_quick(f"nulls-{number:03}", "nulls", None, "none", cpu_s=3.0, after=1.0) for number in range(200)),
    ]


def _quick(name, group, law, verdict, *effects, mechanism=None, cpu_s, after=1.2):
    hidden = {} if law is None else {"x": {}}
    recipe = {"hidden": hidden, "sensors": ENCODERS, "noise": 1.0, "nominal_error": 0.02, "suite": group}
    truth = {"recipe": recipe, "visibility": {"yaw_rate": 8.0}, "laws": {} if law is None else {"x": law}}
    before = 5.0 if law else 1.0
    held = {"before": before, "after": after, "removed": (before - after) / 4 if law else None, "floor": "stated"}
    run = {"engine": "planar", "seed": 7, "suite": group, "seed_offset": 0, "version": "0", "error": None}
    said = {"verdict": verdict, "effects": list(effects), "mechanism": mechanism, "held_out": held}
    return {"name": name, **run, **truth_fields(name, truth), **said, "cpu_s": cpu_s, "elapsed_s": cpu_s + 1.0}


def scaling_results() -> scaling.Scaling:
    """Returns figures of `brickpilot bench --scaling`: linear work, quadratic work, and one to three workers."""
    sizes = (10, 20, 40, 80)
    sweeps = []
    for name, power in (("linear", 1.0), ("square", 2.0)):
        rows = tuple((1e-3 * size**power, 1.02e-3 * size**power) for size in sizes)
        what = f"{name} work {HOSTILE}"
        sweeps.append(scaling.Measured(name, what, "runs", sizes, rows, 0, 1e-4))
    crowd = scaling.Crowd((1, 2, 3), 100, ((10.0, 11.0), (20.0, 19.0), (18.0, 17.5)), 2)
    return scaling.Scaling(f"a processor {HOSTILE}, 2 cores", tuple(sweeps), crowd)
