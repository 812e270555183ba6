"""Runs tasks in worker processes, here or on a dask cluster, and yields the outcomes as they come."""

import asyncio
import concurrent.futures
import dataclasses
import multiprocessing
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from typing import Any

from orchestration.errors import QuadcosimError, UsageError
from orchestration.scenario import Scenario
from orchestration.studies.store import Row
from orchestration.studies.study import Fmus
from orchestration.studies.worker import HANGAR, Outcome, Task, fly_chunk, fly_local_chunk, prepare_process

ATTEMPTS = 3
"""How often a run that was under way when a worker died is tried before that is its result."""
CHUNK_SECONDS = 1.0
"""How long a chunk of runs should take."""

Submit = Callable[[Sequence[Task]], "Future[list[Outcome]]"]


class Pool:
    """Flies a few runs at a time for someone who decides by their metrics what to fly next."""

    def __init__(self, fmus: Fmus, workers: int) -> None:
        if workers < 1:
            raise UsageError(f"--workers {workers}: expected at least 1")
        self._fmus, self._workers = fmus, workers
        self._stack = ExitStack()
        self._executor: ProcessPoolExecutor | None = None

    def __enter__(self) -> "Pool":
        if self._workers > 1:
            self._executor = self._stack.enter_context(_pool(self._fmus, self._workers))
        return self

    def __exit__(self, *exception: object) -> None:
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)
        self._stack.close()

    def fly(self, scenarios: Sequence[Scenario], stop: Callable[[Any], bool]) -> list[Any]:
        """The metrics of the runs in their order, up to the first whose metrics `stop`, with any number of workers.

        Raises `QuadcosimError` if a run fails.
        """
        tasks = [
            Task(index=i, key="", settings={}, scenario=scenario, keep_signals=False)
            for i, scenario in enumerate(scenarios)
        ]
        found = []
        for outcome in self._outcomes(tasks):
            if outcome.row.metrics is None:
                raise QuadcosimError(str(outcome.row.message))
            found.append(outcome.row.metrics)
            if stop(found[-1]):
                break
        return found

    def _outcomes(self, tasks: Sequence[Task]) -> Iterator[Outcome]:
        if self._executor is None:
            paths = {"plant": self._fmus.plant, "controller": self._fmus.controller}
            for task in tasks:
                yield HANGAR.fly(dataclasses.replace(task, scenario=task.scenario.with_fmus(**paths)))
            return
        futures = [self._executor.submit(fly_local_chunk, [task]) for task in tasks]
        try:
            for future in futures:
                yield from future.result()
        except BrokenProcessPool as error:
            raise QuadcosimError("a worker process died while it flew; start again") from error
        finally:
            for future in futures:
                future.cancel()


def run_locally(tasks: Sequence[Task], fmus: Fmus, workers: int) -> Iterator[list[Outcome]]:
    """Outcomes of `tasks` from a pool of `workers` processes, chunk by chunk, in any order.

    After the death of a worker the pool is made anew; runs that were under way are tried again one by one,
    and fail after the third time.
    """
    waiting = deque(_chunks(tasks, workers))
    attempts: dict[int, int] = {}
    while waiting:
        with _pool(fmus, workers) as pool:
            under_way: dict[Future[list[Outcome]], Sequence[Task]] = {}
            try:
                yield from _drain(waiting, under_way, lambda chunk: pool.submit(fly_local_chunk, chunk), 2 * workers)
            except BrokenProcessPool:
                for chunk in under_way.values():
                    for task in chunk:
                        attempts[task.index] = attempts.get(task.index, 0) + 1
                        if attempts[task.index] < ATTEMPTS:
                            waiting.appendleft([task])
                        else:
                            yield [_killed(task)]


def run_on_dask(tasks: Sequence[Task], fmus: Fmus, address: str) -> Iterator[list[Outcome]]:
    """Outcomes of `tasks` from the workers of a dask scheduler, chunk by chunk, in any order.

    Raises `QuadcosimError` if the scheduler cannot be reached or has no workers.
    """
    import distributed

    with ExitStack() as stack:
        try:
            client: Any = stack.enter_context(distributed.Client(address, timeout=10, set_as_default=False))
            client.wait_for_workers(1, timeout=10)
        except (OSError, TimeoutError, asyncio.TimeoutError, ValueError) as error:  # two of a name before Python 3.11
            raise QuadcosimError(f"--dask {address}: expected a dask scheduler with workers there: {error}") from error
        # The FMUs travel once, by the hash of their content.
        contents = client.scatter([fmus.plant.read_bytes(), fmus.controller.read_bytes()], broadcast=True, hash=True)
        executor: Executor = stack.enter_context(client.get_executor(pure=False))
        workers = max(1, len(client.scheduler_info()["workers"]))
        waiting = deque(_chunks(tasks, workers))
        submit: Submit = lambda chunk: executor.submit(fly_chunk, chunk, *contents)  # noqa: E731
        try:
            yield from _drain(waiting, {}, submit, 2 * workers)
        except (concurrent.futures.CancelledError, OSError, distributed.KilledWorker) as error:
            raise QuadcosimError(
                f"--dask {address}: the scheduler or its workers were lost ({type(error).__name__}); what was flown is "
                "kept, start the sweep again"
            ) from error


def _drain(
    waiting: "deque[Sequence[Task]]", under_way: dict[Any, Sequence[Task]], submit: Submit, most: int
) -> Iterator[list[Outcome]]:
    """Keep at most `most` chunks under way until none waits; yield what is finished."""
    while waiting or under_way:
        while waiting and len(under_way) < most:
            under_way[submit(waiting[0])] = waiting[0]
            waiting.popleft()
        done, _ = concurrent.futures.wait(under_way, return_when=concurrent.futures.FIRST_COMPLETED)
        for future in done:
            outcomes = future.result()
            del under_way[future]
            yield outcomes


def _chunks(tasks: Sequence[Task], workers: int) -> list[Sequence[Task]]:
    """Runs of about a second together, but enough chunks that no worker waits long for the last one."""
    if not tasks:
        return []
    simulated = sum(task.scenario.stop_time for task in tasks) / len(tasks)
    guess = 0.1 * simulated  # seconds a run on one core, of the order of a plant at 1 kHz
    size = max(1, min(int(CHUNK_SECONDS / guess), len(tasks) // (8 * workers)))
    return [tasks[i : i + size] for i in range(0, len(tasks), size)]


def _pool(fmus: Fmus, workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=prepare_process,
        initargs=(fmus.plant, fmus.controller),
    )


def _killed(task: Task) -> Outcome:
    message = f"its worker process died {ATTEMPTS} times while it was under way"
    return Outcome(
        row=Row(
            index=task.index, key=task.key, settings=task.settings, seed=task.scenario.seed, metrics=None,
            message=message, duration=0.0,
        )
    )  # fmt: skip
