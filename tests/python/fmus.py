"""One interface to FMUs of FMI 2 and FMI 3, by FMPy."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray


class Unit:
    """One instance of an unpacked FMU."""

    def __init__(self, folder: Path, token: str | None = None) -> None:
        self.description = fmpy.read_model_description(str(folder))
        self.two = self.description.fmiVersion == "2.0"
        self.messages: list[str] = []
        self.references = {one.name: one.valueReference for one in self.description.modelVariables}
        self.outputs = [one.name for one in self.description.modelVariables if one.causality == "output"]
        kind = FMU2Slave if self.two else FMU3Slave
        self.unit: Any = kind(
            guid=token or self.description.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="unit",
        )
        self._instantiate()

    def _instantiate(self) -> None:
        if self.two:
            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = fmi2CallbackLoggerTYPE(lambda *said: self.messages.append(said[-1].decode()))
            self.unit.instantiate(callbacks=self._callbacks)
        else:
            self.unit.instantiate(logMessage=lambda *said: self.messages.append(said[-1].decode()))

    def begin(self, values: Mapping[str, float] | None = None) -> None:
        self.set(values or {})
        if self.two:
            self.unit.setupExperiment(startTime=0.0)
            self.unit.enterInitializationMode()
        else:
            self.unit.enterInitializationMode(startTime=0.0)
        self.unit.exitInitializationMode()

    def set(self, values: Mapping[str, float | bool]) -> None:
        for name, value in values.items():
            if isinstance(value, bool):
                self.unit.setBoolean([self.references[name]], [value])
            elif self.two:
                self.unit.setReal([self.references[name]], [value])
            else:
                self.unit.setFloat64([self.references[name]], [value])

    def get(self, *names: str) -> list[float]:
        references = [self.references[name] for name in names]
        found: list[float] = self.unit.getReal(references) if self.two else self.unit.getFloat64(references)
        return found

    def step(self, time: float, size: float) -> None:
        self.unit.doStep(currentCommunicationPoint=time, communicationStepSize=size)

    def run(
        self, time: NDArray[np.float64], inputs: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.float64]]:
        """Simulates from the current state on; returns output -> (n,) values at `time` (n,), s.

        Args:
            inputs: input -> (n,) values; value k acts from time[k] to time[k + 1].
        """
        rows = [self.get(*self.outputs)]
        for k in range(len(time) - 1):
            self.set({name: float(values[k]) for name, values in inputs.items()})
            self.step(float(time[k]), float(time[k + 1] - time[k]))
            rows.append(self.get(*self.outputs))
        return dict(zip(self.outputs, np.array(rows).T, strict=True))

    def close(self) -> None:
        self.unit.terminate()
        self.unit.freeInstance()
