"""The numbers that decide a verdict, and why each has its value.

Each number is a convention (a level, a decade) or follows from a convention. None is tuned on a single case. The two
numbers that weigh every residual, also in `calibrate`, stand in fit/residual.py; the width of a prior, a decade, stands
in fit/parameters.py. Numbers that only limit the work of a search decide no verdict, and stand beside the search.
"""

from __future__ import annotations

import math

BIN_S = 0.03
"""Length of the bins over which residuals are means, s: longer than tyre motion or vibration, which no model has."""

STRETCH_S = 2.0
"""Length, s, of the stretches on which an explanation is judged without being fitted to them. It is longer than the
settling time of a motor and a body, so each stretch holds a new response, not the end of the previous one."""

KNEE = 2.0
"""Residual, in scales, beyond which the hyperbolic log density is linear, not quadratic, as in the robust fit."""

COMMON, RARE = 0.05, 0.01
"""Prior odds of an effect that most machines have, and of an effect that few machines have; see the effect table."""

USUAL = math.sqrt(COMMON * RARE)
"""Prior odds of all other effects, between `COMMON` and `RARE`."""

SURE = 0.95
"""Weight that the kept explanations hold; weight that names an effect; confidence level of intervals and tests."""

STRICT = 0.01
"""Level of the tests for a feedback loop and for a disturbance with its own period: all conclusions depend on them."""

CHANCE_NATS = -math.log(1 - SURE)
"""The log likelihood ratio that counts as sure: 3.0 nats."""

LAW_ERROR = 0.01
"""Share of the best explanation's gain in evidence below which a difference decides nothing, as no law is exact."""

LAW_SHAPE = 0.05
"""Error that a law's wrong shape may leave in a signal, as a share of the squares that the law removes; a fifth in
amplitude. No other law is named for it. For four of five laws that the library lacks, a similar law left 3 to 6 %."""

SHARED_REST = 0.2
"""Share of the best explanation's remaining squared error that another law might remove: a smaller difference decides
nothing. If a black box predicts more than this share of the error, a law is missing."""

UNEXPLAINED_NATS = 0.3
"""Largest log of the ratio of residual to noise, in nats per value, for `none` or a name: a third above noise."""

RULER, BENCH, ESTIMATE, GUESS = 0.03, 0.05, 0.1, 0.3
"""Default relative sd of a stated nominal value. RULER: lengths, masses and voltages, read off a ruler, scales or a
voltmeter. BENCH: motor constants, from a data sheet or a bench. ESTIMATE: inertias, estimated from the shape. GUESS:
friction, which changes with grease, dust and floor."""


def leaves_prior(sd_away: float, parameters: int) -> bool:
    """Returns whether a value is further from its stated value than chance explains, if `parameters` are tested."""
    return math.erfc(abs(sd_away) / math.sqrt(2)) * max(parameters, 1) < 1 - SURE
