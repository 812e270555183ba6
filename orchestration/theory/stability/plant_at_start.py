"""One FMU for model exchange about its start: ẋ = A x + B u, y = C x + D u."""

from contextlib import closing, suppress
from dataclasses import dataclass, replace

import numpy as np

from orchestration.components.fmi.adapted import AdaptedInstance
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import Model, declared_of, read_model
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import some
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.request import RequestLike
from orchestration.simulation.runs.prepared import set_parameters
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.stability.linearise import in_isolation

STEP, STEP_OF_SINGLE = 6e-6, 5e-3
"""Change of a state or an input for a central difference, of its size or nominal value; of one in single precision"""
AGREE = 1e-3
"""Difference to it, of the largest of an unknown, up to which a directional derivative is believed: an FMU may have
none of outputs that are states, and say 0"""
AT_REST = 1e-6
"""Rate of a state at rest at most, as a share of its size or nominal value each second"""


@passable
@dataclass(frozen=True, kw_only=True)
class PlantAtStart:
    """Deviations of an FMU from its start, in continuous time, by the names and units of its variables."""

    name: str
    A: Floats
    """Rates of the states by the states."""
    B: Floats
    """Rates of the states by the inputs."""
    C: Floats
    """Outputs by the states."""
    D: Floats
    """Outputs by the inputs."""
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    operating_point: dict[str, float]
    """Values about which it is linear, by variable."""
    rates: dict[str, float]
    """Rates of the states there that are not 0, by state."""

    @property
    def verdict(self) -> str:
        """Its sizes, and whether it rests at its start."""
        counts = [(len(self.states), "state"), (len(self.inputs), "input"), (len(self.outputs), "output")]
        sizes = ", ".join(f"{count} {what}{'' if count == 1 else 's'}" for count, what in counts)
        moves = some(f"{name} by {rate:.4g} a second" for name, rate in self.rates.items())
        return f"{self.name} about its start, in continuous time: {sizes}; " + (
            f"it does not rest there: {moves}" if moves else "it rests there"
        )


def plant_at_start(request: RequestLike) -> PlantAtStart:
    """The matrices of one FMU about its start values and parameters.

    By central differences of its derivatives and outputs, and by its directional derivatives where they agree. Raises
    `UsageError` for an FMU that does not offer model exchange, which has no derivatives.
    """
    return in_isolation(request, _plant_at_start, None)


def _plant_at_start(request: Request, component: str | None) -> PlantAtStart:
    with errors_in_own_terms(request):
        ((name, stated),) = system_of(request).components.items()
        access = replace(stated.access, interface="model-exchange")
        model = read_model(stated.fmu)
        if "model-exchange" not in declared_of(model.description):
            raise UsageError(
                f"{stated.fmu}: nothing is sampled, and {model.name} has no derivatives to linearise: expected an FMU "
                f"for model exchange, or a system that samples it: quadcosim connect {stated.fmu} CONTROLLER.fmu --out "
                "SYSTEM.toml"
            )
        with closing(open_here(model.path, name, access)) as instance:
            assert isinstance(instance, AdaptedInstance)
            set_parameters(instance, stated)
            instance.enter_initialization(0.0, np.inf)
            instance.exit_initialization()
            return _about(instance)


def _about(instance: AdaptedInstance) -> PlantAtStart:
    model = instance.model
    rates, states = _rates_and_states(model)
    inputs = [name for name in model.names("input", kinds=("Real",)) if _is_continuous(model, name)]
    outputs = [name for name in model.names("output", kinds=("Real",)) if _is_continuous(model, name)]
    knowns, unknowns = [*states, *inputs], [*rates, *outputs]
    point, values = np.zeros(len(knowns)), np.zeros(len(unknowns))
    instance.reader(knowns, point)()
    instance.reader(unknowns, values)()
    start = point.copy()
    sizes = np.maximum(np.abs(start), [abs(model.variables[name].nominal or 1.0) for name in knowns])
    single = [model.variables[name].type == "Float32" for name in knowns]
    steps = np.where(single, STEP_OF_SINGLE, STEP) * sizes
    found = _differences(instance, unknowns, inputs, start, steps)
    with suppress(SimulatorError):  # differences are enough
        slopes = instance.slopes(unknowns, knowns) if found.size else None
        if slopes is not None:
            scale = np.abs(found).max(axis=1, keepdims=True)
            found = np.where(np.abs(slopes - found) <= AGREE * scale, slopes, found)
    n, moving = len(states), np.abs(values[: len(states)]) > AT_REST * sizes[: len(states)]
    return PlantAtStart(
        name=model.name, A=found[:n, :n], B=found[:n, n:], C=found[n:, :n], D=found[n:, n:],
        states=tuple(states), inputs=tuple(inputs), outputs=tuple(outputs),
        operating_point=dict(zip((*knowns, *outputs), (*start.tolist(), *values[n:].tolist()))),
        rates={name: rate for name, rate, moves in zip(states, values.tolist(), moving) if moves},
    )  # fmt: skip


def _differences(
    instance: AdaptedInstance, unknowns: list[str], inputs: list[str], start: Floats, steps: Floats
) -> Floats:
    """Central differences of the unknowns by states and inputs."""
    count = len(start) - len(inputs)
    into, given = np.zeros(len(unknowns)), start[count:].copy()
    read, write = instance.reader(unknowns, into), instance.writer(inputs, given)
    columns = []
    for i, step in enumerate(steps.tolist()):
        ends = []
        for change in (step, -step):
            point = start.copy()
            point[i] += change
            given[:] = point[count:]
            write()
            instance.set_states(point[:count])
            read()
            ends.append((into.copy(), point[i]))
        (high, above), (low, below) = ends
        columns.append((high - low) / (above - below))
    given[:] = start[count:]
    write()
    instance.set_states(start[:count])
    found: Floats = np.array(columns, dtype=np.float64).reshape(len(start), len(unknowns)).T
    return found


def _rates_and_states(model: Model) -> tuple[list[str], list[str]]:
    """The derivatives and states, in the order of the FMU, arrays by their elements."""
    pairs = [(one.variable.name, one.variable.derivative.name) for one in model.description.derivatives]
    elements: dict[str, list[str]] = {}
    for variable in model.variables.values():
        elements.setdefault(variable.whole, []).append(variable.name)
    return [each for rate, _ in pairs for each in elements[rate]], [each for _, x in pairs for each in elements[x]]


def _is_continuous(model: Model, name: str) -> bool:
    return model.variables[name].variability == "continuous"
