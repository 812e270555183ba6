"""The initialisation of the runs of a batch: start values, parameters, and the first exchange, as `Master` does it."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestration.components.fmi.instance import convert_value, number_of
from orchestration.components.fmi.kit import SAMPLE_OFFSET, SAMPLE_PERIOD
from orchestration.foundation.basics.c_structures import address
from orchestration.foundation.basics.simulator import Booleans, Floats, Integers
from orchestration.simulation.engines import initial
from orchestration.simulation.engines.batch.arrays import BatchArrays, BatchStructures
from orchestration.simulation.engines.batch.kernels import NoCode
from orchestration.simulation.engines.batch.run_numbers import RunNumbers, end_of
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.sources import SourceValues
from orchestration.simulation.engines.wiring_by_index import clock_of, of_each
from orchestration.systems.expressions.syntax import Call
from orchestration.systems.system.model import System


class Initialisation:
    """Sets the numbers of a batch to those at the start of runs."""

    def __init__(self, shape: Shape, arrays: BatchArrays, structures: BatchStructures, numbers: RunNumbers) -> None:
        self._shape, self._arrays, self._structures, self._numbers = shape, arrays, structures, numbers
        self._begins = [np.zeros(shape.lanes) for _ in shape.names]
        """Time at which the own time of each component begins [s]"""
        self.outputs: tuple[Integers, Floats] = np.zeros(0, dtype=np.int64), np.zeros((0, shape.lanes))
        """The places of outputs of a component without code, and their initial values"""

    def put_values(
        self, systems: Sequence[System], known: Mapping[Call, Floats], first_samples: Sequence[Mapping[str, int]]
    ) -> None:
        """Set start values, parameters, and all that differs between lanes."""
        shape, arrays = self._shape, self._arrays
        for memory, kernel in zip(arrays.memories, shape.kernels.values()):
            kernel.begin(address(memory))
        for lane, system in enumerate(systems):
            for index, name in enumerate(shape.names):
                self._put_parameters(index, name, lane, system)
                ratio, sample = clock_of(system, name, first_samples[lane])
                self._begins[index][lane] = 0.0 if name in shape.waits else ratio * sample
            for x, channel in zip(system.connections, arrays.channels):
                channel.sigma[:, lane], channel.quantum[:, lane] = of_each(x, x.noise), of_each(x, x.quantisation)
                channel.scale[0, lane], channel.offset[0, lane] = x.scale, x.offset
            arrays.numbers[:, lane] = [
                *(self._numbers.of(lane, system, name) for name in shape.numbers), end_of(system),
                *(known[call][lane] if known else 0.0 for call in shape.inner),
            ]  # fmt: skip
        for name, values in self._numbers.columns.items():
            index, place = shape.place(name)
            arrays.memories[index][place, : len(values)] = values

    def _put_parameters(self, index: int, name: str, lane: int, system: System) -> None:
        component, model, memory = system.components[name], self._shape.models[name], self._arrays.memories[index]
        for parameter, value in component.parameters.items():
            variable = model.variables[parameter]
            memory[variable.reference, lane] = number_of(variable, convert_value(variable, value, parameter))
        sampling = component.sampling
        if sampling is not None:
            self._arrays.ratios[index][0, lane] = sampling.clock_ratio
            if model.has_clock:
                own = sampling.clock == "fmu"
                memory[model.variables[SAMPLE_PERIOD].reference, lane] = sampling.period if own else 0.0
                memory[model.variables[SAMPLE_OFFSET].reference, lane] = sampling.offset if own else 0.0

    def exchange(self, given: Sequence[Sequence[SourceValues]]) -> Booleans:
        """Do the first exchange; the lanes in which it fails. `given` are the sources of each run that set inputs."""
        shape, memories = self._shape, self._arrays.memories
        wrong = np.zeros(shape.lanes, dtype=np.bool_)
        for lane, sources in enumerate(given):
            values = [value for source in sources for value in source.at_each(np.zeros(1))[0].tolist()]
            for memory, name in zip(memories, shape.names):
                for number, place in shape.fed[name]:
                    memory[place, lane] = values[number]
        received = [np.zeros((len(ends.end), shape.lanes)) for ends in shape.ends]
        for group in shape.first_exchange:
            wrong |= self._exchange(group, received)
        for index, name in enumerate(shape.names):
            wrong |= self._compute(index)
            wrong |= ~np.isfinite(memories[index][shape.connected[name]]).all(axis=0)
        for first, channel, arrays in zip(received, self._structures.channels, self._arrays.channels):
            if channel.extrapolates:
                arrays.applied[: len(first)] = first
                channel.applied_count[:] = [1] * shape.lanes
                channel.applied_time[:] = [0] * (2 * shape.lanes)
        return wrong

    def _exchange(self, group: Sequence[int], received: Sequence[Floats]) -> Booleans:
        shape, memories = self._shape, self._arrays.memories
        wrong = np.zeros(shape.lanes, dtype=np.bool_)

        def pass_on(i: int, open_: Booleans) -> tuple[Floats, Floats]:
            x = shape.system.connections[i]
            sender, receiver = shape.names.index(x.sender), shape.names.index(x.receiver)
            wrong[:] |= self._compute(sender)
            before, after = received[i].copy(), self.sent_values(i, memories[sender])
            received[i][:, open_] = after[:, open_]
            taken = self.received_values(i, after)[:, open_]
            memories[receiver][shape.ends[i].end[:, None], np.flatnonzero(open_)] = taken
            return before, received[i]

        return wrong | initial.exchange(group, pass_on, (shape.lanes,))

    def sent_values(self, i: int, sender: Floats) -> Floats:
        """What a connection sends, from the memory of its sender."""
        values, arrays = sender[self._shape.ends[i].start], self._arrays.channels[i]
        return values * arrays.scale + arrays.offset if self._structures.channels[i].converts else values

    def received_values(self, i: int, values: Floats) -> Floats:
        """What its receiver makes of that."""
        c, kinds = self._structures.types, self._shape.ends[i].kinds[:, None]
        return np.where(kinds == c.TRUTH, values != 0.0, np.where(kinds == c.WHOLE, np.rint(values), values))

    def _compute(self, index: int) -> Booleans:
        """Compute the outputs of a component in initialisation mode; the lanes in which that fails."""
        lanes = self._shape.lanes
        active, status = np.full(lanes, 2**64 - 1, dtype=np.uint64), np.zeros(lanes, dtype=np.int32)
        kernel, memory = self._shape.kernels[self._shape.names[index]], self._arrays.memories[index]
        if isinstance(kernel, NoCode):
            places, values = self.outputs
            memory[places] = values
        else:
            kernel.initialise(address(memory), address(active), address(self._begins[index]), address(status))
        failed: Booleans = status != 0
        return failed
