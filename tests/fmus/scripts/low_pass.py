"""A slave of somebody else, plain pythonfmu; run as a script, it builds its own FMU with pythonfmu's builder."""

import sys
from pathlib import Path
from typing import Any

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String
from pythonfmu.builder import FmuBuilder
from pythonfmu.default_experiment import DefaultExperiment


class LowPass(Fmi2Slave):  # type: ignore[misc]
    """A first-order lag of its input, with a variable of each type."""

    default_experiment = DefaultExperiment(start_time=1.0, stop_time=3.0, step_size=0.1)

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.u, self.y, self.tau, self.inverted, self.steps, self.label = 0.5, 0.0, 0.3, False, 0, "low pass"
        self.stop: float | None = None
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))
        tunable = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        self.register_variable(Real("tau", **tunable))
        self.register_variable(Boolean("inverted", **tunable))
        self.register_variable(String("label", **tunable))
        self.register_variable(Integer("steps", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))

    def setup_experiment(
        self, start_time: float, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        self.stop = stop_time

    def do_step(self, current_time: float, step_size: float) -> bool:
        if self.stop is not None and current_time + step_size > self.stop + 1e-9:
            raise ValueError("past the stop time")
        target = -self.u if self.inverted else self.u
        self.y += (target - self.y) * min(1.0, step_size / self.tau)
        self.steps += 1
        return True


if __name__ == "__main__":
    print(FmuBuilder.build_FMU(Path(__file__), dest=sys.argv[1], canGetAndSetFMUstate=True, canSerializeFMUstate=True))
