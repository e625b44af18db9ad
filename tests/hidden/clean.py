"""Writes the data of a recipe without noise and quantisation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hidden import folder, measure
from hidden.recipe import Recipe


def write(recipe: Recipe, parent: Path) -> Path:
    """Writes the data set PARENT/NAME, without noise, quantisation, held-out runs and truth file; returns its folder.

    dataset.toml states the usual noise, so that a fit weighs the signals as in the data set with noise.
    """
    stated = replace(recipe, noise_sd_stated=True, quantised=False)
    runs = measure.sense(measure.tracks(stated), stated)
    out = parent / recipe.name
    out.mkdir(parents=True)
    for run, signals in zip(stated.runs, runs, strict=True):
        text = folder._table(stated, run.held(stated.sample_s), signals)
        (out / f"{run.name}.csv").write_text(text, encoding="ascii")
    said = folder._description(stated, folder.nominal(stated), list(runs[0]))
    (out / "dataset.toml").write_text(said.replace("[[runs]]", '[[runs]]\nrole = "fit"'), encoding="ascii")
    return out
