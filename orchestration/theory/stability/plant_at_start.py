"""One FMU about its start: ẋ = A x + B u, y = C x + D u by model exchange, or from sample to sample."""

from contextlib import closing, suppress
from dataclasses import dataclass, replace

import numpy as np

from orchestration.components.fmi.adapted import AdaptedInstance
from orchestration.components.fmi.instance import NO_STATE, Instance
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import Model, declared_of, read_model
from orchestration.foundation.basics.errors import SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.basics.unit_algebra import counted, quantity, some
from orchestration.foundation.processes.passable import passable
from orchestration.simulation.requests.request import RequestLike
from orchestration.simulation.runs.prepared import set_parameters
from orchestration.systems.system.request import Request, errors_in_own_terms, system_of
from orchestration.theory.stability.excitation import Rest
from orchestration.theory.stability.identification import in_continuous_time
from orchestration.theory.stability.linearise import in_isolation
from orchestration.theory.stability.matrices import of_samples
from orchestration.theory.stability.state_space import reduced

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
    """Deviations of an FMU from its start, by the names and units of its variables.

    In continuous time; or where there is a `dt` from sample to sample, as the `rest` of a loop: inputs change at a
    sample, after outputs are read, and are held until the next one.
    """

    name: str
    """Name of the FMU."""
    A: Floats
    """Rates of the states by the states."""
    B: Floats
    """Rates of the states by the inputs."""
    C: Floats
    """Outputs by the states."""
    D: Floats
    """Outputs by the inputs."""
    states: tuple[str, ...]
    """Variables; from sample to sample coordinates without physical meaning."""
    inputs: tuple[str, ...]
    """Variables that are set."""
    outputs: tuple[str, ...]
    """Variables that are read."""
    operating_point: dict[str, float]
    """Values about which it is linear, by variable."""
    rates: dict[str, float]
    """Rates of the states there that are not 0, by state."""
    dt: float | None = None
    """Time from sample to sample [s]; None: continuous time."""

    def __repr__(self) -> str:
        return f"<PlantAtStart: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """Its sizes, and whether it rests at its start."""
        counts = [(len(self.states), "state"), (len(self.inputs), "input"), (len(self.outputs), "output")]
        sizes = ", ".join(counted(count, what) for count, what in counts)
        moves = some(f"{name} by {rate:.4g} a second" for name, rate in self.rates.items())
        clock = "in continuous time" if self.dt is None else f"sampled every {quantity(self.dt, 's')}"
        rests = f"it does not rest there: {moves}" if moves else "it rests there"
        return f"{self.name} about its start, {clock}: {sizes}; {rests}"


def plant_at_start(request: RequestLike, period: float | None = None) -> PlantAtStart:
    """The matrices of one FMU about its start values and parameters: its path, or a system of it alone.

    By model exchange in continuous time, by central differences of its derivatives and outputs, and by its directional
    derivatives where they agree. With a `period` [s] by any interface, from sample to sample. Raises `UsageError` for
    an FMU that does not offer model exchange, without a period; with one for an FMU that does not rest at its start,
    or cannot save its state.
    """
    if period is not None and not 0.0 < period < np.inf:
        raise UsageError(f"--period {period:g}: expected a positive number of seconds")
    return in_isolation(request, _plant_at_start, period, is_loop=False)


def _plant_at_start(request: Request, period: float | None) -> PlantAtStart:
    with errors_in_own_terms(request):
        components = system_of(request).components
        if len(components) != 1:
            raise UsageError(f"components = {', '.join(components)}: expected one, as a system with MODEL.fmu alone")
        ((name, stated),) = components.items()
        access = stated.access if period is not None else replace(stated.access, interface="model-exchange")
        model = read_model(stated.fmu)
        if period is None and "model-exchange" not in declared_of(model.description):
            raise UsageError(
                f"{stated.fmu}: {model.name} has no derivatives to linearise: expected an FMU for model exchange, or "
                "--period SECONDS, at which a controller samples it"
            )
        with closing(open_here(model.path, name, access)) as instance:
            set_parameters(instance, stated)
            instance.enter_initialization(0.0, np.inf)
            instance.exit_initialization()
            if period is not None:
                return _sampled(instance, period, min(period, stated.step or period))
            assert isinstance(instance, AdaptedInstance)
            return _about(instance)


def _sampled(instance: Instance, period: float, step: float) -> PlantAtStart:
    """From sample to sample, by pulses on its inputs, in steps of about `step` [s]."""
    model = instance.model
    if not model.saves_state:
        raise UsageError(f"{model.path}: {NO_STATE}")
    inputs, outputs = model.names("input", kinds=("Real",)), model.names("output", kinds=("Real",))
    held, before, after = np.zeros(len(inputs)), np.zeros(len(outputs)), np.zeros(len(outputs))
    instance.reader(inputs, held)()
    read, steps = instance.reader(outputs, after), max(1, round(period / step))
    for k in range(2 * steps):
        instance.step(k * period / steps, period / steps)
        if k in (steps - 1, 2 * steps - 1):
            before[:] = after
            read()
    moved = np.abs(after - before) / np.maximum(1.0, np.abs(before))
    if moved.max(initial=0.0) > AT_REST:
        raise UsageError(
            f"{model.path}: does not rest at its start: {outputs[int(moved.argmax())]} moves by {moved.max():.2g} in "
            f"{quantity(period, 's')}: expected start values and inputs at which it rests, by --set NAME=V"
        )
    rest = Rest(fmu=instance, inputs=tuple(inputs), held=held, outputs=tuple(outputs), time=2 * period)
    tangent = in_continuous_time(rest, period, step, unit=None if model.varies_step else step)
    found, count = of_samples(tangent, period), len(outputs)
    A = np.block([[found.A, np.zeros((len(found.A), count))], [found.C, np.zeros((count, count))]])
    C = np.hstack([np.zeros((count, len(found.A))), np.eye(count)])  # outputs are read as the step before left them
    A, B, C = reduced(A, np.vstack([found.B, found.D]), C)
    return PlantAtStart(
        name=model.name, A=A, B=B, C=C, D=np.zeros((count, len(inputs))),
        states=tuple(f"x{i}" for i in range(1, len(A) + 1)), inputs=rest.inputs, outputs=rest.outputs,
        operating_point=dict(zip((*inputs, *outputs), (*held.tolist(), *after.tolist()))), rates={}, dt=period,
    )  # fmt: skip


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
