"""Worker processes in their coordinator: the assignment of tasks, and what follows from the death of a worker."""

import contextlib
import hashlib
import os
import pickle
import queue
import signal
import tempfile
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fmu_kit import scratch
from fmu_kit.new_files import write_atomically
from orchestration.components.fmi.trust import content_hash, is_own_content
from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.child import Child, Died
from orchestration.simulation.runs.outcome import RunLost
from orchestration.simulation.runs.simulation import run
from orchestration.simulation.workers import task as tasks
from orchestration.simulation.workers.provenance import sources, versions
from orchestration.simulation.workers.row import Outcome, Results
from orchestration.systems.system.files import Files

ATTEMPTS = 3
"""Number of tries of a run, from the second one in a new process, before the death of its worker is its result"""
_FROM_OUTSIDE = {-getattr(signal, name) for name in ("SIGKILL", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
"""Exit codes of processes ended from outside: by a user, or by the system when out of memory"""


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """The content of the files that the runs of a study need, as hashed, for workers on any machine."""

    contents: Mapping[str, bytes]
    """files by their names in systems"""
    own_fmus: frozenset[str]
    """hashes of the FMUs that the coordinator has built, which may share a process with the worker"""
    versions: dict[str, str]

    @classmethod
    def of(cls, files: Files) -> "Inputs":
        """The content of `files`."""
        own = frozenset(files.hashes[name] for name in files.fmus if is_own_content(files.hashes[name]))
        return cls(contents=files.contents, own_fmus=own, versions=versions())

    @cached_property
    def digest(self) -> str:
        """A hash of all of them."""
        return hashlib.sha256(pickle.dumps((dict(self.contents), sorted(self.own_fmus), self.versions))).hexdigest()


class InterruptedWorker(QuadcosimError):
    """A worker process received an interrupt, which is meant for all."""


class WorkerProcess:
    """One worker process with its own folder for temporary files."""

    def __init__(self, root: Path) -> None:
        self._folder = tempfile.TemporaryDirectory(dir=root, prefix="worker-", ignore_cleanup_errors=True)
        path = self._folder.name
        self._child = Child(
            subprocesses.Module.of("orchestration.simulation.workers.worker_process", path),
            environment=subprocesses.environment(**dict.fromkeys(("TMPDIR", "TEMP", "TMP"), path)),
        )

    def request(self, task: tasks.RunTask | tasks.TaskBatch | tasks.LoadTask) -> Any:
        """Send a task and return the answer; raises `Died`, also at its time limit."""
        self._child.allow(task.time_limit)
        self._child.send(task)
        kind: Any = Results | tasks.EnvironmentFailure
        answer = self._child.receive_by(lambda answer: tasks.of_task(task, answer), kind)
        self._child.allow(None)
        return answer

    def wait_until_ready(self, own_fmus: frozenset[str]) -> tasks.Ready:
        """The report of the process once it has started; raises `Died`."""
        self._child.send((sources(), own_fmus))
        answer: tasks.Ready = self._child.receive(tasks.Ready)
        return answer

    def close(self) -> None:
        """End it and remove its folder."""
        self._child.close()
        self._folder.cleanup()


class Supervisor:
    """Runs one task at a time in a worker process, which is replaced when it dies."""

    def __init__(self, root: Path, inputs: Inputs) -> None:
        self._root, self._inputs = root, inputs
        self._lock = threading.Lock()
        self._closed = False
        self._worker: WorkerProcess | None = None
        self._machine: str | None = None

    def run(self, task: tasks.RunTask | tasks.TaskBatch) -> Results:
        """The results of a run, or of many in lanes; a run that ends its process `ATTEMPTS` times has failed.

        Runs that end their process or exceed their time limit together are repeated each by itself, in lanes too: the
        bits of a row do not depend on deaths. So is one that ends as if the environment had failed, though all FMUs can
        be loaded: third-party ones may be the cause. Raises `QuadcosimError` for failures not caused by a run.
        """
        crashes = killed = complaints = 0
        while True:
            worker = self._ready_worker()
            try:
                answer = worker.request(task)
            except Died as death:
                self._drop()
                _expect_no_interrupt(death)
                from_outside = death.ending.reached is None and death.ending.code in _FROM_OUTSIDE
                if isinstance(task, tasks.TaskBatch) and len(task) > 1 and not from_outside:
                    return self._one_by_one(task)
                if death.ending.reached is not None:
                    return self._failed(f"it was ended: {death.ending.reached}", ended=True)
                if from_outside:
                    killed += 1
                else:
                    crashes += 1
                if crashes == ATTEMPTS:
                    tried = f"its worker process {death}, {ATTEMPTS} times, the last times in a new process"
                    return self._failed(self._lost_alone(task) or tried)
                if killed == ATTEMPTS:
                    first = task.index if isinstance(task, tasks.RunTask) else task.index[0]
                    raise QuadcosimError(
                        f"the worker process of run {first} {death} {ATTEMPTS} times: not caused by the "
                        "run, or too little memory; start the sweep again, with fewer workers"
                    ) from None
                continue
            if isinstance(answer, tasks.EnvironmentFailure):
                self._expect_environment(task, answer)
                if isinstance(task, tasks.TaskBatch) and len(task) > 1:
                    return self._one_by_one(task)
                complaints += 1
                if complaints == ATTEMPTS:
                    return self._failed(f"{answer.message}, {ATTEMPTS} times, each in a new process")
                continue
            results: Results = answer
            return results

    def _one_by_one(self, batch: tasks.TaskBatch) -> Results:
        return Results.joined([self.run(batch.some([run])) for run in range(len(batch))])

    def _expect_environment(self, task: tasks.RunTask | tasks.TaskBatch, failure: tasks.EnvironmentFailure) -> None:
        """Raise `QuadcosimError` for a failure unless third-party FMUs may be its cause; the process is a new one then.

        They may be where a new process can load all FMUs.
        """
        message = failure.message
        system = task.system if isinstance(task, tasks.RunTask) else task.systems[0]
        if not all(self._is_own(Path(component.fmu)) for component in system.components.values()):
            self._drop()
            try:
                answer = self._ready_worker().request(tasks.LoadTask(system=system))
            except Died as death:
                answer = None
                _expect_no_interrupt(death)
            self._drop()
            if not isinstance(answer, tasks.EnvironmentFailure):
                return
            message = answer.message
        raise tasks.WorkerEnvironmentError(f"not a failure of a run: {message}")

    def _lost_alone(self, task: tasks.RunTask | tasks.TaskBatch) -> str | None:
        """How a run by itself ends that has ended its workers: the process, in whose call, and when; None: otherwise.

        Only third-party FMUs have a process of their own then.
        """
        alone = task if isinstance(task, tasks.RunTask) else task.alone(0)
        if all(self._is_own(Path(component.fmu)) for component in alone.system.components.values()):
            return None
        try:
            run(alone.system, engine=alone.engine, time_limit=alone.time_limit, progress=self._expect_open)
        except RunLost as lost:
            return str(lost)
        except QuadcosimError:
            self._expect_open()
        return None

    def _expect_open(self, share: float = 0.0) -> None:
        """Raise `QuadcosimError` once this is closed."""
        if self._closed:
            raise QuadcosimError("the sweep has ended")

    def _is_own(self, fmu: Path) -> bool:
        with contextlib.suppress(OSError):  # it is no longer there
            return content_hash(fmu) in self._inputs.own_fmus
        return False

    def _failed(self, message: str, *, ended: bool = False) -> Results:
        return Results.of([Outcome(metrics=None, message=message, ended=ended)], self._machine)

    def close(self) -> None:
        """End the process; a waiting `run` raises `QuadcosimError`."""
        with self._lock:
            self._closed = True
        self._drop()

    def _drop(self) -> None:
        with self._lock:
            worker, self._worker = self._worker, None
        if worker is not None:
            worker.close()

    def _ready_worker(self) -> WorkerProcess:
        """The worker process, started if there is none; raises `QuadcosimError` if none can be started."""
        for attempt in range(ATTEMPTS):
            with self._lock:
                self._expect_open()
                if self._worker is not None:
                    return self._worker
                self._worker = worker = WorkerProcess(self._root)
            try:
                ready = worker.wait_until_ready(self._inputs.own_fmus)
            except Died as death:
                self._drop()
                _expect_no_interrupt(death)
                if attempt == ATTEMPTS - 1:
                    raise tasks.WorkerEnvironmentError(f"worker processes cannot start: the last one {death}") from None
                continue
            self._expect_same_software(ready)
            self._machine = ready.machine
        with self._lock:
            if self._worker is not None:
                return self._worker
        raise QuadcosimError("the sweep has ended")

    def _expect_same_software(self, ready: tasks.Ready) -> None:
        other = [name for name, version in self._inputs.versions.items() if ready.versions.get(name) != version]
        if other:
            raise tasks.WorkerEnvironmentError(
                f"{os.uname().nodename if hasattr(os, 'uname') else 'a worker'}: has another version of "
                f"{', '.join(other)} than the coordinator; expected the same"
            )


def _expect_no_interrupt(death: Died) -> None:
    if death.ending.code == -signal.SIGINT:
        raise InterruptedWorker("a worker process was interrupted") from None


class Pool:
    """Supervisors for the inputs of one study: as many as there are concurrent calls."""

    def __init__(self, inputs: Inputs) -> None:
        self._scratch = scratch.temporary()
        self._root = self._scratch.path
        self._inputs = inputs
        self._idle: queue.SimpleQueue[Supervisor] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._closed = False
        self._supervisors: list[Supervisor] = []
        try:
            self._paths = {name: self._unpack(i, name) for i, name in enumerate(inputs.contents)}
        except BaseException:
            self._scratch.remove()
            raise

    def run(self, task: tasks.RunTask | tasks.TaskBatch) -> Results:
        """The results of runs; may be called from several threads, each of which gets its own process.

        Raises `QuadcosimError` once it is closed.
        """
        supervisor = self._supervisor()
        try:
            return supervisor.run(task.at(self._paths))
        finally:
            self._idle.put(supervisor)

    def close(self) -> None:
        """End all processes, and start no more."""
        with self._lock:
            self._closed = True
        for supervisor in self._supervisors:
            supervisor.close()

    def remove(self) -> None:
        """Remove the temporary files; to be called when no thread is in `run` any more."""
        self._scratch.remove()

    def _supervisor(self) -> Supervisor:
        """An idle supervisor, or a new one."""
        with self._lock:
            if self._closed:
                raise QuadcosimError("the sweep has ended")
            try:
                return self._idle.get_nowait()
            except queue.Empty:
                self._supervisors.append(Supervisor(self._root, self._inputs))
                return self._supervisors[-1]

    def _unpack(self, number: int, name: str) -> Path:
        path = self._root / f"{number}-{Path(name).stem}{'.csv' if Path(name).suffix == '.csv' else '.fmu'}"
        try:
            write_atomically(path, self._inputs.contents[name])
        except OSError as error:
            raise QuadcosimError(f"{path}: expected to be written, for the workers: {error.strerror}") from error
        return path
