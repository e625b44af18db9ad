"""Tests whether the commands of a log follow the outputs: whether a feedback loop was closed.

If the output noise is coloured, a feedback loop biases the fit of a model that simulates from the commands alone: the
commands contain the noise, and the model may explain the noise by a delay that does not exist. Sources: Granger (1969),
Econometrica 37; Gustavsson, Ljung & Soederstroem (1977), Automatica 13.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from brickpilot.data.dataset import Dataset, Run
from brickpilot.data.signals import RATE_OF, Array, input_names

_BLOCKS = 20  # number of blocks in cross-validation; 10 to 30 are usual for batch means (Schmeiser 1982, Oper. Res. 30)
_PER_UNKNOWN = 10  # least number of decisions (changes of the command) for each coefficient of a regression
_PAST = (1, 2, 4, 8, 16, 32)  # numbers of past decisions tried as predictors of the next; the best number is used
_SMOOTHED = 8  # number of exponential means of earlier commands, over 2, 4 ... 256 rows; slow motion follows such means
_READINGS = 3  # number of readings at past decisions that are used: an incremental PID law needs three
_SHOWN = 3 + _READINGS  # number of columns of `_decisions` that hold the output: earlier readings, and its last change
_HUBER = 1.345  # sds: a larger residual gets less weight; 95 % efficient for normal noise (Huber 1964)
_NORMAL_MAD = 1.4826  # ratio of sd to median absolute deviation for normal noise
_EXACT = 1e-6  # limit, as a share of a command's rms change: if the prediction errs by less, the plan is exact
_RIDGE = 1e-12  # share of the mean square, added to the normal equations' diagonal: equal readings make them singular


@dataclass(frozen=True)
class Loop:
    """A feedback loop that was closed while the data were logged.

    Attributes:
        command: the input that follows an output.
        output: the signal that the command follows.
        gain: the share, 0..1, by which the output's readings reduce the squared error of a prediction of the command
            from earlier commands, in cross-validation.
        lag: time in s between the command and the earlier reading that predicts it best; 0: both are in the same row.
        chance: p-value (the probability of such a gain without a loop), times the number of tests.
    """

    command: str
    output: str
    gain: float
    lag: float
    chance: float

    @property
    def sentence(self) -> str:
        """Returns the sentence for the user."""
        late = f"{1e3 * self.lag:.3g} ms later" if self.lag else "in the same row"
        return (
            f"{self.command} follows {self.output}, {late}: {self.output} explains {100 * self.gain:.2g} % of the "
            "changes that earlier commands do not explain. So the data come from a feedback loop, which biases free "
            "runs if the noise of a sample depends on earlier samples"
        )


def follows_outputs(dataset: Dataset, level: float) -> Loop | None:
    """Returns the feedback loop with the smallest p-value; None: no loop is significant or testable.

    The past of a planned command may predict the command, but sensor readings do not improve this prediction. So the
    test is one of Granger causality from outputs to commands. Only rows in which a command changes count. Three
    predictions of the change are compared. The first uses the earlier commands: the latest commands, and means over 2
    to 256 rows, because a slow motion follows such means. The second also uses the earlier readings. The third also
    uses the reading of the same row. If a command is logged late, it has already changed this reading. So the third
    prediction counts only if the command opposes the motion, as feedback with the right sign does. Each block of a run
    is predicted by a fit to the other blocks. A t-test over the blocks shows whether the mean of
    `log(squared error without readings / with readings)` is above 0. Runs too short for a separate fit are pooled.

    Only speeds, angles and positions count as outputs: accelerations, forces and currents respond in the row of the
    command. The battery's voltage drops with the motion. So if the duty was planned, the volts follow the motion; if
    the volts were planned, the duty follows it. If the battery's voltage is measured, a loop therefore counts only if
    both volts and duty follow the output. The test misses a loop whose readings have no noise or disturbance, because
    then the past commands predict the next command. It also misses a loop in which the command changes too rarely, such
    as a relay. It sometimes finds a false loop in coarsely rounded sines (15 of 240 simulated data sets).

    Args:
        level: significance level: a loop is returned only if its `chance` is smaller.
    """
    commands = input_names(dataset.runs[0].inputs)
    motion = {*RATE_OF, *RATE_OF.values(), "yaw_rate", "yaw_angle"}
    measured = dict.fromkeys(name for run in dataset.runs for name in run.outputs)
    outputs = [name for name in measured if name in motion]
    forms = [dataset.runs]
    if commands[0].startswith("voltage") and "battery_voltage" in dataset.signals:
        forms.append(tuple(_as_duty(run, commands) for run in dataset.runs))
    loops = []
    with threadpool_limits(1, "blas"):  # the matrices are small: several threads take ten times as long
        for command, output in itertools.product(commands, outputs):
            ordered = (command, *(other for other in commands if other != command))
            tested = [loop for runs in forms if (loop := _tested(runs, ordered, output)) is not None]
            if len(tested) == len(forms):
                loops.append(max(tested, key=lambda loop: loop.chance))
    if not loops:
        return None
    best = min(loops, key=lambda loop: loop.chance)
    chance = min(best.chance * len(loops), 1.0)
    return dataclasses.replace(best, chance=chance) if chance < level else None


def _as_duty(run: Run, commands: Sequence[str]) -> Run:
    with np.errstate(divide="ignore", invalid="ignore"):
        inputs = {name: run.inputs[name] / run.outputs["battery_voltage"] for name in commands}
    return dataclasses.replace(run, inputs=inputs)


def _tested(runs: Sequence[Run], commands: Sequence[str], output: str) -> Loop | None:
    """Returns how well `output` predicts the first of `commands`; its p-value is double that of the better test."""
    runs = [run for run in runs if output in run.outputs]
    own = [_predicted([run], commands, output) for run in runs]
    pooled = _predicted([run for run, alone in zip(runs, own, strict=True) if alone is None], commands, output)
    known = [prediction for prediction in (*own, pooled) if prediction is not None]
    if not known:
        return None
    past, now = (np.concatenate([getattr(prediction, name) for prediction in known]) for name in ("past", "now"))
    opposes = sum(prediction.feedback for prediction in known) * _sign(commands[0], output) < 0.0
    of_past, of_now = _chance(past), _chance(now) if opposes else 1.0
    most = now if of_now < of_past else past
    late = most is past or past.mean() > (now - past).mean()
    lag = float(np.median([prediction.lag for prediction in known])) if late else 0.0
    gain = 1.0 - math.exp(-float(most.mean()))
    return Loop(commands[0], output, gain, lag, min(2.0 * min(of_past, of_now), 1.0))


def _chance(gained: Array) -> float:
    """Returns the p-value of the mean of `gained` (blocks,) against an expectation of 0 (one-sided t-test)."""
    from scipy.stats import ttest_1samp  # slow to load, and seldom needed

    return float(ttest_1samp(gained, 0.0, alternative="greater").pvalue) if np.ptp(gained) > 0.0 else 1.0


def _sign(command: str, output: str) -> float:
    """Returns the sign with which a command drives an output, by the signals' definitions; 0: no sign is defined.

    The data cannot give this sign: if a loop holds a constant speed, the data show the sign of the feedback, not
    the sign of the motor.
    """
    if output.startswith("yaw"):
        return {"left": 1.0, "right": -1.0, "diff": 1.0}.get(command.rpartition("_")[2], 0.0)
    sides = [name.rpartition("_")[2] for name in (command, output) if name.endswith(("_left", "_right"))]
    if command == "duty_diff":
        return 1.0 if output.endswith("_left") else -1.0
    return 1.0 if command == "duty_mean" or len(set(sides)) < 2 else 0.0


@dataclass(frozen=True, eq=False)
class _Prediction:
    """How well the readings of some runs predict a command.

    Attributes:
        past: (blocks,) log of (squared error of a prediction from the commands alone / squared error of a prediction
            that also uses earlier readings).
        now: (blocks,) as `past`, but the second prediction also uses the reading of the same row.
        feedback: the coefficient of the reading of the same row; below 0: the command opposes the reading.
        lag: the age of the reading that predicts best, s.
    """

    past: Array
    now: Array
    feedback: float
    lag: float


def _predicted(runs: Sequence[Run], commands: Sequence[str], output: str) -> _Prediction | None:
    """Returns the prediction for runs of one controller; None: the command changes too rarely or is exactly planned."""
    best, ages, least = None, np.empty(0), math.inf
    for number in _PAST:
        decisions = [of_run for run in runs if (of_run := _decisions(run, commands, output, number)) is not None]
        columns = decisions[0][0].shape[1] if decisions else 0
        if not decisions or sum(len(table) for table, _ in decisions) < _PER_UNKNOWN * (columns - 1):
            break
        weighed = _weighted([table for table, _ in decisions])
        if weighed is None:
            return None
        table, log_sd = weighed
        likelihood = log_sd + 0.5 * math.log(_errors(table, range(1, columns - _SHOWN)).mean())
        if likelihood < least:
            best, ages, least = table, decisions[0][1], likelihood
    if best is None:
        return None
    now = best.shape[1] - 1
    planned, shown = range(1, now - len(ages)), range(now - len(ages), now)
    alone = _errors(best, planned)
    past, both = (np.log(alone / _errors(best, range(1, end))) for end in (now, now + 1))
    feedback = float(np.linalg.lstsq(best[:, 1:], best[:, 0])[0][-1])
    single = [_errors(best, [*planned, column]).sum() for column in shown]
    return _Prediction(past, both, feedback, float(ages[int(np.argmin(single))]))


def _errors(table: Array, columns: Sequence[int]) -> Array:
    """Returns (blocks,): in each block of rows, the mean square error of the first column predicted from `columns`.

    The prediction is fitted to the other blocks.
    """
    rows = len(table)
    blocks = np.split(table[:, [0, *columns]], [block * rows // _BLOCKS for block in range(1, _BLOCKS)])
    products = np.array([block.T @ block for block in blocks])
    others = products.sum(axis=0) - products + rows * len(columns) * _RIDGE * np.eye(len(columns) + 1)
    fitted = np.linalg.solve(others[:, 1:, 1:], others[:, 1:, :1])[..., 0]
    residuals = (block[:, 0] - block[:, 1:] @ of for block, of in zip(blocks, fitted, strict=True))
    return np.array([np.mean(residual**2) for residual in residuals])


def _weighted(tables: Sequence[Array]) -> tuple[Array, float] | None:
    """Returns the tables as one, and the mean of log(sd of the residual); None: the commands are an exact plan.

    The residual is that of a prediction from the commands alone. Each run's rows are divided by the sd of the run's
    residual, rows with a large residual get less weight, and each column except the first is divided by its rms.
    """
    table = np.concatenate(tables)
    change, planned = table[:, 0], table[:, 1:-_SHOWN]
    left = np.abs(change - planned @ np.linalg.lstsq(planned, change)[0])
    run_of = np.repeat(np.arange(len(tables)), [len(one) for one in tables])
    sd = np.array([_NORMAL_MAD * np.median(left[run_of == run]) for run in range(len(tables))])[run_of]
    if np.median(sd) < _EXACT:
        return None
    sd = np.maximum(sd, _EXACT)
    table = table / (sd * np.sqrt(np.maximum(left / (_HUBER * sd), 1.0)))[:, np.newaxis]
    size = np.sqrt(np.mean(table**2, axis=0))
    size[0] = 1.0
    return table / np.where(size > 0.0, size, 1.0), float(np.log(sd).mean())


def _decisions(run: Run, commands: Sequence[str], output: str, past: int) -> tuple[Array, Array] | None:
    """Returns a run's changes of the first command, each after at least `past` earlier changes; None: no such change.

    The table (n, columns) is in units of the rms change. The columns are the command's change, the earlier commands,
    the earlier readings of the output, and the output's change from the row before. The second result is the median age
    of each earlier reading of the output, s.
    """
    from scipy.signal import lfilter  # slow to load, and seldom needed

    inputs, reading = np.column_stack([run.inputs[name] for name in commands]), run.outputs[output]
    with np.errstate(invalid="ignore"):
        row = 1 + np.flatnonzero(np.abs(np.diff(inputs[:, 0])) > 0.0)
    at = np.arange(max(past, _READINGS), len(row))
    at = at[row[at] > 1]
    k = row[at]
    if not len(k):
        return None
    last, base = inputs[k - 1], np.nan_to_num(inputs - inputs[0])
    means = [
        lfilter([2.0**-m], [1.0, 2.0**-m - 1.0], base, axis=0)[k - 1] - base[k - 1] for m in range(1, _SMOOTHED + 1)
    ]
    planned = [np.ones((len(k), 1)), last, *means, *(last - inputs[row[at - one] - 1] for one in range(1, past + 1))]
    before = [k - 1, k - 2, *(row[at - one] for one in range(1, _READINGS + 1))]
    shown = [reading[k - 1] - reading[0], *(reading[k - 1] - reading[one] for one in before[1:])]
    table = np.column_stack([inputs[k, 0] - inputs[k - 1, 0], *planned, *shown, reading[k] - reading[k - 1]])
    table = table[np.isfinite(table).all(axis=1)]
    if not len(table):
        return None
    ages = np.array([np.median(run.time[k] - run.time[one]) for one in before])
    return table / np.sqrt(np.mean(table[:, 0] ** 2)), ages
