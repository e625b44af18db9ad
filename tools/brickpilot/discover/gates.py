"""Every number that decides a verdict, and why it has its value.

Costs are halves of sums of squared residuals, in scales (see binned_error.py), priors included. A difference of costs
is a log likelihood ratio as far as the scales are the sd of the residual.

The values are set on data of other physics, with the seeds that `tests/hidden/suites.py` keeps for calibration, never
with those that are reported. Data of the program's own plant have no model error, so values set on them mean nothing.
"""

from __future__ import annotations

# What is compared.

BIN_S = 0.03
"""Residuals are means over so many seconds: slower than tyres, compliance and vibration, which no model here has."""

MODEL_ERROR_SHARE = 0.004
"""Share of a signal's rms that belongs to its scale: no simulator matches a real machine better."""

LEAST_NOISE_SHARE = 1e-3
"""The least noise, as a share of a signal's rms: a smoother signal was filtered, and its noise with it."""

CORRELATED_S = 1.0
"""Residuals are taken for correlated over so many seconds, as a part of a manoeuvre lasts: it widens intervals."""

FOLLOWABLE_ROW_S = 0.008
"""In a log with shorter rows it is not asked whether inputs hold or are linear between them: bins hide it. Set without
data."""

TIMING_SURE = 0.95
"""What the inputs do between two rows is told if it is so probable. The usual level; set without data."""

# What is known of a nominal value that is stated without an sd, as a share of it. Three times as much is usual too.

SD_SHARE_RULER = 0.03
"""For a length, a mass or a battery voltage: read off a ruler, scales or a voltmeter."""

SD_SHARE_BENCH = 0.05
"""For a motor's constants: from a data sheet or a bench test."""

SD_SHARE_ESTIMATE = 0.1
"""For inertias and the inductance: estimated from the shape or from similar parts."""

SD_SHARE_GUESS = 0.3
"""For friction and drag: they change with grease, dust and floor."""

SD_SHARE_OF_A_MODELS_EFFECT = 0.1
"""For an effect's parameter that a given model holds: the model was fitted to other data."""

PRIOR_LEFT_SD = 3.0
"""A nominal value this many sd from the stated one is reported as a finding: the statement is wrong."""

PRIOR_STRAINED_SD = 5.0
"""A fit that moves a nominal value this far hides an effect in it: the search starts from the stated values too."""

# What an effect has to gain to be believed.

PARAMETER_COST = 12.0
"""Penalty for a free parameter. BIC asks for half of ln n, about 5; this asks for more, as bins are correlated."""

LEAST_GAIN = 60.0
"""The least fall of the penalised cost for an effect: clean data of a richer plant show less."""

LEAST_GAIN_SHARE = 0.05
"""The least fall as a share of the cost that remains: on large data sets a small model error gains more than 60."""

UNEXPLAINED_GAIN_SHARE = 0.2
"""Added to that share as the cost rises above the floor: a wrong model lets any free parameter gain something."""

GAIN_SHARE_OF_EARLIER = 0.004
"""The least fall as a share of what the other effects take away: a law that is slightly wrong leaves so much behind."""

STRAIN_RELEASED = 2.0
"""That share is not asked for if the new effect brings a strained value below 1 / this of the strained limit."""

HELD_OUT_SHARE = 0.25
"""On held-out runs the cost has to fall by this share of what the effect changes there. 1: the effect is exactly right;
below 0: the runs are better without it. A law that is a little wrong or noise may hide the rest. A model that is named
also removes this part of the share that it removes on the fit runs."""

FREE_RUN_GROWS = 1.02
"""An effect that held-out runs do not show may make free runs of them worse by so much: that is noise."""

PROMISED_SHARE = 0.3
"""A screened candidate that promises a smaller share of the required gain is not fitted. It saw one size."""

STRUCTURED = 1.2
"""A cost above so many times that of noise has structure, which may come from a wrong effect: the search goes wider."""

MOST_EFFECTS = 4
"""The search adds no more effects: with more, beside the nominal parameters, any data can be fitted."""

