"""The numbers that decide a verdict, and why each has its value.

Each number is a convention (a level, a decade) or follows from a convention. None is tuned on a single case. Two more
numbers weigh every residual, also in `calibrate`, and stand in fit/residual.py; the decade of a prior stands in
fit/parameters.py. Numbers that only limit the work of a search stand beside the search, as they decide nothing.
"""

from __future__ import annotations

import math

BIN_S = 0.03
"""Residuals are means over bins of this length, s: longer than motions of tyres or vibration, which no model has."""

STRETCH_S = 2.0
"""Length of the stretches, s, on which an explanation is judged without being fitted to them: longer than a motor and a
body need to settle, so that each stretch holds a new response, not the end of the previous one."""

KNEE = 2.0
"""In scales: beyond it the hyperbolic log density is linear, not quadratic. The robust fit has the same knee."""

COMMON, RARE = 0.05, 0.01
"""Prior odds of an effect that most machines have and of one that few have; the effect table says which."""

USUAL = math.sqrt(COMMON * RARE)
"""Prior odds of all other effects, between `COMMON` and `RARE`."""

SURE = 0.95
"""The weight of the explanations that are kept; the weight that names an effect; the level of intervals and tests."""

STRICT = 0.01
"""Level of the tests for a feedback loop and for a disturbance with its own period: all conclusions depend on these."""

CHANCE_NATS = -math.log(1 - SURE)
"""The log likelihood ratio that counts as sure: 3.0 nats."""

LAW_ERROR = 0.01
"""Share of the best explanation's gain in evidence: a smaller difference decides nothing, as no law is exact."""

LAW_SHAPE = 0.05
"""A law's wrong shape may leave this share of the squares that the law removes from a signal, a fifth in amplitude: no
other law is named for this rest. For four of five laws that the library lacks, a similar law left 3 to 6 %."""

SHARED_REST = 0.2
"""Another law might remove this share of the squared error that the best explanation leaves: a smaller gain decides
nothing. A black box that predicts more than this share of the error shows that something is missing."""

UNEXPLAINED_NATS = 0.3
"""A residual above noise by more, in nats per value, excludes `none` and a name: it is a third more than noise."""

RULER, BENCH, ESTIMATE, GUESS = 0.03, 0.05, 0.1, 0.3
"""The default sd of a stated nominal value, as a share of the value: lengths, masses and voltages are read off a ruler,
scales or a voltmeter; a motor's constants come from a sheet or a bench; inertias are estimated from the shape; friction
changes with grease, dust and floor."""


def leaves_prior(sd_away: float, parameters: int) -> bool:
    """Returns whether a value is further from its stated value than chance among `parameters` values explains."""
    return math.erfc(abs(sd_away) / math.sqrt(2)) * max(parameters, 1) < 1 - SURE
