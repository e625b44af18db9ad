"""Designs. A design draws a share, 0..1, for each input of each run. The input's quantile function makes it a value.

A run is identified by its number. Its draws depend only on this number, the campaign's file and the seed.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brickpilot.campaign.file import Campaign
from brickpilot.errors import InputError

Array = NDArray[np.float64]

MORRIS_LEVELS = 4
MORRIS_EDGE = 0.025
"""Share of Morris's lowest level, and 1 minus that of the highest: at 0 or 1, an unbounded distribution is infinite."""


def drawn_shares(campaign: Campaign) -> Callable[[int, int], Array]:
    """Returns a function (start, stop) -> shares of the runs `start` to `stop - 1`, (runs, inputs drawn), each 0..1.

    The designs monte_carlo and grid draw a run when it is asked for. For other designs, all runs are drawn at once.
    """
    if campaign.design == "monte_carlo":
        return partial(_independent, campaign)
    if campaign.design == "grid":
        return partial(_grid, campaign)
    whole = _whole(campaign)
    return lambda start, stop: whole[start:stop]


def problem(campaign: Campaign) -> dict[str, Any]:
    """Returns the inputs in SALib's form; SALib samples and analyses the inputs' shares."""
    names = [input_.name for input_ in campaign.drawn]
    return {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}


def block(campaign: Campaign, index: int) -> int:
    """Returns the block that a run belongs to. The runs of a block share their sensors' noise and their route.

    Some designs compare groups of runs that differ in one input. Each group is a block, so that nothing else differs.
    In other designs, each run is a block.
    """
    return index // campaign.block_runs


def stream(campaign: Campaign, number: int, purpose: str) -> np.random.Generator:
    """Returns the random numbers of one run or block for one purpose, such as an input's name."""
    key = (number, zlib.crc32(purpose.encode()))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(campaign.seed, spawn_key=key)))


def noise_seed(campaign: Campaign, index: int) -> int:
    """Returns the seed of a run's sensors and of its faults, 0..2^63 - 1."""
    drawn = np.random.SeedSequence(campaign.seed, spawn_key=(block(campaign, index),)).generate_state(1, np.uint64)
    return int(drawn[0]) >> 1


def _independent(campaign: Campaign, start: int, stop: int) -> Array:
    names = [input_.name for input_ in campaign.drawn]
    drawn = [[stream(campaign, index, name).random() for name in names] for index in range(start, stop)]
    return np.array(drawn).reshape(stop - start, len(names))


def _grid(campaign: Campaign, start: int, stop: int) -> Array:
    """Returns the shares of a grid: for an axis, the middle of the run's level; for any other input, a new draw.

    The runs that repeat a grid point follow each other; then the level of the last axis changes.
    """
    shares = _independent(campaign, start, stop)
    levels = {column: input_.levels for column, input_ in enumerate(campaign.drawn) if input_.distribution.listed}
    points = np.unravel_index(np.arange(start, stop) // campaign.count, tuple(levels.values()))
    for (column, count), level in zip(levels.items(), points, strict=True):
        shares[:, column] = (level + 0.5) / count
    return shares


def _whole(campaign: Campaign) -> Array:
    """Returns the shares of all runs, for a design that draws all runs together."""
    from scipy.stats import qmc

    dimensions = len(campaign.drawn)
    seed = np.random.SeedSequence(campaign.seed, spawn_key=(zlib.crc32(b"design"),))
    if campaign.design == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(campaign.count))
    if campaign.design == "sobol":
        sampler = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
        return np.asarray(sampler.random_base2(campaign.count.bit_length() - 1))
    return _by_salib(campaign, int(seed.generate_state(1)[0]))


def _by_salib(campaign: Campaign, seed: int) -> Array:
    if campaign.design == "saltelli":
        sample = salib("sample.sobol").sample
        return np.asarray(sample(problem(campaign), campaign.count, calc_second_order=False, seed=seed))
    _check_levels(campaign)
    sample = salib("sample.morris").sample
    levels = sample(problem(campaign), campaign.count, num_levels=MORRIS_LEVELS, seed=seed)
    return np.asarray(MORRIS_EDGE + (1.0 - 2.0 * MORRIS_EDGE) * levels)


def made_by(campaign: Campaign) -> str:
    """Returns the version of SALib if SALib draws the runs, else an empty text. The workers do not need SALib."""
    if campaign.design not in ("saltelli", "morris"):
        return ""
    salib("sample.sobol")  # raises an InputError if the library is missing
    return version("SALib")


def _check_levels(campaign: Campaign) -> None:
    """Refuses a list of values if Morris's levels do not reach all values."""
    shares = np.linspace(MORRIS_EDGE, 1.0 - MORRIS_EDGE, MORRIS_LEVELS)
    for input_ in campaign.drawn:
        reached = len(set(input_.distribution.at(shares).tolist()))
        if input_.distribution.kind == "choice" and reached < input_.levels:
            raise InputError(
                f"morris flies only {reached} of its {input_.levels} values; saltelli flies all of them",
                field=f"vary.{input_.name}",
            )


def salib(module: str) -> Any:
    """Returns a module of SALib.

    Raises:
        InputError: SALib is not installed.
    """
    import importlib

    try:
        return importlib.import_module(f"SALib.{module}")
    except ModuleNotFoundError:
        raise InputError("the library SALib is not installed: pip install 'brickpilot[campaign]'") from None
