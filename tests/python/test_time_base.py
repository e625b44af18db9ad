"""Channels with different times get common rows: outputs only where they were measured, inputs held."""

from __future__ import annotations

import numpy as np
import pytest
from brickpilot.errors import InputError
from brickpilot.importers.channels import Channel, in_order
from brickpilot.importers.chosen import aligned, columns


def channel(time: object, values: object) -> Channel:
    return Channel("c", "double", np.asarray(time, dtype=float), np.asarray(values, dtype=float))


FAST = channel(np.arange(100) * 0.01, np.arange(100.0))
SLOW = channel(np.arange(20) * 0.05 + 0.002, 10.0 * np.arange(20))


def test_the_fastest_output_gives_the_rows_and_others_are_blank_between() -> None:
    made, notes = columns({"voltage": channel([0], [6]), "speed": FAST, "current": SLOW}, None)
    np.testing.assert_array_equal(made["time"], FAST.time)
    np.testing.assert_array_equal(made["speed"], FAST.values)
    there = np.flatnonzero(~np.isnan(made["current"]))
    np.testing.assert_array_equal(there, 5 * np.arange(20))
    np.testing.assert_array_equal(made["current"][there], SLOW.values)
    assert notes == ["current is up to 2 ms from the time of its row; --rate gives finer rows"]


def test_a_rate_makes_rows_of_its_own() -> None:
    made, notes = columns({"voltage": channel([0], [6]), "speed": FAST, "current": SLOW}, 500.0)
    np.testing.assert_allclose(np.diff(made["time"]), 0.002)
    assert np.count_nonzero(~np.isnan(made["speed"])) == 100
    np.testing.assert_array_equal(np.flatnonzero(~np.isnan(made["current"])), 1 + 25 * np.arange(20))
    assert notes == []
    made, _ = columns({"voltage": channel([0], [6]), "speed": FAST}, 20.0)
    np.testing.assert_array_equal(made["speed"], np.arange(0.0, 100.0, 5.0))


def test_an_input_holds_until_it_changes_and_a_change_between_rows_has_a_row() -> None:
    changes = channel([0.0, 0.05, 0.104, 0.307, 0.31], [1.0, 1.0, 2.0, 3.0, 3.0])
    other = channel([0.0, 0.10401, 0.32], [5.0, 6.0, 7.0])
    made, notes = columns({"duty_left": changes, "duty_right": other, "yaw_rate": FAST}, None)
    added = np.setdiff1d(made["time"], FAST.time)
    np.testing.assert_array_equal(added, [0.104, 0.307])  # duty_right changes 0.01 ms later: no extra row
    assert np.isnan(made["yaw_rate"][np.isin(made["time"], added)]).all()
    np.testing.assert_array_equal(made["yaw_rate"][~np.isin(made["time"], added)], FAST.values)
    time = made["time"]
    np.testing.assert_array_equal(made["duty_left"], np.where(time < 0.104, 1.0, np.where(time < 0.307, 2.0, 3.0)))
    np.testing.assert_array_equal(made["duty_right"], np.where(time < 0.104, 5.0, np.where(time < 0.319, 6.0, 7.0)))
    assert notes == ["2 rows are added where an input changes between two rows"]


def test_an_input_changes_in_the_nearest_row_of_a_rate() -> None:
    changes = channel([0.0, 0.102, 0.307, 0.309], [1.0, 2.0, 3.0, 4.0])
    made, notes = columns({"voltage": changes, "speed": FAST}, 100.0)
    np.testing.assert_array_equal(made["voltage"][:10], 1.0)
    np.testing.assert_array_equal(made["voltage"][10:31], 2.0)
    np.testing.assert_array_equal(made["voltage"][31:], 4.0)  # the last of two changes in one row
    assert notes == []


def test_rows_begin_where_all_inputs_are_known() -> None:
    inputs = {"duty_left": channel([0.2], [1]), "duty_right": channel([0.3], [1])}
    made, _ = columns({**inputs, "yaw_rate": FAST}, None)
    assert made["time"][0] == pytest.approx(0.3)
    with pytest.raises(InputError, match="share fewer than two rows"):
        columns({"voltage": channel([5.0], [1]), "speed": FAST}, None)
    with pytest.raises(InputError, match="no output is mapped"):
        columns({"voltage": channel([5.0], [1])}, None)
    with pytest.raises(InputError, match="--rate: would make more than"):
        columns({"voltage": channel([0.0], [1]), "speed": FAST}, 1e9)


def test_a_sample_in_a_pause_of_the_rows_is_in_none_of_them() -> None:
    paused = channel([0, 0.01, 0.02, 0.5, 0.51, 0.52], range(6))
    made, _ = columns(
        {"voltage": channel([0], [1]), "speed": paused, "current": channel([0.01, 0.2, 0.5], [7, 8, 9])}, None
    )
    np.testing.assert_array_equal(made["current"], [np.nan, 7, np.nan, 9, np.nan, np.nan])


def test_times_that_repeat_or_go_back_are_put_in_order() -> None:
    time, values = in_order(np.array([0.2, 0.1, 0.1, 0.3]), np.array([2.0, 0.0, 1.0, 3.0]))
    np.testing.assert_array_equal(time, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(values, [1.0, 2.0, 3.0])


def test_channels_of_a_formula_are_held_for_inputs_and_placed_for_outputs() -> None:
    rows, (fast, slow), shift = aligned([FAST, SLOW], held=True)
    np.testing.assert_array_equal(rows, FAST.time)
    np.testing.assert_array_equal(slow[:10], np.repeat([0.0, 10.0], 5))
    assert shift == 0.0
    rows, (fast, slow), shift = aligned([FAST, SLOW], held=False)
    np.testing.assert_array_equal(fast, FAST.values)
    assert np.count_nonzero(~np.isnan(slow)) == 20
    assert shift == pytest.approx(0.002)
