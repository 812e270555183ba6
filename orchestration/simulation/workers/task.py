"""Tasks and answers of a worker process, and their execution with FMUs that are loaded once."""

import io
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orchestration.components.fmi.access import USUAL, Access
from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.foundation.basics.simulator import Floats
from orchestration.foundation.processes.passable import passable
from orchestration.foundation.processes.typed_frames import FrameError
from orchestration.simulation.engines.master import BATCH, Engine
from orchestration.simulation.results.own_metrics import OwnMetric
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.result import Result
from orchestration.simulation.workers.row import Outcome, Results, Rows
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.files import all_with_files, input_files, with_files
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import with_values

if TYPE_CHECKING:
    from orchestration.simulation.engines.batch.batches import Batches


@dataclass(frozen=True, kw_only=True)
class RunTask:
    """One run of a study, with the paths of its files on the worker."""

    index: int
    key: str
    system: System
    keep_signals: bool = False
    record: Sequence[str] | None = None
    """Columns whose rows are wanted after the time; None: no rows"""
    metrics: tuple[OwnMetric, ...] = ()
    """the study's own metrics, besides those of the system"""
    engine: Engine | None = None
    """None: the fastest available"""
    time_limit: float | None = None
    """Limit of processor time [s]; None: unlimited"""

    def __len__(self) -> int:
        """One run."""
        return 1

    def rows(self, results: Results) -> Rows:
        """Its row."""
        return Rows(index=[self.index], key=[self.key], seed=[self.system.seed], results=results)

    def at(self, paths: Mapping[str, Path]) -> "RunTask":
        """The same with its files at these paths."""
        return replace(self, system=with_files(self.system, paths))


@dataclass(frozen=True, kw_only=True)
class TaskBatch:
    """Runs of a study that are simulated in SIMD lanes, by column: all with native FMUs, without keeping signals."""

    index: Sequence[int]
    key: Sequence[str]
    seed: Sequence[int]
    systems: Sequence[System]
    """Systems that differ in more than a seed and `parameters`"""
    places: Sequence[int]
    """The place of the system of each run among these"""
    parameters: Mapping[str, Floats] = field(default_factory=dict)
    """Real ones of each run, as COMPONENT.NAME, overriding those of its system"""
    limit: float | None = None
    """Limit of processor time of a run [s]; None: unlimited"""
    record: Sequence[str] | None = None
    """Columns whose rows are wanted after the time, in lanes those of components alone; None: no rows"""

    @classmethod
    def of(cls, tasks: Sequence[RunTask]) -> "TaskBatch":
        """The runs of single tasks."""
        return cls(
            index=[task.index for task in tasks], key=[task.key for task in tasks],
            seed=[task.system.seed for task in tasks], systems=[task.system for task in tasks],
            places=range(len(tasks)), limit=tasks[0].time_limit if tasks else None,
        )  # fmt: skip

    def __len__(self) -> int:
        """The number of runs."""
        return len(self.index)

    @property
    def time_limit(self) -> float | None:
        """[s] of processor time for all of them; None: unlimited."""
        return None if self.limit is None else self.limit * len(self)

    def some(self, runs: Sequence[int]) -> "TaskBatch":
        """Some of the runs, in this order."""
        used = [*dict.fromkeys(self.places[i] for i in runs)]
        at = {place: i for i, place in enumerate(used)}
        return TaskBatch(
            index=[self.index[i] for i in runs], key=[self.key[i] for i in runs], seed=[self.seed[i] for i in runs],
            systems=[self.systems[place] for place in used], places=[at[self.places[i]] for i in runs],
            parameters={name: values[runs] for name, values in self.parameters.items()}, limit=self.limit,
            record=self.record,
        )  # fmt: skip

    def alone(self, run: int) -> RunTask:
        """One of the runs as a task of its own."""
        parameters = {name: float(values[run]) for name, values in self.parameters.items()}
        system = with_values(self.systems[self.places[run]], self.seed[run], parameters)
        return RunTask(
            index=self.index[run], key=self.key[run], system=system, time_limit=self.limit, record=self.record
        )

    def rows(self, results: Results) -> Rows:
        """Their rows, whatever their worker, which runs foreign code, says that they are of."""
        return Rows(index=self.index, key=self.key, seed=self.seed, results=results)

    def at(self, paths: Mapping[str, Path]) -> "TaskBatch":
        """The same with their files at these paths."""
        return replace(self, systems=all_with_files(self.systems, paths))


@dataclass(frozen=True, kw_only=True)
class LoadTask:
    """The FMUs of a run, to be loaded and not to be called: whether the environment is to blame for its failure."""

    system: System
    time_limit: float | None = None

    def __len__(self) -> int:
        """No run."""
        return 0


@passable
@dataclass(frozen=True, kw_only=True)
class Ready:
    """The report of a started worker process: its software and the kind of its machine."""

    versions: dict[str, str]
    machine: str


@passable
@dataclass(frozen=True, kw_only=True)
class EnvironmentFailure:
    """This worker cannot simulate, for a reason that is not a failure of a run."""

    message: str


