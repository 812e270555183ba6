"""A system in which the caller's code replaces one component: which one, its inputs, and its outputs."""

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestration.components.building import fmus
from orchestration.components.fmi.instance import start_number
from orchestration.components.fmi.read_description import Model, read_model
from orchestration.foundation.basics.errors import UsageError, expected_name
from orchestration.foundation.basics.simulator import Floats
from orchestration.simulation.engines.resolved import ResolvedRequest, check_against_fmus, columns_of
from orchestration.simulation.requests.kinds import KINDS
from orchestration.simulation.runs.arguments import values_by_path
from orchestration.systems.system.check import recorded_variables
from orchestration.systems.system.connection import component_of, variable_of
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import changed
from orchestration.systems.system.request import Request, errors_in_own_terms


@dataclass(frozen=True, kw_only=True)
class Replacement:
    """A request, and the component of its system that the caller's code replaces."""

    request: Request
    component: str
    system: System
    models: Mapping[str, Model]
    """Models, that of the replaced component without the variables that have no value"""
    measured: tuple[str, ...]
    """its inputs that are connected or fed by a source"""
    commanded: tuple[str, ...]
    """its outputs that are connected"""
    initial: Floats | None
    """their values before the first command, if the caller says so"""

    def initial_command(self, system: System, parameters: Mapping[str, Any]) -> Sequence[Any]:
        """What stands for each output before the first command: by default it leaves the inputs as they start.

        `parameters` are all numeric ones by COMPONENT.NAME; where they are arrays, of many runs, so may be the values.
        Raises `UsageError` for one output that inputs with different values receive.
        """
        if self.initial is not None:
            return [*self.initial]
        kind = KINDS.of(self.request.kind)
        resting = {} if kind is None else kind.resting_inputs(parameters)
        values: dict[str, tuple[str, Any]] = {}
        for x in system.connections:
            for start, end in zip(x.start, x.end) if x.sender == self.component else ():
                variable = self.models[x.receiver].variables[variable_of(end)]
                value = (resting.get(end, start_number(variable)) - x.offset) / x.scale
                other, known = values.setdefault(variable_of(start), (end, value))
                if np.any(known != value):
                    raise UsageError(
                        f"initial: expected a command: {start} goes to {other} and {end}, which start differently"
                    )
        return [values[name][1] for name in self.commanded]

    def resolve(self, values: Mapping[str, Any], seed: int | None) -> ResolvedRequest:
        """Resolve it with other values by target, and a seed; raises `UsageError` for values that are invalid."""
        values = values_by_path(values, "values =") | ({} if seed is None else {"seed": seed})
        with errors_in_own_terms(self.request):
            paths = {path: value for target, value in values.items() for path in self.request.paths_of(target)}
            system = changed(self.system, paths) if paths else self.system
            if system.fmus != self.system.fmus:
                raise UsageError("values: expected those of a run of the same FMUs; others are another Simulation")
            fits = check_against_fmus(system, self.models)
        return ResolvedRequest(request=self.request, models=self.models, **vars(fits))


def replace_component(request: Request, component: str | None, initial: Any) -> Replacement:
    """Replace a component of a request; None: the only sampled one. Raises `UsageError` if it cannot be replaced.

    `initial` is a command that stands before the first; None: the default.
    """
    with errors_in_own_terms(request):
        system = request.as_system()
        name = component_named(system, component, "to replace")
        _expect_no_clock(system, name)
        measured, commanded = _ends(system, name)
        whole = replace(system, components={**system.components, name: replace(system.components[name], record=None)})
        models = {each: read_model(path) for each, path in fmus.of_components(system.fmus).items()}
    models[name] = _without_code(models[name], commanded)
    return Replacement(
        request=request, component=name, system=whole, models=models, measured=measured, commanded=commanded,
        initial=None if initial is None else command_of(initial, commanded, "initial"),
    )  # fmt: skip


def command_of(command: Any, names: Sequence[str], what: str) -> Floats:
    """A command, an array or values by name, as numbers in the order of `names`; raises `UsageError` for others."""
    if isinstance(command, Mapping):
        for name in (*command, *names):
            if name not in names or name not in command:
                raise UsageError(f"{what}: {name}: expected values of {', '.join(names)}")
        command = [command[name] for name in names]
    values: Floats = np.zeros((0, 0))
    with suppress(TypeError, ValueError):  # of numpy, for what is no array of numbers
        values = np.asarray(command, dtype=np.float64)
    if values.shape != (len(names),):
        raise UsageError(f"{what}: expected {len(names)} numbers: {', '.join(names)}")
    for name, value in zip(names, values.tolist()):
        if not math.isfinite(value):
            raise UsageError(f"{what}: {name} = {value}: expected a finite number")
    return values


def names_of(system: System, models: Mapping[str, Model]) -> tuple[str, ...]:
    """What has a value at an instant of a run: the time, columns of components, and signals of sources."""
    recorded = recorded_variables(system, models)
    columns = [f"{name}.{variable}" for name, variables in recorded.items() for variable in variables]
    return (*dict.fromkeys((*columns_of(system), *columns)),)


def component_named(system: System, component: str | None, to: str, *, only_sampled: bool = False) -> str:
    """A component by name, None: the only sampled one; raises `UsageError` stating what it is needed for (`to`)."""
    sampled = [name for name, each in system.components.items() if each.sampling is not None]
    if component is None:
        if len(sampled) != 1:
            listed = ", ".join(sampled or system.components)
            raise UsageError(
                f"--component: expected the NAME of the one {to}, of the {len(sampled)} that are sampled: {listed}"
            )
        component = sampled[0]
    known = sampled if only_sampled else list(system.components)
    if component not in known:
        what = f"{component} is not sampled" if component in system.components else component
        raise UsageError(f"component: {what}: {expected_name(str(component), known)}")
    return component


def _expect_no_clock(system: System, component: str) -> None:
    sampling = system.components[component].sampling
    if sampling is not None and sampling.clock == "fmu":
        raise UsageError(f"components.{component}.sampling.clock = fmu: expected master: your code has no clock")


def _ends(system: System, component: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The inputs of a component that are fed, and its outputs that are connected, in the order of the system."""
    fed = [end for x in system.connections for end in x.end] + [end for s in system.sources.values() for end in s.to]
    read = dict.fromkeys(start for x in system.connections for start in x.start)
    inputs, outputs = (tuple(variable_of(e) for e in ends if component_of(e) == component) for ends in (fed, read))
    if not outputs:
        raise UsageError(f"component: {component}: expected one with an output that is connected")
    return inputs, outputs


def _without_code(model: Model, outputs: Sequence[str]) -> Model:
    """The model of a component whose FMU is not used: inputs, parameters and some outputs, counted from 0 on."""
    kept = [v for v in model.variables.values() if v.causality in ("input", "parameter") or v.name in outputs]
    return replace(model, variables={v.name: replace(v, reference=i) for i, v in enumerate(kept)})
