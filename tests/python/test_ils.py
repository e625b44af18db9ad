"""The ILS of a signal is the integral of its squared error (eq. 20)."""

from __future__ import annotations

import numpy as np
import pytest
from brickpilot.data.agreement import signal_error


def test_ils_is_the_trapezoidal_integral_on_irregular_times():
    time = np.array([0.0, 0.1, 0.4, 1.0])
    error = signal_error(time, np.array([1.0, 3.0, 2.0, 2.0]), np.array([1.0, 1.0, 1.0, 1.0]))
    assert error.ils == pytest.approx(0.1 * (0 + 4) / 2 + 0.3 * (4 + 1) / 2 + 0.6 * (1 + 1) / 2)
    assert error.energy == pytest.approx(1.0)
    assert error.rms_signal == pytest.approx(1.0)
    assert error.ils_normalised == pytest.approx(error.ils)


def test_blank_measurements_leave_their_intervals_out():
    time = np.arange(5.0)
    measured = np.array([1.0, 1.0, np.nan, 1.0, 1.0])
    error = signal_error(time, np.array([1.0, 1.0, 50.0, 2.0, 2.0]), measured)
    assert error.seconds == 2.0
    assert error.ils == pytest.approx(1.0)


def test_a_signal_without_energy_has_no_share():
    assert signal_error(np.arange(3.0), np.ones(3), np.zeros(3)).share is None
