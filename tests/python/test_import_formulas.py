"""Formulas of `--map`: a linear formula becomes scale and offset, others are computed, and faulty ones are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from brickpilot.data.dataset import motor_inputs
from brickpilot.data.reading import read
from brickpilot.errors import InputError
from brickpilot.importers.mapping import FormulaError, Scaling, parse_formula, parse_mapping
from importing import import_matlab, import_table
from scipy.io import savemat

NAMES = ["millis", "pwmL", "pwmR", "v left [V]", "/drive/left", "/drive/left/speed", "a-b", "a", "b", "q"]


@pytest.mark.parametrize(
    ("text", "place", "scale", "offset"),
    [
        ("pwmL", "pwmL", 1, 0),
        ("pwmL*1/255", "pwmL", 1 / 255, 0),
        ("1 - pwmL/2", "pwmL", -0.5, 1),
        ("-(2*(pwmL - 3) + pwmL)", "pwmL", -3, 6),
        ("v left [V]*2", "v left [V]", 2, 0),
        ("/drive/left/2", "/drive/left", 0.5, 0),
        ("/drive/left/speed/2", "/drive/left/speed", 0.5, 0),
        ("a-b*2", "a-b", 2, 0),
        ("pwmL.5", "pwmL.5", 1, 0),
    ],
)
def test_a_straight_line_has_a_scale_and_an_offset(text: str, place: str, scale: float, offset: float) -> None:
    formula = parse_formula(text, [*NAMES, "pwmL.5"])
    assert formula.places == (place,)
    assert formula.scaling == Scaling(pytest.approx(scale), pytest.approx(offset))


def test_an_index_names_a_column_of_a_matrix() -> None:
    formula = parse_formula("(q[0] + q[1]) / 2", NAMES)
    assert formula.places == ("q[0]", "q[1]")
    np.testing.assert_array_equal(formula.values({"q[0]": np.ones(2), "q[1]": np.arange(2.0)}), [0.5, 1])


def test_other_formulas_are_computed_and_keep_blanks() -> None:
    formula = parse_formula("(a - b) / a", NAMES)
    assert formula.scaling is None
    columns = {"a": np.array([2.0, np.nan, 4.0]), "b": np.array([1.0, 1.0, 4.0])}
    np.testing.assert_array_equal(formula.values(columns), [0.5, np.nan, 0.0])
    with pytest.raises(FormulaError, match=r"no number in 1 rows: it divides by 0"):
        formula.values({"a": np.array([0.0, 1.0]), "b": np.ones(2)})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("pwmL^2", "'^' at character 5"),
        ("pwmL**2", "wrong near '*2'"),
        ("pwmL//2", "wrong near '/2'"),
        ("pwmL*", "ends too early"),
        ("(pwmL", "wrong near '(pwmL'"),
        ("2pwmL", "wrong near 'pwmL'"),
        ("pwmL/(2-2)", "divides by 0"),
        ("pwmL - pwmL", "does not depend on any column"),
        ("3", "names no column"),
        ("1e999*pwmL", "too large"),
        ("pwmL + 1/(1e300*1e300)", "too large"),
        ("__import__('os')", '"\'" at character 12'),
        ("a(b)", "names of columns, numbers"),
        ("(" * 400 + "a" + ")" * 400, "longer than 300"),
        ("(" * 149 + "a" + ")" * 149, None),
    ],
)
def test_a_bad_formula_is_named_by_its_character(text: str, says: str | None) -> None:
    if says is None:
        parse_formula(text, NAMES)
        return
    with pytest.raises(FormulaError) as caught:
        parse_formula(text, NAMES)
    assert says in str(caught.value)


def test_a_unit_stands_behind_the_last_colon() -> None:
    sources = parse_mapping(["time=NT:/t:ms", "yaw_rate=NT:/imu/rate", "wheel_angle_left=encL*1/960:rotation"])
    assert [(one.text, one.unit) for one in sources.values()] == [
        ("NT:/t", "ms"), ("NT:/imu/rate", "rad/s"), ("encL*1/960", "rotation"),
    ]  # fmt: skip


def test_a_table_keeps_its_counts_and_states_their_scale(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("millis,pwm,enc\n0,255,0\n20,-51,240\n40,0,480\n")
    mapping = ["time=millis:ms", "duty=pwm*1/255", "angle=enc*1/960:rotation"]
    import_table([tmp_path / "a.csv"], tmp_path / "set", mapping, vehicle="motor", header=True)
    dataset = read(tmp_path / "set")
    np.testing.assert_allclose(motor_inputs(dataset.runs[0], dataset)[:, 0], [9.0, -1.8, 0.0])
    np.testing.assert_allclose(dataset.runs[0].outputs["angle"], np.array([0.0, 0.25, 0.5]) * 2 * np.pi)
    assert dataset.signals["angle"].scale == 1 / 960
    assert np.loadtxt(tmp_path / "set/a.csv", delimiter=",", skiprows=1)[:, 2].tolist() == [0, 240, 480]


def test_a_column_that_a_table_lacks_is_named_with_the_one_that_was_meant(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("millis,pwm,enc\n0,255,0\n20,-51,240\n")
    with pytest.raises(InputError, match=r"a\.csv:1: angle: no column 'encl' among .*; did you mean 'enc'\?"):
        import_table(
            [tmp_path / "a.csv"], tmp_path / "set", ["time=millis", "duty=pwm", "angle=encl/2"], vehicle="motor",
            header=True,
        )  # fmt: skip
    assert not (tmp_path / "set").exists()


def test_an_unknown_signal_is_named_with_the_one_that_was_meant() -> None:
    with pytest.raises(InputError, match=r"--map duty_lefft=x: unknown signal; did you mean duty_left\?"):
        parse_mapping(["duty_lefft=x"])


def test_matlab_variables_take_formulas_too(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"t": np.arange(3.0), "log": {"q": np.ones((3, 2)), "u": np.arange(3.0)}})
    mapping = ["time=t", "voltage=log.u*2+1", "position=(log.q[0]+log.q[1])/2"]
    run = read(import_matlab([tmp_path / "a.mat"], tmp_path / "set", mapping, vehicle="motor").folder).runs[0]
    np.testing.assert_array_equal(run.inputs["voltage"], [1, 3, 5])
    np.testing.assert_array_equal(run.outputs["position"], 1)
