"""Tasks and answers of a worker process, and their execution with FMUs that are loaded once."""

import io
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestration.components.fmi.instance import Instance
from orchestration.components.fmi.read_description import read_model
from orchestration.components.fmi.reuse import Instances
from orchestration.foundation.basics.errors import QuadcosimError, SimulatorError, UsageError
from orchestration.foundation.processes.passable import passable
from orchestration.foundation.processes.typed_frames import FrameError
from orchestration.simulation.engines.master import BATCH, Engine
from orchestration.simulation.results.own_metrics import OwnMetric
from orchestration.simulation.runs.prepared import prepared
from orchestration.simulation.runs.result import Result
from orchestration.simulation.workers.row import Row
from orchestration.systems.system.input_files import input_files
from orchestration.systems.system.model import System

if TYPE_CHECKING:
    from orchestration.simulation.engines.batch.batches import Batches


@dataclass(frozen=True, kw_only=True)
class RunTask:
    """One run of a study, with the paths of its files on the worker."""

    index: int
    key: str
    settings: Mapping[str, Any]
    system: System
    keep_signals: bool
    metrics: tuple[OwnMetric, ...] = ()
    """the study's own metrics, besides those of the system"""
    engine: Engine | None = None
    """None: the fastest available"""
    time_limit: float | None = None
    """Limit of processor time [s]; None: unlimited"""


@dataclass(frozen=True, kw_only=True)
class TaskBatch:
    """Runs of a study that are simulated in SIMD lanes, all with native FMUs and without keeping signals."""

    tasks: tuple[RunTask, ...]

    @property
    def time_limit(self) -> float | None:
        """[s] of processor time for all of them; None: unlimited."""
        limits = [task.time_limit for task in self.tasks if task.time_limit is not None]
        return sum(limits) if len(limits) == len(self.tasks) else None


@passable
@dataclass(frozen=True, kw_only=True)
class TaskOutcome:
    """The row of a run, and its signals as the bytes of a Parquet file if they are kept."""

    row: Row
    signals: bytes | None = None
    ended: bool = False
    """whether it was stopped at a limit"""


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


def of_task(
    task: RunTask | TaskBatch, answer: list[TaskOutcome] | EnvironmentFailure
) -> list[TaskOutcome] | EnvironmentFailure:
    """An answer with the rows of its task, whatever its worker, which runs foreign code, says that they are of.

    Raises `FrameError` if it has not one for each run.
    """
    several = task.tasks if isinstance(task, TaskBatch) else (task,)
    if isinstance(answer, EnvironmentFailure):
        return answer
    if len(answer) != len(several):
        raise FrameError("expected one outcome of each run")
    return [
        replace(
            outcome,
            row=replace(outcome.row, index=one.index, key=one.key, settings=one.settings, seed=one.system.seed),
        )
        for one, outcome in zip(several, answer)
    ]


class WorkerEnvironmentError(QuadcosimError):
    """A failure of the worker's environment, not of the run: no space, a missing file, an FMU that does not load."""


class Runner:
    """The FMUs of this process, instantiated once; one run at a time."""

    def __init__(self, machine: str | None = None) -> None:
        self._instances = Instances()
        self._machine = machine
        self._batches: Batches | None = None

    def run(self, task: RunTask) -> TaskOutcome:
        """Simulate one run; its own failure becomes its row.

        Raises `WorkerEnvironmentError` for other failures.
        """
        started = time.perf_counter()
        metrics, message, signals, engine = None, None, None, None
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
        except (SimulatorError, UsageError) as error:
            message = str(error)
        except (QuadcosimError, OSError, MemoryError) as error:
            raise WorkerEnvironmentError(str(error) or type(error).__name__) from error
        except Exception as error:
            message = f"{type(error).__name__}: {error}"
        return TaskOutcome(
            row=row_of(task, metrics, message, time.perf_counter() - started, self._machine, engine), signals=signals
        )

    def run_chunk(self, chunk: TaskBatch) -> list[TaskOutcome]:
        """Simulate many runs at once, and one by one those that a batch cannot complete.

        Raises `WorkerEnvironmentError` for failures not caused by a run.
        """
        started = time.perf_counter()
        _expect_files(chunk.tasks[0].system)
        try:
            if self._batches is None:
                from orchestration.simulation.engines.batch.batches import Batches  # deferred: slow to load

                self._batches = Batches()
            outcomes = self._batches.run([task.system for task in chunk.tasks])
        except (QuadcosimError, OSError, MemoryError) as error:
            raise WorkerEnvironmentError(str(error) or type(error).__name__) from error
        duration = (time.perf_counter() - started) / len(chunk.tasks)
        return [
            self.run(task)
            if each is None
            else TaskOutcome(row=row_of(task, each.metrics, each.message, duration, self._machine, BATCH))
            for task, each in zip(chunk.tasks, outcomes, strict=True)
        ]

    @contextmanager
    def _load(self, path: Path, instance_name: str) -> Iterator[Instance]:
        """Load an FMU; its failure is one of the environment, since it does not depend on the run."""
        with ExitStack() as stack:
            try:
                fmu = stack.enter_context(self._instances.load(path, instance_name))
            except Exception as error:
                raise WorkerEnvironmentError(str(error) or type(error).__name__) from error
            yield fmu

    def close(self) -> None:
        """Free the FMUs."""
        self._instances.close()


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


def row_of(
    task: RunTask,
    metrics: dict[str, Any] | None,
    message: str | None,
    duration: float,
    machine: str | None,
    engine: str | None = None,
) -> Row:
    """The row of a task; without metrics the run has failed."""
    return Row(
        index=task.index, key=task.key, settings=task.settings, seed=task.system.seed, metrics=metrics,
        message=message, duration=duration, machine=machine, engine=engine,
    )  # fmt: skip


def _parquet(result: Result) -> bytes:
    from orchestration.foundation.recording import tables  # deferred: pyarrow is needed only where signals are kept

    buffer = io.BytesIO()
    tables.write_signals(buffer, result.recording, result.about)
    return buffer.getvalue()
