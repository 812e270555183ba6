"""Runs tasks in worker processes, locally or on a dask cluster, and yields the outcomes as they come."""

import atexit
import concurrent.futures
import contextlib
import logging
import numbers
import re
import socket
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any

from orchestration.foundation.basics.errors import QuadcosimError, UsageError, shown
from orchestration.foundation.basics.terminal import warn
from orchestration.simulation.engines.master import Engine
from orchestration.simulation.workers.batching import batched, chunks
from orchestration.simulation.workers.pool import Inputs, InterruptedWorker, Pool
from orchestration.simulation.workers.row import Results, Rows
from orchestration.simulation.workers.task import RunTask, TaskBatch
from orchestration.systems.system.files import Files
from orchestration.systems.system.model import System

TaskRunner = Callable[[Iterable[RunTask | TaskBatch]], Generator[Rows, None, None]]
"""Yields the rows of tasks as they come, in any order."""
Submit = Callable[[RunTask | TaskBatch], "Future[Results]"]
_PATIENCE = 10.0
"""Time to wait for the scheduler [s]"""
_WORKERS_PATIENCE = 60.0
"""Time to wait for its first worker [s]"""
SILENCE, TOLD_AFTER = 120.0, 10.0
"""Times without an answer of the scheduler after which a sweep ends, and after which it says so [s]"""
_POLL = 1.0
"""Time between two checks whether it has answered [s]"""
_KEPT = "finished runs are kept, start the sweep again"
_ADDRESS = re.compile(r"(?:(?:tcp|tls|ws|wss)://)?(\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):(\d{1,5})")


class RunEvaluator:
    """Evaluates a few runs at a time for searches that choose the next runs by the metrics.

    They run in `workers` processes of this machine, or in those of the `dask` scheduler at this address.
    """

    def __init__(self, files: Files, workers: int, engine: Engine | None = None, *, dask: str | None = None) -> None:
        expect_workers(workers)
        if dask is not None:
            expect_scheduler(dask)
        self._files, self._workers, self._engine, self._dask = files, workers, engine, dask
        self._stack = ExitStack()
        self._check: Callable[[], None] = lambda: None

    def __enter__(self) -> "RunEvaluator":
        inputs = Inputs.of(self._files)
        if self._dask is None:
            self._submit = _local_submit(self._stack, inputs, self._workers)
        else:
            self._stack.enter_context(_losses_named(self._dask))
            reached = _cluster(self._stack, inputs, self._dask)
            self._submit, self._check, self._workers = reached.submit, reached.check, reached.threads
        return self

    def __exit__(self, *exception: Any) -> None:
        self._stack.__exit__(*exception)

    def run_all(self, systems: Sequence[System], *, in_lanes: bool = False) -> list[Any]:
        """The metrics of all runs in their order; `in_lanes`: with native FMUs, many at once.

        Raises `QuadcosimError` if a run fails.
        """
        if not in_lanes:
            return self.run_until(systems, stop=lambda metrics: False)
        tasks = (self._task(i, system) for i, system in enumerate(systems))
        metrics: list[Any] = [None] * len(systems)
        parts = [*chunks(batched(tasks), len(systems), self._workers)]
        for part, future in zip(parts, [self._submit(part) for part in parts]):
            results = self._result(future)
            for place, index in enumerate(part.index):
                metrics[index] = _metrics(results, place)
        return metrics

    def run_until(
        self, systems: Sequence[System], stop: Callable[[Any], bool], report: Callable[[int], None] = lambda done: None
    ) -> list[Any]:
        """The metrics of the runs in their order, up to the first for whose metrics `stop` is true.

        The result does not depend on the number of workers. `report` is called after each run with the number of runs
        done. Raises `QuadcosimError` if a run fails.
        """
        futures = [self._submit(self._task(i, system)) for i, system in enumerate(systems)]
        metrics: list[Any] = []
        try:
            for future in futures:
                metrics.append(_metrics(self._result(future), 0))
                report(len(metrics))
                if stop(metrics[-1]):
                    break
        finally:
            for future in futures:
                future.cancel()
        return metrics

    def _result(self, future: "Future[Results]") -> Results:
        """The results of a task, however long it takes; raises `QuadcosimError` if a scheduler no longer answers."""
        while not concurrent.futures.wait([future], timeout=_POLL).done:
            self._check()
        return future.result()

    def _task(self, index: int, system: System) -> RunTask:
        return RunTask(index=index, key="", system=system, engine=self._engine)


