"""Which equation of the nominal model needs a disturbance, and against what it varies: a stage of its own.

It decides nothing. It tells a reader where to look: prediction with process noise keeps track where a free run drifts.
"""

from __future__ import annotations

from brickpilot.discover import gates
from brickpilot.discover.finding import Finding
from brickpilot.discover.prepare import Prepared
from brickpilot.errors import InputError, SimulationError
from brickpilot.fit.deficient import Deficient, deficient_equations
from brickpilot.fit.innovations import Innovations


def find_equations(prepared: Prepared, finding: Finding) -> tuple[Deficient, ...]:
    """Returns the equations and sensors of the nominal model that need a disturbance, the most deficient first.

    Empty where nothing is missing, and where the fit runs cannot be predicted. A disturbance as small as the error that
    every model has is not reported.
    """
    if finding.verdict == "none":
        return ()
    model = finding.nominal_model
    try:
        problem = Innovations(prepared.measured, model, prepared.roles.fit(), step_s=gates.BIN_S, threads=prepared.jobs)
        return deficient_equations(problem, model, gates.MODEL_ERROR_SHARE)
    except (InputError, SimulationError):
        return ()
