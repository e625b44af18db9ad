"""The peer mujoco.sysid: each driven side as a joint with damping, dry friction and a motor, fitted by simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np
from brickpilot.data.dataset import Dataset
from brickpilot.data.holdout import Roles
from numpy.typing import NDArray

from lab.peers.grid import on_grid, steps_for
from lab.peers.wheels import Drive, simulated_by_side
from lab.real_score import Predictions

Array = NDArray[np.float64]

_XML = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast" gravity="0 0 0"><flag contact="disable"/></option>
  <worldbody><body name="rotor"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="turn" type="hinge" axis="0 0 1" damping="1" frictionloss="0.01"/></body></worldbody>
  <actuator><motor name="drive" joint="turn" gear="1"/></actuator>
  <sensor><jointvel name="speed" joint="turn"/></sensor>
</mujoco>
"""

_START = {"gain": 5.0, "damping": 5.0, "friction": 1.0}
_BOUNDS = {"gain": (1e-3, 1e3), "damping": (1e-3, 1e3), "friction": (1e-6, 1e2)}


def fit(dataset: Dataset, roles: Roles) -> Predictions:
    """Returns the free runs. Voltages and speeds are scaled by their sd; the joint's inertia is 1 kg m^2."""
    steps = steps_for(dataset)
    return simulated_by_side(on_grid(dataset, steps[min(1, len(steps) - 1)]), roles.fit(), _fitted)


def _fitted(drives: Sequence[Drive]) -> Callable[[Drive], Array]:
    sysid = _sysid()

    volts = float(np.concatenate([drive.volts for drive in drives]).std()) or 1.0
    speed = float(np.concatenate([drive.speed for drive in drives]).std()) or 1.0
    scaled = [Drive(drive.step, drive.volts / volts, drive.speed / speed) for drive in drives]
    parameters = sysid.ParameterDict()
    for name, start in _START.items():
        parameters.add(sysid.Parameter(name, start, *_BOUNDS[name], modifier=_modifier(name)))
    spec = _spec(drives[0].step)
    model = spec.compile()
    measured = [_series(model, drive) for drive in scaled]
    sequences = sysid.ModelSequences(
        "side", spec, [str(number) for number in range(len(scaled))], [_start(model, drive) for drive in scaled],
        [control for control, _ in measured], [sensor for _, sensor in measured],
    )  # fmt: skip
    with redirect_stdout(StringIO()):  # the optimiser prints its iterations
        found, _ = sysid.optimize(
            initial_params=parameters, residual_fn=sysid.build_residual_fn(models_sequences=[sequences]),
            optimizer="mujoco", verbose=False,
        )  # fmt: skip
    values = {name: float(found[name].value[0]) for name in _START}

    def simulate(drive: Drive) -> Array:
        return speed * _free_run(Drive(drive.step, drive.volts / volts, drive.speed / speed), values)

    return simulate


def _modifier(name: str) -> Callable[[Any, Any], None]:
    """Returns the function that writes a parameter into the joint or the motor of a specification."""

    def write(spec: Any, parameter: Any) -> None:
        value = float(parameter.value[0])
        if name == "gain":
            spec.actuator("drive").gear = [value, 0, 0, 0, 0, 0]
        elif name == "damping":
            joint = spec.joint("turn")
            joint.damping = value if np.ndim(joint.damping) == 0 else np.array([[value], [0.0], [0.0]])
        else:
            spec.joint("turn").frictionloss = value

    return write


def _mujoco() -> Any:
    """Returns the package as Any, because its type stubs lack most of its names."""
    import mujoco

    return mujoco


def _sysid() -> Any:
    from mujoco import sysid

    return sysid


def _spec(step: float) -> Any:
    return _mujoco().MjSpec.from_string(_XML.format(step=step))


def _series(model: Any, drive: Drive) -> tuple[Any, Any]:
    sysid = _sysid()

    time = drive.step * np.arange(len(drive.volts))
    return sysid.TimeSeries(time, drive.volts[:, np.newaxis]), sysid.TimeSeries.from_names(
        time[1:], drive.speed[1:, np.newaxis], model
    )


def _start(model: Any, drive: Drive) -> Array:
    sysid = _sysid()

    found: Array = sysid.create_initial_state(model, np.zeros(1), drive.speed[:1], np.zeros(0))
    return found


def _free_run(drive: Drive, values: dict[str, float]) -> Array:
    from mujoco import rollout

    spec = _spec(drive.step)
    for name, value in values.items():
        _modifier(name)(spec, _Value(value))
    model = spec.compile()
    data = _mujoco().MjData(model)
    _, sensors = rollout.rollout(model, data, _start(model, drive), drive.volts[:-1, np.newaxis])
    return np.concatenate([drive.speed[:1], np.asarray(sensors)[0, :, 0]])


class _Value:
    """A parameter with one value, in the form that a modifier reads."""

    def __init__(self, value: float) -> None:
        self.value = [value]
