"""The sd of a nominal value that the data set states without one."""

from __future__ import annotations

import dataclasses

from brickpilot.data.dataset import Dataset, Nominal
from brickpilot.discover.gates import SD_SHARE_BENCH, SD_SHARE_ESTIMATE, SD_SHARE_GUESS, SD_SHARE_RULER

# What is absent here has no default sd: it is a constant, or it says that the drive commands a force.
SD_SHARE = {
    "mass": SD_SHARE_RULER,
    "half_track": SD_SHARE_RULER,
    "wheel_radius": SD_SHARE_RULER,
    "resistance": SD_SHARE_BENCH,
    "torque_constant": SD_SHARE_BENCH,
    "emf_constant": SD_SHARE_BENCH,
    "battery_voltage": SD_SHARE_RULER,
    "yaw_inertia": SD_SHARE_ESTIMATE,
    "wheel_inertia": SD_SHARE_ESTIMATE,
    "inductance": SD_SHARE_ESTIMATE,
    "viscous_friction": SD_SHARE_GUESS,
    "rolling_friction": SD_SHARE_GUESS,
    "drag_area": SD_SHARE_GUESS,
}


def with_default_sds(dataset: Dataset) -> Dataset:
    """Returns the data set with an sd on every nominal value that was stated without: nobody knows a value exactly.

    A wrong nominal value is not an effect. All nominal values are fitted, each within what is usual for its kind.
    """
    nominal = {
        name: Nominal(known.value, abs(known.value) * SD_SHARE[name])
        if known.sd is None and known.value != 0 and name in SD_SHARE
        else known
        for name, known in dataset.nominal.items()
    }
    return dataclasses.replace(dataset, nominal=nominal)