def of_task(task: RunTask | TaskBatch | LoadTask, answer: Results | EnvironmentFailure) -> Results | EnvironmentFailure:
    """An answer to a task; raises `FrameError` if it has not one entry for each run."""
    if isinstance(answer, Results) and not answer.fits(len(task)):
        raise FrameError("expected one outcome of each run")
    return answer


class WorkerEnvironmentError(QuadcosimError):
    """A failure of the worker's environment, not of the run: no space, a missing file, an FMU that does not load."""


class Runner:
    """The FMUs of this process, instantiated once; one run at a time."""

    def __init__(self, machine: str | None = None) -> None:
        self._instances = Instances()
        self._machine = machine
        self._batches: Batches | None = None

    def run(self, task: RunTask | TaskBatch | LoadTask) -> Results:
        """Simulate a run, or many at once and one by one those that a batch cannot complete; or only load.

        The failure of a run becomes its result; raises `WorkerEnvironmentError` for other failures.
        """
        if isinstance(task, LoadTask):
            self._expect_loadable(task.system)
            return Results.of([], self._machine)
        outcomes = self._in_lanes(task) if isinstance(task, TaskBatch) else [self._alone(task)]
        try:
            return Results.of(outcomes, self._machine)
        except MemoryError as error:  # an FMU may have left none
            raise WorkerEnvironmentError(str(error) or type(error).__name__) from error

    def _expect_loadable(self, system: System) -> None:
        _expect_files(system)
        with ExitStack() as stack:
            for name, component in system.components.items():
                stack.enter_context(self._load(Path(component.fmu), name))

    def _alone(self, task: RunTask) -> Outcome:
        started = time.perf_counter()
        metrics, message, signals, rows, engine = None, None, None, None, None
        _expect_files(task.system)
        try:
            with prepared(task.system, load=self._load, engine=task.engine) as simulation:
                simulation.master.initialise()
                simulation.master.run()
                result = simulation.result()
                own = {metric.name: metric.of(result) for metric in task.metrics}
                metrics, message = {**result.metrics, **own}, result.divergence or result.termination
                engine = str(result.provenance["engine"])
                signals = _parquet(result) if task.keep_signals else None
                rows = None if task.record is None else rows_of(result.signals, task.record)
        except (SimulatorError, UsageError) as error:
            message = str(error)
        except (QuadcosimError, OSError, MemoryError) as error:
            raise WorkerEnvironmentError(str(error) or type(error).__name__) from error
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
        duration = time.perf_counter() - started
        return Outcome(metrics=metrics, message=message, duration=duration, engine=engine, signals=signals, rows=rows)

    def _in_lanes(self, batch: TaskBatch) -> list[Outcome]:
        started = time.perf_counter()
        for system in batch.systems[:1]:
            _expect_files(system)
        try:
            if self._batches is None:
                from orchestration.simulation.engines.batch.batches import Batches  # deferred: slow to load

                self._batches = Batches()
            systems = [batch.systems[place] for place in batch.places]
            record = None if batch.record is None else of_components(systems[0], batch.record)
            found = dict[int, Outcome]()
            for run, each, rows in self._batches.each(systems, record, batch.parameters, batch.seed):
                if each is not None:
                    found[run] = Outcome(
                        metrics=each.metrics, message=each.message, engine=BATCH,
                        rows=None if record is None else rows.copy(),
                    )  # fmt: skip
        except (QuadcosimError, OSError, MemoryError) as error:
            raise WorkerEnvironmentError(str(error) or type(error).__name__) from error
        duration = (time.perf_counter() - started) / len(batch)
        return [
            replace(found[run], duration=duration) if run in found else self._alone(batch.alone(run))
            for run in range(len(batch))
        ]

    @contextmanager
    def _load(self, path: Path, instance_name: str, access: Access = USUAL) -> Iterator[Instance]:
        """Load an FMU; its failure is one of the environment, since it does not depend on the run."""
        with ExitStack() as stack:
            try:
                fmu = stack.enter_context(self._instances.load(path, instance_name, access))
            except Exception as error:
                raise WorkerEnvironmentError(str(error) or type(error).__name__) from error
            yield fmu

    def close(self) -> None:
        """Free the FMUs."""
        self._instances.close()


def of_components(system: System, record: Sequence[str]) -> list[str]:
    """The recorded columns of components: lanes have no others."""
    return [name for name in record if component_of(name) in system.components]


def rows_of(signals: Mapping[str, Floats], record: Sequence[str]) -> Floats:
    """The rows of columns, the time first."""
    return np.column_stack([signals[name] for name in ("time", *(name for name in record if name != "time"))])


def _expect_files(system: System) -> None:
    """Raise `WorkerEnvironmentError` if a file is missing, or is not the FMU that the coordinator has read."""
    fmus = [Path(component.fmu) for component in system.components.values()]
    for file in (*fmus, *input_files(system).values()):
        if not file.is_file():
            raise WorkerEnvironmentError(f"{file}: is no longer there")
    try:
        for fmu in fmus:
            read_model(fmu)
    except QuadcosimError as error:
        raise WorkerEnvironmentError(str(error)) from error


def _parquet(result: Result) -> bytes:
    from orchestration.foundation.recording import tables  # deferred: pyarrow is needed only where signals are kept

    buffer = io.BytesIO()
    tables.write_signals(buffer, result.recording, result.about)
    return buffer.getvalue()