def _metrics(results: Results, place: int) -> Any:
    """The metrics of a run; raises `QuadcosimError` if it has failed."""
    metrics = results.metrics(place)
    if metrics is None:
        raise QuadcosimError(str(results.messages[place]))
    return metrics


@contextmanager
def local_workers(inputs: Inputs, workers: int) -> Iterator[TaskRunner]:
    """Run tasks in `workers` processes of this machine, which start with the first task.

    Raises `QuadcosimError` for failures not caused by a run, `KeyboardInterrupt` if a worker is interrupted.
    """
    with ExitStack() as stack:
        submit = _local_submit(stack, inputs, workers)
        try:
            yield partial(_drain, submit=submit, most=2 * workers)
        except InterruptedWorker as error:
            raise KeyboardInterrupt from error


@contextmanager
def cluster(inputs: Inputs, address: str) -> Iterator[TaskRunner]:
    """Run tasks in the workers of a dask scheduler.

    Raises `QuadcosimError` if the scheduler cannot be reached, has no workers or no longer answers, and for failures
    not caused by a run.
    """
    with ExitStack() as stack, _losses_named(address):
        reached = _cluster(stack, inputs, address)
        yield partial(_drain, submit=reached.submit, most=2 * reached.threads, waiting_for=reached.check)


@dataclass(frozen=True, kw_only=True)
class _Cluster:
    """A dask scheduler that has the files of the runs."""

    submit: Submit
    check: Callable[[], None]
    """raises `QuadcosimError` if it has not answered for long"""
    threads: int


def _cluster(stack: ExitStack, inputs: Inputs, address: str) -> _Cluster:
    """The scheduler at an address, left with `stack`; raises `QuadcosimError` if it is not reached."""
    import asyncio

    import dask
    import distributed

    # The TimeoutErrors are distinct before Python 3.11.
    unreachable = (OSError, TimeoutError, asyncio.TimeoutError, ValueError)
    stack.enter_context(_silent("distributed", "tornado", "asyncio"))
    try:
        client: Any = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except unreachable as error:
        raise _unreachable(address, error) from error
    stack.callback(_close, client)

    async def begin() -> Any:
        await client.wait_for_workers(1, timeout=_WORKERS_PATIENCE)
        return await client.scheduler.ncores()

    def ask(question: Callable[[], Any]) -> "Future[Any]":
        return asyncio.run_coroutine_threadsafe(question(), client.loop.asyncio_loop)

    heartbeat = Heartbeat(address, lambda: ask(client.scheduler.ncores))
    begun = ask(begin)
    try:
        while not concurrent.futures.wait([begun], timeout=_POLL).done:
            heartbeat.check()
        threads = begun.result()
    except unreachable as error:
        raise _unreachable(address, error) from error
    # Files are sent once, as a task: scattered data are lost with the worker that holds them, a task is done again.
    with dask.config.set({"distributed.admin.large-graph-warning-threshold": sys.maxsize}):
        held = client.submit(held_on_cluster, inputs, key=f"Inputs-{inputs.digest}")
    executor = client.get_executor(pure=False)
    stack.callback(executor.shutdown, wait=False)

    def submit(task: RunTask | TaskBatch) -> "Future[Results]":
        return executor.submit(run_on_cluster, task, held)  # type: ignore[no-any-return]

    return _Cluster(submit=submit, check=heartbeat.check, threads=max(1, sum(threads.values())))


@contextmanager
def _losses_named(address: str) -> Iterator[None]:
    """Raise `QuadcosimError` for a scheduler or workers that are lost."""
    import distributed

    try:
        yield
    except (concurrent.futures.CancelledError, OSError, distributed.KilledWorker) as error:
        raise QuadcosimError(
            f"--dask {address}: the scheduler or its workers were lost ({type(error).__name__}); {_KEPT}"
        ) from error


