"""The numbers that decide a verdict, and why each has its value.

Each is a convention (a level, a decade) or follows from one. None is set on a case. Two more weigh every residual, also
those of `calibrate`, and stand in fit/residual.py; the decade of a prior stands in fit/parameters.py. Numbers that only
say how much work a search does stand where it is done: they propose, and decide nothing.
"""

from __future__ import annotations

import math

BIN_S = 0.03
"""Residuals are means over so many seconds: slower than tyres, compliance and vibration, which no model here has."""

STRETCH_S = 2.0
"""An explanation is judged by how it predicts stretches of so many seconds that it was not fitted to: longer than a
motor and a body settle, so that what is left out is another answer and not the end of the same one."""

KNEE = 2.0
"""Scales at which the hyperbolic density turns from square to linear. The robust fit has the same knee."""

COMMON, RARE = 0.05, 0.01
"""Prior odds of an effect that most machines have and of one that few have; the effect table says which."""

USUAL = math.sqrt(COMMON * RARE)
"""Prior odds between the two."""

SURE = 0.95
"""The weight that a set of explanations holds, that names an effect, and the level of every interval and test."""

STRICT = 0.01
"""The level at which data show a feedback loop or a period of its own: all that is concluded changes with them."""

CHANCE_NATS = -math.log(1 - SURE)
"""The log likelihood ratio that counts as sure: 3.0 nats."""

LAW_ERROR = 0.01
"""Between explanations, this share of the evidence that the best one gains decides nothing: no law is exact."""

LAW_SHAPE = 0.05
"""Of the squares that a law removes from a signal, its own wrong shape may have left this share, a fifth in size: no
other law is named for it. Four of five laws that the library lacks were fitted to all but 3 to 6 % by a like one."""

SHARED_REST = 0.2
"""Of the squared error that the best explanation leaves, another law might share this part: differences below what that
would gain decide nothing. A black box that predicts more than this share of it shows that something is missing."""

UNEXPLAINED_NATS = 0.3
"""What is left above noise, in nats a value, that is too much for `none` and for a name: a third more than noise."""

RULER, BENCH, ESTIMATE, GUESS = 0.03, 0.05, 0.1, 0.3
"""The sd of a nominal value that is stated without one, as a share of it: lengths, masses and voltages are read off a
ruler, scales or a voltmeter; a motor's constants come from a sheet or a bench; inertias are estimated from the shape;
friction changes with grease, dust and floor."""


def leaves_prior(sd_away: float, parameters: int) -> bool:
    """Returns whether a value is further from what was stated of it than chance among so many values explains."""
    return math.erfc(abs(sd_away) / math.sqrt(2)) * max(parameters, 1) < 1 - SURE