MOST_FREE_RUN_EFFECTS = 5
"""Effects that the fit to whole runs adds to the written model, at most: friction, two timings, offset and one more."""

FREE_RUN_GAIN_SHARE = 0.03
"""The least fall of the penalised cost of whole runs, as a share, for an effect that joins without a claim."""

# What an effect's name says has to be true of the fitted values.

AT_BOUND = 1e-3
"""A fitted parameter this near to an end of its range other than 0, as a share of itself, stands at it."""

LIMIT_OVER_READING = 0.9
"""A sensor never reads beyond its limit. A limit may lie so far below the largest reading, which has noise on it."""

LEAST_BASE_SHARE = 0.1
"""A parameter that others add to is at least this share of what is added: dry friction remains after a breakaway."""

LEAST_PERIODS_PER_TURN = 0.9
"""An effect with fewer periods per turn is not periodic."""

LEAST_PERIODS_OVER_TRAVEL = 1.5
"""The same for a drive that commands a force, over the longest travel."""

# Whole runs or windows. Shares are of the cost above that of noise.

WINDOWS_REMOVE = 0.7
"""An explanation of windows has to remove so much: windows hide slow errors, so a weak explanation says little."""

WINDOWS_REMOVE_MORE = 0.1
"""It also has to remove so much more than the explanation of whole runs."""

WINDOWS_SUSPECT = 0.5
"""A periodic explanation that removes so much of windows is listed without a claim where whole runs show nothing: over
a whole run no phase fits. Set on magnets that pull with a strong second harmonic, of which 0.56 is removed."""

WINDOWS_EXPLAINED = 0.9
"""No term is composed if windows are explained so far: what remains is the noise of their start states."""

# Verdict.

RIVAL_MARGIN = 12.0
"""Explanations within so much penalised cost of the best are rivals: as much as one parameter has to gain."""

RIVAL_MARGIN_SHARE = 0.02
"""The margin as a share of the best one's cost, where that is more."""

SAME_SCALES = 0.1
"""Two simulations that differ by less, rms, in scales, say the same: the one with more parameters is no rival."""

ADEQUATE = 1.3
"""A cost up to so many times that of noise could be noise. Above, the residual has structure."""

UNEXPLAINED = 1.6
"""Above so many times the cost of noise something is missing, even if no effect takes it away: `unknown`."""

INDISPENSABLE = 1.25
"""A size without an interval stays if the cost without it is so many times as high, and as high above the model-error
floor: then only its unit is unknown."""

PREDICTABLE = 0.02
"""Where no explanation was found and the error is above noise, this share of it has to be predictable for `unknown`."""

CLEARLY_PREDICTABLE = 0.25
"""The same where the error could be noise: small errors of tyres and vibration are predictable on clean data too."""

SHOWS_MECHANISM = 0.7
"""An explanation that removes this share of the cost above noise, or a law whose change of the signals correlates so
far with that of a composed term, shows the mechanism, although the law is not quite right."""

EFFECT_SHOWN = 1.0
"""An effect shows where it changes a signal by more than so many noise sd, rms over a tenth of a second."""

ERROR_SHOWN = 1.5
"""The same for an error without an explanation, which has the noise on it: noise alone has 1."""

WORTH_LISTING = 0.1
"""For `unknown`, the best explanation is listed, without a claim, if it removes this share of the cost above noise."""

# Values that differ from run to run. They have to gain what an effect with as many parameters has to gain, and these.

LEAST_RUNS_THAT_DIFFER = 4
"""Fit runs, at least: of fewer, no sd between runs can be told. Set without data."""

RUNS_DIFFER_CHANCE = 1e-3
"""Runs with equal values would differ as much with at most this probability. Set without data."""

HALF_PREDICTS_HALF = 0.5
"""A value found in one half of a run predicts this share of what the other half asks for: what belongs to the run acts
all through it, while an effect that is missing acts with the command. Set without data."""

FOLLOWS_THE_DRIVE = 0.9
"""Values whose correlation, of sizes or of ranks, with the runs' age or voltage is this large follow from what was
driven: that is a missing effect and no accident of the run. Six unrelated runs show it in 2 %."""

