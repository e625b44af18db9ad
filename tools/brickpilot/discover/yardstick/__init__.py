"""The yardstick that a real machine can be held to: fit in percent before, after and attainable.

A real machine is never simulated to the noise of its sensors, so multiples of noise say little about it. Two other
bounds are measured from the data. Repeatability: how far repeats of the same inputs differ. Predictability: how much
of the nominal model's error a black box predicts on runs that it has not seen. What nobody can predict is not missing
from the simulator.

    nominal = reference(prepared, calibrated)    the nominal model beside a black box; a few seconds
    record = measure(nominal, augmented)         the record with another model beside both; at once

`record.signals[signal][horizon]` has the fits, `record.predictable[horizon]` the shares. `measure(nominal, calibrated)`
asks of the nominal model alone: if `predictable["free_run"].held_out_interval` lies above 0, a black box does better
than the nominal model on held-out runs, so something is missing.

    horizons       simulates free runs and windows that start from what was measured
    rows           thins samples out to rows
    features       what the black box is told
    black_box      learns the error on some runs and predicts it on others
    repeatability  how far repeats differ
    measure        puts the figures together
    record         the figures
"""

from brickpilot.discover.yardstick.measure import Reference, measure, reference
from brickpilot.discover.yardstick.record import Yardstick

__all__ = ["Reference", "Yardstick", "measure", "reference"]
