"""The bandwidth of each controller's loop, by which controllers of any structure are compared."""

from collections.abc import Mapping

from orchestration.components.building import fmus
from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.experiments.comparison.crossovers import CROSSOVERS
from orchestration.experiments.comparison.design import FMU, Comparison, Controller, VehicleEntry
from orchestration.experiments.studies.axes import Value
from orchestration.systems.system.files import files_of
from orchestration.systems.system.request import ControlLoop

Key = tuple[str, str, Value]
"""Controller, vehicle, value of the axis"""
Bandwidths = Mapping[Key, float]
_OF_THE_PERIOD = ("hold_period", "prediction")


def bandwidths(comparison: Comparison) -> dict[Key, float]:
    """Of every controller on every vehicle [rad/s], by value of the axis, on which only that of tuned ones depends."""
    crossover = CROSSOVERS.of(comparison.base.kind)
    if crossover is None:
        return {}
    by_key: dict[Key, float] = {}
    for controller in comparison.controllers:
        for vehicle in comparison.vehicles:
            known: dict[tuple[tuple[str, Value], ...], float] = {}
            for value in comparison.values:
                tuned = tuple(sorted(controller.tuned.get((vehicle.name, value), {}).items()))
                if tuned not in known:
                    loop = _loop(comparison, controller, vehicle, tuned)
                    fmus_of_it = files_of(loop.as_system()).fmus.values()
                    known[tuned] = controller.bandwidth or isolated_call(fmus_of_it, crossover, loop)
                by_key[controller.name, vehicle.name, value] = known[tuned]
    return by_key


def _loop(
    comparison: Comparison, controller: Controller, vehicle: VehicleEntry, tuned: tuple[tuple[str, Value], ...]
) -> ControlLoop:
    fmu = comparison.fmu_of(controller)
    sets = {**comparison.parameters_for(vehicle, controller), **controller.sets, **dict(tuned)}
    known = fmus.read_model(fmu).variables
    sets |= {f"controller.{name}": 0.0 for name in _OF_THE_PERIOD if name in known}
    plant = comparison.base.as_system().fmus["plant"]
    return comparison.base.with_values(
        {**sets, FMU: fmu, "plant.fmu": fmus.native_twin(plant) if comparison.native else plant}
    )
