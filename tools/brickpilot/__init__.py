"""Brickpilot: from measured runs of a small robot or a motor to a model that explains them.

What you provide is a data set: a folder with `dataset.toml` and a table of columns for each run. What you get is a
calibrated model, its gap to the measurement, and the effects that the model lacks.

    import brickpilot
    import numpy as np

    dataset = brickpilot.read("bench")                  # every value in SI, damaged samples left out
    for fault in dataset.faults:
        print(f"{fault.run}: {fault.signal} is {fault.kind} from {fault.from_s} s to {fault.to_s} s")

    fitted = brickpilot.calibrate(dataset)              # the parameters that [nominal] does not give
    for name, estimate in fitted.parameters.items():
        print(name, estimate.value, estimate.unit, estimate.ci95 if estimate.identifiable else "not identifiable")

    comparison = brickpilot.compare(dataset, fitted.model)      # free runs: simulated from the inputs alone
    print("rms error of the speed:", comparison.share("held_out", "speed"))

    finding = brickpilot.discover_effects(dataset)      # what the simulator lacks
    print(finding.verdict, [effect.name for effect in finding.effects])
    brickpilot.save_model(finding.augmented, "model.toml")

    model = brickpilot.load_model("model.toml")         # simulate what was never measured
    time = np.arange(0.0, 2.0, 0.01)
    run = brickpilot.OpenLoopRun(time, inputs=np.full((200, 1), 4.5))
    (simulated,) = brickpilot.simulate([(model, run)])
    print("speed at the end:", simulated.outputs["speed"][-1], "rad/s")

The names below are the public face; each is loaded when it is first used, so that `import brickpilot` takes no time.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_NAMES = {
    "Dataset": "brickpilot.data.dataset:Dataset",
    "read": "brickpilot.data.dataset:read",
    "Model": "brickpilot.vehicle.model:Model",
    "load_model": "brickpilot.vehicle.model:load",
    "save_model": "brickpilot.vehicle.model:save",
    "rcx": "brickpilot.vehicle.model:rcx",
    "OpenLoopRun": "brickpilot.vehicle.plant:OpenLoopRun",
    "simulate": "brickpilot.vehicle.plant:simulate",
    "effects": "brickpilot.catalogue:effects",
    "compare": "brickpilot.fit.compare:compare",
    "calibrate": "brickpilot.fit.calibrate:calibrate",
    "discover_effects": "brickpilot.discover.pipeline:discover",
    "InputError": "brickpilot.errors:InputError",
    "SimulationError": "brickpilot.errors:SimulationError",
}

__all__ = ["__version__", *_NAMES]


def __getattr__(name: str) -> Any:
    if name not in _NAMES:
        raise AttributeError(f"module 'brickpilot' has no attribute {name!r}")
    module, _, attribute = _NAMES[name].partition(":")
    found = getattr(importlib.import_module(module), attribute)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_NAMES})
