"""The numbers that decide a verdict, and why each has its value.

Each number is a convention (a level, a decade) or follows from a convention. No number is tuned on a single case. The
two numbers that weigh every residual, also in `calibrate`, stand in fit/residual.py; the width of a prior, a decade,
stands in fit/parameters.py. Numbers that only limit a search decide no verdict, and stand beside the search.
"""

from __future__ import annotations

import math

BIN_S = 0.03
"""Length, s, of bins in which residuals are averaged. Models lack tyre motion and vibration, which are faster."""

STRETCH_S = 2.0
"""Length, s, of a stretch: an explanation is judged by stretches that it was not fitted to. A stretch is longer than
the settling time of a motor and a body, so it holds a new response, not the end of the previous response."""

KNEE = 2.0
"""Residual, in scales, beyond which the log of the hyperbolic density falls linearly instead of quadratically."""

COMMON, RARE = 0.05, 0.01
"""Prior odds of an effect that most machines have, and of an effect that few machines have; see the effect table."""

USUAL = math.sqrt(COMMON * RARE)
"""Prior odds of all other effects, between `COMMON` and `RARE`."""

SURE = 0.95
"""Weight that kept explanations hold together; least weight of a named effect; confidence of intervals and tests."""

STRICT = 0.01
"""Significance level of tests for a feedback loop or a periodic disturbance: all conclusions depend on these tests."""

CHANCE_NATS = -math.log(1 - SURE)
"""The least log likelihood ratio that counts as sure: 3.0 nats."""

LAW_ERROR = 0.01
"""No law is exact: a difference in evidence below this share of the best explanation's gain decides nothing."""

LAW_SHAPE = 0.05
"""Squared error that a law's wrong shape may leave in a signal, as a share of what the law removes. Such error
justifies no further law, except an offset. For four of five laws not in the library, a similar law left 3 to 6 %."""

SHARED_REST = 0.2
"""Another law might remove this share of the squared error that the best explanation leaves, so a smaller difference
decides nothing. If a black box predicts more than this share of the error, a law is missing."""

UNEXPLAINED_NATS = 0.3
"""Largest log(residual / noise), nats per value, at which the verdict may be `none` or `named`: a third above noise."""

RULER, BENCH, ESTIMATE, GUESS = 0.03, 0.05, 0.1, 0.3
"""Default relative sd of a stated nominal value. RULER: lengths, masses and voltages, read off a ruler, scales or a
voltmeter. BENCH: motor constants, from a data sheet or a bench. ESTIMATE: inertias, estimated from the shape. GUESS:
friction, which changes with grease, dust and floor."""


def leaves_prior(sd_away: float, parameters: int) -> bool:
    """Returns whether a value is further from its stated value than chance explains in `parameters` tests."""
    return math.erfc(abs(sd_away) / math.sqrt(2)) * max(parameters, 1) < 1 - SURE
