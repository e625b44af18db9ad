"""Which measured signals are compared with the model, and so enter the cost of a fit."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

import numpy as np

from brickpilot import catalogue
from brickpilot.data.dataset import Dataset
from brickpilot.errors import InputError
from brickpilot.vehicle.model import Model, output_names

_LARGEST = 1e30  # SI: far above anything measured, far below where squares overflow


@dataclass(frozen=True)
class ComparedSignals:
    """The measured signals that the model gives, and a note on those it does not give."""

    names: tuple[str, ...]
    notes: tuple[str, ...]


def is_compared(signal: str, outputs: Container[str], model: Model) -> bool:
    """Whether a measured signal is compared with the model, which gives `outputs`.

    The battery's voltage is an input of the model, unless an effect of the model loads the battery.
    """
    if signal != "battery_voltage":
        return signal in outputs
    return any(effect.acts_on == "supply" for effect in catalogue.effects_of(model.effects))


def compared_signals(dataset: Dataset, model: Model) -> ComparedSignals:
    """Finds the measured signals that the model gives.

    Raises:
        InputError: there is none, or all its samples are blank, or one is too large to be a measurement.
    """
    given = output_names(model)
    measured = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    names = tuple(name for name in measured if is_compared(name, given, model))
    largest = -1.0
    for run in dataset.runs:
        for name in names:
            known = np.abs(run.outputs[name][np.isfinite(run.outputs[name])])
            largest = max(largest, float(known.max(initial=-1.0)))
            if largest > _LARGEST:
                raise InputError(f"{largest:g} is too large to be a measurement", file=run.file, field=name)
    others = [name for name in measured if name not in given]
    if largest < 0:
        reason = f"; the model of this vehicle does not give {', '.join(others)}" if others else ""
        message = f"nothing to compare: no signal that the model gives has a value{reason}"
        raise InputError(message, file=dataset.path, field="signals")
    note = f"Not compared, because the model of this vehicle does not give it: {', '.join(others)}."
    return ComparedSignals(names, (note,) if others else ())
