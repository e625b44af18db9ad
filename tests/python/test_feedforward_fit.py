"""The feedforward peer for real logs finds the parameters of its own law, and scores a prediction by fit percent."""

import numpy as np
import pytest
from brickpilot.data import reading
from lab.peers.feedforward import fit_feedforward, fit_percent


def test_fit_percent_is_100_for_the_measurement_and_0_for_its_mean() -> None:
    measured = np.array([1.0, 2.0, 4.0, np.nan])
    assert fit_percent(measured, measured) == 100
    assert fit_percent(measured, np.full(4, 7 / 3)) == pytest.approx(0)
    assert np.isnan(fit_percent(np.ones(3), np.ones(3)))


def test_a_motor_gives_back_its_friction_its_constants_and_the_delay_of_its_speed(
    tmp_path,
) -> None:
    """Euler's method simulates the motor, without code of the fit. The speed is logged 40 ms late."""
    static, per_speed, inertia, late, step = 0.8, 0.5, 0.2, 40, 1e-3
    time = np.arange(0, 3, step)
    for number, volts in enumerate((4.0, -3.0, 6.0)):
        command = np.where(time > 0.5, volts, 0.0) * np.where(time > 2, -0.7, 1.0)
        speed, angle = np.zeros_like(time), np.zeros_like(time)
        for k in range(len(time) - 1):
            drive = np.sign(speed[k]) * static if speed[k] else np.clip(command[k], -static, static)
            speed[k + 1] = speed[k] + step / inertia * (command[k] - drive - per_speed * speed[k])
            angle[k + 1] = angle[k] + step * speed[k]
        logged = np.concatenate([np.zeros(late), speed[:-late]])
        table = np.column_stack([time, command, logged, angle])[::5]
        np.savetxt(
            tmp_path / f"{number}.csv",
            table,
            delimiter=",",
            header="t,u,w,a",
            comments="",
        )
    (tmp_path / "dataset.toml").write_text(
        'name = "m"\nvehicle = "motor"\ncsv = { delimiter = ",", header = true }\n[signals]\n'
        'time = { column = "t", unit = "s" }\nvoltage = { column = "u", unit = "V" }\n'
        'speed = { column = "w", unit = "rad/s" }\nangle = { column = "a", unit = "rad" }\n[nominal]\n'
        + "".join(f'[[runs]]\nname = "{k}"\nfile = "{k}.csv"\n' for k in range(3))
    )
    data = reading.read(tmp_path)
    found = fit_feedforward(data, {"0": "fit", "1": "fit", "2": "held_out"})
    assert found.parameters["kS"] == pytest.approx(static, rel=0.05)
    assert found.parameters["kV"] == pytest.approx(per_speed, rel=0.02)
    assert found.parameters["kA"] == pytest.approx(inertia, rel=0.05)
    later = found.parameters["delay of speed"] - found.parameters["delay of angle"]
    assert later == pytest.approx(late * step, abs=0.005)
    held_out = data.runs[2]
    assert fit_percent(held_out.outputs["speed"], found.predictions["2"]["speed"]) > 97
