"""OSP libcosim, through libcosimpy."""

from libcosimpy.CosimEnums import CosimVariableType
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from orchestration.foundation.basics.times import nanoseconds, seconds
from orchestration.simulation.interop.job import Job, Rows

SPARE = 2
"""steps beyond the expected ones for which the observer has room"""


def run(job: Job) -> Rows:
    """With connections made one by one, and initial values."""
    execution = CosimExecution.from_step_size(nanoseconds(job.step))
    for name, path in job.fmus.items():
        execution.add_local_slave(CosimLocalSlave(str(path), name))
    variables = _Variables(execution)
    for name, parameters in job.parameters.items():
        for parameter, value in parameters.items():
            set_initial = {
                CosimVariableType.REAL: execution.real_initial_value,
                CosimVariableType.INTEGER: execution.integer_initial_value,
                CosimVariableType.BOOLEAN: execution.boolean_initial_value,
            }[variables.kind(name, parameter)]
            if not set_initial(*variables.at(name, parameter), value):
                raise RuntimeError(f"{name}.{parameter} = {value}: libcosim did not accept it")
    for output, target in job.connections:
        execution.connect_real_variables(*variables.at(*output), *variables.at(*target))
    return _record(execution, variables, job)


def run_ssp(job: Job) -> Rows:
    """From the SSP alone: its step, its parameters."""
    execution = CosimExecution.from_ssp_file(str(job.ssp))
    return _record(execution, _Variables(execution), job)


class _Variables:
    """Indices of variables by component and name."""

    def __init__(self, execution: CosimExecution) -> None:
        self._slaves = {info.name.decode(): info.index for info in execution.slave_infos()}
        self._variables = {
            name: {v.name.decode(): v for v in execution.slave_variables(index)} for name, index in self._slaves.items()
        }

    def at(self, component: str, name: str) -> tuple[int, int]:
        """(slave, value reference)"""
        return self._slaves[component], self._variables[component][name].reference

    def kind(self, component: str, name: str) -> CosimVariableType:
        """Its type."""
        return CosimVariableType(self._variables[component][name].type)


def _record(execution: CosimExecution, variables: _Variables, job: Job) -> Rows:
    observer = CosimObserver.create_time_series(buffer_size=job.steps + SPARE)
    execution.add_observer(observer)
    places = [variables.at(*signal.split(".", 1)) for signal in job.signals]
    for place in places:
        observer.start_time_series(*place, CosimVariableType.REAL)
    if not execution.simulate_until(nanoseconds(job.stop)):
        raise RuntimeError(f"libcosim stopped at t = {seconds(execution.status().current_time)} s")
    columns = []
    for place in places:
        times, _, values = observer.time_series_real_samples(*place, from_step=1, sample_count=job.steps + SPARE)
        columns.append(list(values))
    return [[seconds(time), *values] for time, *values in zip(times, *columns, strict=True)]
