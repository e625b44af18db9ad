"""A small blind test: the right verdict on eight data sets made by MuJoCo. `tests/lab/run discover` runs the rest.

Nominal values are 2 % off, noise is white, converters have 10 bits. The plant that explains the data did not make them.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from brickpilot.data import reading
from brickpilot.discover import pipeline
from brickpilot.discover.finding import NOMINAL_VALUES, Finding, verdict_json
from hidden import folder, suites

pytest.importorskip("mujoco")

TOLERANCE = 0.05
"""Largest error, as a share of a parameter's true value."""
TOLERANCE_OF = {"gyro_scale": 0.07}
"""The same for an effect that other values can imitate: half track and yaw inertia, 2 % off, imitate a gyro's scale."""
FLOOR = 1.1
"""Largest error that may be left on held-out runs, as a multiple of the noise."""
COMPOSED = 0.8
"""Share of the held-out gap that a composed term has to remove."""

NONE = ("ci-none-enc", "ci-none-imu")
NAMED = ("ci-coulomb_friction-enc", "ci-motor_asymmetry-enc", "ci-gyro_bias-imu", "ci-coulomb_friction+gyro_scale-enc")
TWINS = {"ci-input_delay-enc": {"input_delay", "sensor_delay"}}
"""From rest, a delay before the motors gives the same log as a delay behind every sensor."""
OUTSIDE = {"ci-odd_yaw_by_speed-enc": ("yaw_push_u2", "odd_yaw_by_speed", "moment")}
"""Effects outside the library: set -> the composed term's only parameter, the true effect and its parameter."""


class Blind:
    """The suite in `folder`; `discover` runs once on each data set."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names = {path.name for path in folder.iterdir() if path.is_dir()}
        self._found: dict[str, Finding] = {}

    def find(self, name: str) -> Finding:
        if name not in self._found:
            self._found[name] = pipeline.discover(reading.read(self.folder / name))
        return self._found[name]

    def hidden(self, name: str) -> dict[str, dict[str, float]]:
        """Returns effect -> its true parameters."""
        truth: dict[str, Any] = json.loads((self.folder / f"{name}.truth.json").read_text())
        hidden: dict[str, dict[str, float]] = truth["recipe"]["hidden"]
        return hidden


@pytest.fixture(scope="session")
def blind(tmp_path_factory: pytest.TempPathFactory) -> Blind:
    out = tmp_path_factory.mktemp("hidden")
    for recipe in suites.ci(seed_offset=0):
        folder.write(recipe, out)
    return Blind(out)


def test_every_set_of_the_suite_is_judged_here(blind: Blind) -> None:
    assert {*NONE, *NAMED, *TWINS, *OUTSIDE} == blind.names


def left_on_held_out_runs(finding: Finding) -> float:
    left = finding.gap["held_out"].after
    assert left is not None, "no run was held out"
    return left


@pytest.mark.parametrize("name", NONE)
def test_where_nothing_is_hidden_nothing_is_found(name: str, blind: Blind) -> None:
    found = blind.find(name)
    assert (found.verdict, found.effects, found.term, found.next_experiment) == ("none", (), None, None)
    assert found.augmented.effects == {}
    assert not any(change.leaves_prior for change in found.nominal.values())
    assert left_on_held_out_runs(found) <= FLOOR


@pytest.mark.parametrize("name", NAMED)
def test_what_is_hidden_is_named_with_its_size(name: str, blind: Blind) -> None:
    found, hidden = blind.find(name), blind.hidden(name)
    assert found.verdict == "named"
    assert {effect.name for effect in found.effects} == hidden.keys()
    for effect in found.effects:
        assert {one: value.value for one, value in effect.parameters.items()} == pytest.approx(
            hidden[effect.name], rel=TOLERANCE_OF.get(effect.name, TOLERANCE)
        )
        for one in effect.parameters.values():
            assert one.ci95 is not None
            assert one.ci95[0] < one.value < one.ci95[1]
            assert one.ci95[0] > 0 or one.ci95[1] < 0
    assert found.term is None
    assert left_on_held_out_runs(found) <= FLOOR
    assert found.gap["held_out"].before is not None
    assert found.gap["held_out"].before > 2 * FLOOR


@pytest.mark.parametrize("name", TWINS)
def test_twins_are_called_ambiguous_with_the_true_one_among_them(name: str, blind: Blind) -> None:
    found, hidden = blind.find(name), blind.hidden(name)
    assert found.verdict == "ambiguous"
    best = found.effects[0]
    told = {best.name: best.parameters} | {other.name: other.parameters for other in best.equivalents}
    assert told.keys() == TWINS[name] > hidden.keys()
    for effect, parameters in hidden.items():
        assert {one: told[effect][one].value for one in parameters} == pytest.approx(parameters, rel=TOLERANCE)
    assert found.next_experiment is not None
    assert set(found.next_experiment.separates) == TWINS[name]
    assert found.next_experiment.advice
    written = verdict_json(found)
    assert set(written["spread"]["parameters"]) >= {"mass", f"{best.name}.delay"} | set(found.nominal)
    for rival in written["effects"][0]["equivalents"]:
        if rival["name"] != NOMINAL_VALUES:
            assert set(rival["effects"]) >= set(rival["name"].split(" + "))
        assert rival["nominal"]["mass"] > 0
    assert found.nominal_findings == ()  # motor constants that imitate the delay are no finding
    assert left_on_held_out_runs(found) <= FLOOR


@pytest.mark.parametrize("name", OUTSIDE)
def test_what_has_no_name_is_unknown_and_gets_the_right_term(name: str, blind: Blind) -> None:
    found, hidden = blind.find(name), blind.hidden(name)
    parameter, oddity, size = OUTSIDE[name]
    assert found.verdict == "unknown"
    assert not any(one.claimed for one in found.effects)
    assert found.term is not None
    assert found.term.removed_held_out >= COMPOSED
    assert found.augmented.effects.keys() == {"composed_term"}
    assert found.augmented.effects["composed_term"][parameter] == pytest.approx(hidden[oddity][size], rel=TOLERANCE)
    assert left_on_held_out_runs(found) <= FLOOR
