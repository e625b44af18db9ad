"""The sd and the colour of a signal's noise are found, although the signal itself also changes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from brickpilot.data.noise import Noise, noise_of, step_of
from scipy.signal import lfilter

Array = np.ndarray

SAMPLES = {0.01: 500, 0.005: 1000, 0.001: 3000}
BIN = 6


def motion(count: int, period: float) -> Array:
    """Returns (count,): a step response with a slow oscillation, then its decay. `period`: sampling interval, s."""
    time = np.arange(count) * period
    end = 0.7 * time[-1]
    rise = 10 * (1 - np.exp(-time / 0.4)) * (1 + 0.3 * np.sin(4.4 * time))
    return np.where(time < end, rise, 10 * np.exp(-(time - end) / 0.4))


def records(noisy: Callable[[Array, np.random.Generator], Array], period: float) -> tuple[list[Array], Array]:
    """Returns six runs made by `noisy` of one motion, and their noise, (6, n). `period`: sampling interval, s."""
    random = np.random.default_rng(3)
    true = motion(SAMPLES[period], period)
    parts = [noisy(true, random) for _ in range(6)]
    return parts, np.array([part - true for part in parts])


def check(found: Noise, noise: Array, *, sd: float = 0.15, mean: float = 0.25) -> None:
    means = noise[:, : noise.shape[1] // BIN * BIN].reshape(-1, BIN).mean(axis=1)
    assert found.sd == pytest.approx(noise.std(), rel=sd)
    assert found.mean_sd(BIN) == pytest.approx(means.std(), rel=mean)


@pytest.mark.parametrize("period", SAMPLES)
@pytest.mark.parametrize("size", [0.05, 0.3])
def test_white_noise_falls_with_the_root_of_the_samples(size: float, period: float) -> None:
    found = noise_of((both := records(lambda x, r: x + r.normal(0, size, len(x)), period))[0])
    assert found.colour == "white"
    check(found, both[1], sd=0.06, mean=0.1)


@pytest.mark.parametrize("period", SAMPLES)
def test_a_fine_step_adds_its_own_noise(period: float) -> None:
    parts, noise = records(lambda x, r: np.round((x + r.normal(0, 0.1, len(x))) / 0.15) * 0.15, period)
    check(noise_of(parts), noise)


@pytest.mark.parametrize("period", [0.005, 0.001])
def test_a_coarse_step_without_noise_stays_in_a_mean(period: float) -> None:
    """Neighbouring samples are rounded to the same step, with similar errors: their mean is little better than one."""
    parts, noise = records(lambda x, r: np.round(x / 1.2) * 1.2, period)
    found = noise_of(parts)
    assert found.colour == "quantised"
    assert found.sd == pytest.approx(noise.std(), rel=0.1)
    means = noise[:, : noise.shape[1] // BIN * BIN].reshape(-1, BIN).mean(axis=1)
    assert 0.95 * means.std() <= found.mean_sd(BIN) <= 1.3 * means.std()


@pytest.mark.parametrize("period", SAMPLES)
def test_a_rate_from_differences_averages_out_faster(period: float) -> None:
    parts, noise = records(lambda x, r: x + np.diff(r.normal(0, 0.2, len(x) + 1)), period)
    found = noise_of(parts)
    assert found.colour == "differentiated"
    check(found, noise)


@pytest.mark.parametrize("period", [0.01, 0.005])
def test_a_rate_from_counts_is_such_a_rate(period: float) -> None:
    count = 0.3 * period
    parts, noise = records(
        lambda x, r: np.diff(np.round(r.uniform() + np.append(0, np.cumsum(x * period)) / count) * count) / period,
        period,
    )
    found = noise_of(parts)
    assert found.colour == "differentiated"
    check(found, noise)


@pytest.mark.parametrize("period", [0.005, 0.001])
@pytest.mark.parametrize("kept", [0.5, 0.7])
def test_filtered_noise_averages_out_more_slowly(kept: float, period: float) -> None:
    def noisy(true: Array, random: np.random.Generator) -> Array:
        drawn = random.normal(0, 0.3 * np.sqrt(1 - kept**2), len(true) + 300)
        return true + lfilter([1.0], [1.0, -kept], drawn)[300:]

    parts, noise = records(noisy, period)
    found = noise_of(parts)
    assert found.colour == "filtered"
    assert found.correlation == pytest.approx(kept, abs=0.15)
    check(found, noise, sd=0.2, mean=0.3)


def test_held_rows_hide_noise_unless_each_sample_counts_once() -> None:
    parts, noise = records(lambda x, r: x + r.normal(0, 0.1, len(x)), 0.005)
    once = [np.where(np.arange(len(part)) % 4 == 0, part, np.nan) for part in parts]
    held = [np.repeat(part[::4], 4) for part in parts]
    assert noise_of(once).sd == pytest.approx(noise.std(), rel=0.15)
    assert noise_of(held).sd != pytest.approx(noise.std(), rel=0.5)


def test_a_signal_without_noise_or_with_few_samples_has_none_to_speak_of() -> None:
    assert noise_of([np.zeros(100)]) == Noise(0.0)
    assert noise_of([np.arange(4.0)]) == Noise(0.0)
    assert noise_of([motion(3000, 0.001)]).sd < 1e-4


@pytest.mark.parametrize(("step", "found"), [(0.25, 0.25), (0.0, 0.0)])
def test_a_step_is_found_where_values_are_whole_numbers_of_it(step: float, found: float) -> None:
    values = motion(3000, 0.001)
    assert step_of([np.round(values / step) * step if step else values]) == pytest.approx(found)


def ticks(rate: float, step: float, zero: float = 0.0) -> np.ndarray:
    """Returns readings, rad, every 10 ms, of a counter with steps of `step` rad, on a wheel that turns to and fro.

    The wheel's speed is proportional to `rate`, rad/s.
    """
    time = np.arange(0.0, 4.0, 0.01)
    return np.floor(rate * (1 - np.cos(np.pi * time / 2)) * time / step) * step + zero


@pytest.mark.parametrize("rate", [2.0, 40.0])
def test_the_step_of_a_counter_is_found_although_no_value_comes_twice(rate: float) -> None:
    """At a rate of 40 rad/s, the counter counts many steps per sample: hardly any two values are one step apart."""
    step = 2 * np.pi / 960
    assert step_of([ticks(rate, step), ticks(0.7 * rate, step, zero=0.002)]) == pytest.approx(step, rel=1e-3)
    written = [np.round(ticks(rate, step), 4), np.round(ticks(0.7 * rate, step), 4)]
    assert step_of(written) == pytest.approx(step, rel=5e-3)


def test_the_step_of_a_converter_is_found_below_its_noise_but_not_that_of_the_text() -> None:
    random = np.random.default_rng(2)
    values = motion(3000, 0.001) + random.normal(0.0, 0.05, 3000)
    assert step_of([np.round(values / 0.01) * 0.01]) == pytest.approx(0.01, rel=1e-3)
    assert step_of([np.round(values, 5)]) == 0.0
    assert step_of([values.astype(np.float32).astype(float)]) == 0.0


def test_a_part_that_is_held_out_of_a_run_makes_no_noise():
    angle = np.cumsum(np.full(1200, 0.05)) // 0.0065 * 0.0065
    whole, part = (
        noise_of([angle]),
        noise_of([np.where((np.arange(1200) > 600) & (np.arange(1200) < 800), np.nan, angle)]),
    )
    assert part.sd == pytest.approx(whole.sd, rel=0.05)
