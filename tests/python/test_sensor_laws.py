"""Sensor errors of the blind tests, with laws that are not in the library, equal closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import hold
from hidden import planar_engine, sensor_laws
from hidden.by_run import place
from hidden.recipe import BENCH, Track


def straight_and_turn() -> list[Track]:
    return planar_engine.simulate(BENCH, {}, [hold(6, 2, 2.0), hold(3, -3, 2.0)], 0, texture=0.0)


def test_sensors_err_by_laws_of_their_own() -> None:
    tracks = straight_and_turn()
    first, second = tracks

    def read(number: int, **hidden: dict[str, float]) -> sensor_laws.Readings:
        return sensor_laws.read(tracks[number], hidden, 2.0 * number, number)

    cross = read(0, accel_cross_axis={"share": 0.2})
    np.testing.assert_allclose(cross.surge, first.accel_surge + 0.2 * first.accel_sway)
    np.testing.assert_array_equal(cross.sway, first.accel_sway)
    fading = read(1, accel_bias_fading={"surge": 0.3, "sway": 0.1, "time_constant": 4.0})
    np.testing.assert_allclose(fading.surge - second.accel_surge, 0.3 * np.exp(-(2.0 + second.time) / 4.0))
    bent = read(0, gyro_scale_bent={"error": 0.02, "cubic": 0.01})
    np.testing.assert_allclose(bent.rate, 1.02 * first.yaw_rate + 0.01 * first.yaw_rate**3)
    curved = read(0, gyro_curved_one_way={"cubic": 0.01})
    np.testing.assert_allclose(curved.rate, first.yaw_rate + 0.01 * np.maximum(first.yaw_rate, 0) ** 3)
    by_run = read(1, gyro_bias_by_run={"bias": 0.1, "spread": 0.5})
    np.testing.assert_allclose(by_run.rate - second.yaw_rate, 0.1 * (1 + 0.5 * place(1)))
    warm = read(1, gyro_warming_up={"bias": 0.1, "time_constant": 5.0})
    np.testing.assert_allclose(warm.rate - second.yaw_rate, 0.1 * (1 - np.exp(-(2.0 + second.time) / 5.0)))
    soft = read(0, gyro_soft_limit={"limit": 2.0})
    np.testing.assert_allclose(soft.rate, 2 * np.tanh(first.yaw_rate / 2))
    one = read(0, encoder_one_side={"error": 0.05})
    np.testing.assert_allclose(one.left, 1.05 * first.wheel_speed_left)
    np.testing.assert_array_equal(one.right, first.wheel_speed_right)
    command = np.where(first.time < 1.0, -1.0, 0.0)
    told = replace(first, command_left=command, command_right=-command)
    signed = sensor_laws.read(told, {"speed_signed_by_command": {"share": 1.0}}, 0.0, 0)
    np.testing.assert_allclose(signed.left, -np.abs(first.wheel_speed_left))  # after the command, the sign stays
    np.testing.assert_allclose(signed.right, np.abs(first.wheel_speed_right))
    counted = read(0, wheel_speed_counted={"window": 0.05})
    assert counted.left[700] == pytest.approx(first.wheel_speed_left[651:701].mean())
    np.testing.assert_array_equal(counted.rate, first.yaw_rate)
    smooth = read(0, gyro_smoothed={"time": 0.02}, wheel_speed_smoothed={"time": 0.02})
    for slow, fast in ((smooth.rate, first.yaw_rate), (smooth.left, first.wheel_speed_left)):
        assert np.sum(fast - slow) * 0.001 == pytest.approx(2 * math.sqrt(0.5) * 0.02 * fast[-1], rel=0.02)
    np.testing.assert_array_equal(smooth.surge, first.accel_surge)
    swing = read(0, encoder_eccentric={"share": 0.1})
    assert np.ptp(swing.left[1000:]) == pytest.approx(0.2 * first.wheel_speed_left[-1], rel=0.05)


def test_a_filter_of_order_two_has_its_dead_time_and_no_error_at_rest() -> None:
    first = straight_and_turn()[0]
    slow = sensor_laws.read(first, {"imu_second_order": {"time": 0.02}}, 0.0, 0)
    lost = np.sum(first.yaw_rate - slow.rate) * 0.001  # final rate times the filter's mean delay
    assert lost == pytest.approx(2 * math.sqrt(0.5) * 0.02 * first.yaw_rate[-1], rel=0.02)
    assert slow.rate[-1] == pytest.approx(first.yaw_rate[-1], rel=1e-3)
    mast = {"x": 0.03, "y": 0.02, "frequency": 8.0, "damping": 0.3}
    swung = sensor_laws.read(first, {"arm_on_mast": mast}, 0.0, 0)
    steady = -(first.yaw_rate[-1] ** 2)
    assert swung.surge[-1] - first.accel_surge[-1] == pytest.approx(0.03 * steady, rel=0.02)
    assert swung.sway[-1] - first.accel_sway[-1] == pytest.approx(0.02 * steady, rel=0.02)
