"""Results of the blind test made by hand: what was hidden, and what the verdict said."""

from __future__ import annotations

ENCODERS, IMU = "imu+encoders", "imu"


def effect(name, *others, **parameters):
    """Returns one effect of a verdict. A parameter is its value, or (value, low, high)."""
    values = {
        key: {"value": one[0], "ci95": list(one[1:])} if isinstance(one, tuple) else {"value": one, "ci95": None}
        for key, one in parameters.items()
    }
    equivalents = [{"name": other, "worse_by": 1.0} for other in others]
    return {"name": name, "confidence": 1.0, "parameters": values, "equivalents": equivalents}


def result(hidden, verdict, *effects, sensors=ENCODERS, moved=8.0, **more):
    """Returns a result of the benchmark. `hidden`: names, or effect -> parameters."""
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
        "peer": None,
    } | more