class Heartbeat:
    """Whether a scheduler answers and has workers: a warning says that it does not, an error that it has not long."""

    def __init__(
        self, address: str, ask: Callable[[], "Future[Any]"], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`ask` begins a question to it, whose answer is its workers."""
        self._address, self._ask, self._clock = address, ask, clock
        self._question, self._since, self._is_told = ask(), clock(), False

    def check(self) -> None:
        """Look for an answer, and ask again once there is one; raises `QuadcosimError` after `SILENCE`."""
        now = self._clock()
        if self._question.done():
            if self._question.exception() is None and self._question.result():
                self._since, self._is_told = now, False
            self._question = self._ask()
        silence = now - self._since
        if silence > SILENCE:
            raise QuadcosimError(
                f"--dask {self._address}: the scheduler has not answered for {SILENCE:g} s, or has no workers; {_KEPT}"
            )
        if silence > TOLD_AFTER and not self._is_told:
            self._is_told = True
            warn(
                f"the dask scheduler {self._address} has not answered for {TOLD_AFTER:g} s, or has no workers; the "
                f"sweep ends after {SILENCE:g} s"
            )


def _unreachable(address: str, error: BaseException) -> QuadcosimError:
    return QuadcosimError(f"--dask {address}: expected a dask scheduler with workers there: {error}")


@contextmanager
def _silent(*libraries: str) -> Iterator[None]:
    """Keep what libraries log, as tracebacks of lost connections, from standard error: the loss is one line here."""
    found = [name for name in logging.Logger.manager.loggerDict if name.partition(".")[0] in libraries]
    loggers = [logging.getLogger(name) for name in {*found, *libraries}]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels):
            logger.setLevel(level)


def _close(client: Any) -> None:
    """Close a client whose scheduler may not answer."""
    with contextlib.suppress(Exception):
        client.close(timeout=_PATIENCE)


def expect_workers(workers: int) -> None:
    """Raise `UsageError` for what is no number of processes."""
    if isinstance(workers, bool) or not isinstance(workers, numbers.Integral) or workers < 1:
        raise UsageError(f"--workers {shown(workers)}: expected at least 1, a whole number")


def expect_scheduler(address: str) -> None:
    """Raise `UsageError` for an invalid address, `QuadcosimError` immediately if nothing listens there."""
    match = _ADDRESS.fullmatch(address)
    if match is None or not 0 < int(match[2]) < 65536:
        raise UsageError(f"--dask {address}: expected the address of a scheduler, as in tcp://host:8786")
    try:
        socket.create_connection((match[1].strip("[]"), int(match[2])), timeout=_PATIENCE).close()
    except OSError as error:
        raise _unreachable(address, error) from error


def held_on_cluster(inputs: Inputs) -> Inputs:
    """The inputs themselves; called in a dask worker, which then holds them for the others."""
    return inputs


def run_on_cluster(task: RunTask | TaskBatch, inputs: Inputs) -> Results:
    """The results of runs; called in a dask worker, simulates in a separate process there too."""
    with _POOLS_LOCK:
        if inputs.digest not in _POOLS:
            _POOLS[inputs.digest] = pool = Pool(inputs)
            atexit.register(pool.remove)  # last
            atexit.register(pool.close)
    return _POOLS[inputs.digest].run(task)


_POOLS: dict[str, Pool] = {}
_POOLS_LOCK = threading.Lock()


def _local_submit(stack: ExitStack, inputs: Inputs, workers: int) -> Submit:
    """A function that submits tasks to threads, each of which waits for a worker process; ends with `stack`."""
    pool = Pool(inputs)
    stack.callback(pool.remove)  # last: a thread may still have been starting a process
    executor = ThreadPoolExecutor(workers)
    stack.callback(executor.shutdown, cancel_futures=True)
    stack.callback(pool.close)  # first: it ends what the threads wait for
    stack.callback(executor.shutdown, wait=False, cancel_futures=True)
    return lambda task: executor.submit(pool.run, task)


def _drain(
    tasks: Iterable[RunTask | TaskBatch], submit: Submit, most: int, waiting_for: Callable[[], None] = lambda: None
) -> Generator[Rows, None, None]:
    """Keep `most` tasks in progress; yield their rows as they finish, of several the one that was begun first.

    `waiting_for` is called while none finishes.
    """
    waiting = iter(tasks)
    in_progress = {submit(task): task for task in islice(waiting, most)}
    try:
        while in_progress:
            done, _ = concurrent.futures.wait(
                in_progress, timeout=_POLL, return_when=concurrent.futures.FIRST_COMPLETED
            )
            if not done:
                waiting_for()
            finished = {future: in_progress.pop(future) for future in [*in_progress] if future in done}
            for future, task in finished.items():
                yield task.rows(future.result())
            in_progress |= {submit(task): task for task in islice(waiting, len(finished))}
    finally:
        for future in in_progress:
            future.cancel()