# A composed term. Its gates are those of an effect, and these.

TERM_SHARE_OF_EFFECTS = 0.05
"""A term has to gain so much of what the named effects take away, or it does not shake the names."""

MANY_EFFECTS = 3
"""So many named effects of windows may patch up one law that has no name: a term with fewer parameters that leaves
nothing but noise of whole runs then takes their place. Set on one rotation sensor that reads too little."""

TERM_HELD_OUT = 0.5
"""A term may leave so much of the held-out cost above noise. One that leaves more fits the noise of the fit runs."""

TERM_SECOND_PLACE_COST = 30.0
"""Penalty for each place of action after the first: one cause acts at one place."""

TERM_PLACE_COST = {"surge": 0.0, "yaw": 0.0, "floor": 0.0, "wheel": 4.0, "drive": 8.0}
"""Penalty by place: of two terms that explain as much, the one that acts on the body is plainer. A floor that is not
level pulls on the body as a force ahead does, and every floor is a little so: it costs as much as that force. What
accelerometers read tells the two apart."""

TERM_SENSOR_COST = 12.0
"""The same for a sensor: a sensor's error can imitate any motion, so it is the last explanation."""

TERM_RIVAL_MARGIN = 24.0
"""Terms within so much penalised cost of the best are its rivals: as much as two parameters have to gain."""

TERM_EQUALS_EFFECT = 0.95
"""A composed term equals an effect whose simulated change, fitted to that of the term, has at least this cosine to it:
it then leaves less than a tenth (1 - 0.95^2) of what the term does. Set without data."""

SLOWEST_SWING_HZ = 0.5
"""The least frequency of a mass on a spring: a pendulum of a metre swings so, and no robot here carries a longer one.
A slower one would pass for a loss: on the log of a drivetrain a swing of 18 s stood for drag in turns."""

MOST_TERMS = 3
"""A composed law has no more terms: the basis is large, and a law that a reader can check is short."""

# The next experiment.

SEPARATES_NOISE_SD = 0.5
"""A manoeuvre separates rivals that differ so much, rms, in noise sd: ten seconds of samples show it clearly."""

SEPARATES_SIGNAL_SHARE = 0.02
"""A signal is worth measuring if rivals differ by so much of its rms: an ordinary sensor shows that."""


def parameter_cost(cost: float, floor_cost: float) -> float:
    """Returns the penalty for one parameter of a model that leaves `cost`.

    It grows with the cost above the model-error floor: where a model is wrong, a difference of cost is worth so much
    less (a quasi-likelihood: McCullagh & Nelder 1989, ch. 9).
    """
    return PARAMETER_COST * max(1.0, cost / floor_cost)


def required_gain(after: float, floor_cost: float) -> float:
    """Returns how much of the penalised cost an effect has to take away if it leaves `after`.

    A model that leaves much more than the model-error floor is wrong in other ways too, and every free parameter takes
    some of that away.
    """
    unexplained = max(0.0, 1 - floor_cost / after) if after > 0 else 0.0
    return max(LEAST_GAIN, (LEAST_GAIN_SHARE + UNEXPLAINED_GAIN_SHARE * unexplained) * after)


def gains_enough(before: float, after: float, floor_cost: float) -> bool:
    """Returns whether a fall of the penalised cost is more than clean data of a richer plant ever show."""
    return before - after > required_gain(after, floor_cost)


def strip_cost(cost: float) -> float:
    """Returns the penalty for a term on a strip of the floor, in a fit that leaves `cost`.

    Place and width of a strip are picked from hundreds of windows, so one of them fits any disturbance that a run
    repeats at a place. It has to be better than a plain term by more than rivals may differ. No number of its own.
    """
    return max(TERM_RIVAL_MARGIN, RIVAL_MARGIN_SHARE * cost)


def rival_margin(best_penalised: float, best_cost: float, floor_cost: float) -> float:
    """Returns the penalised cost up to which another explanation is a rival of the best one."""
    return best_penalised + max(RIVAL_MARGIN, RIVAL_MARGIN_SHARE * best_cost) * max(1.0, best_cost / floor_cost)
