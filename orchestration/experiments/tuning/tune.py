"""Runs the searches of a tuning for every period and seed, without repeating finished ones."""

import dataclasses
import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from fmu_kit.new_files import new_files, write_atomically
from orchestration.experiments.studies.study_file import FileLike
from orchestration.experiments.tuning.exact import ExactTuning, ExactTuningResult, search_exactly
from orchestration.experiments.tuning.record import open_record
from orchestration.experiments.tuning.tuning import Tuning, TuningResult, search
from orchestration.experiments.tuning.tuning_file import gains_text, load_tuning
from orchestration.experiments.tuning.tuning_problem import Costs, SearchResult, TuningProblem, best_by_period
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.extras import explains_missing, needs
from orchestration.foundation.basics.terminal import ShareProgress, inform, share_reporter, warn
from orchestration.foundation.basics.unit_algebra import quantity, some
from orchestration.simulation.engines.master import BATCH
from orchestration.simulation.results import html
from orchestration.simulation.workers.choice import EngineChoice, Execution, choose_execution, single_run_execution
from orchestration.simulation.workers.executors import RunEvaluator
from orchestration.simulation.workers.provenance import versions
from orchestration.systems.system.check import describe_references
from orchestration.systems.system.files import Files

if TYPE_CHECKING:
    import pandas as pd

Result = TypeVar("Result", bound=SearchResult)
Find = Callable[[float | None, int, Callable[[float], None], Callable[[Costs], Costs]], Result]
"""Makes the result of a search from period, seed, progress function, and what keeps the costs of points"""


@dataclass(frozen=True, kw_only=True, repr=False)
class Tuned:
    """The result of a tuning."""

    searches: tuple[SearchResult, ...]
    """The results of all searches, one for each period and seed."""
    written: tuple[Path, ...]
    """The files of tuned parameters, one for each period, that scenario files and comparisons read."""

    @property
    def best(self) -> dict[float | None, SearchResult]:
        """By period [s], None for those of the base, the search with the lowest cost."""
        return {one.period: one for one in best_by_period(self.searches)}

    @property
    def verdict(self) -> str:
        """The lowest cost for each period, beside that of the file's own values."""
        costs = [
            f"{'own periods' if period is None else quantity(period, 's')} "
            + "; ".join(filter(None, [one.compared, one.convergence, one.of_ranges, one.judgement]))
            for period, one in self.best.items()
        ]
        return f"best of {len(self.searches)} searches: {some(costs, '; ')}"

    def __repr__(self) -> str:
        best = "; ".join(f"{result.place}: {result.judgement}" for result in self.best.values())
        return f"<Tuned: {len(self.searches)} searches; {best}>"

    def _repr_html_(self) -> str:
        """The form that notebooks show: the best search for each period."""
        rows = [
            (f"{name} at {result.place}", html.number(value), "")
            for result in self.best.values()
            for name, value in {**result.values, "cost": result.cost, **result.figures}.items()
        ]
        return html.card("A tuning", None, None, f"{len(self.searches)} searches", rows)

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each search: period [s], seed, tuned values, cost and the other fields of its result."""
        import pandas as pd

        table = pd.DataFrame(
            [
                {**{k: v for k, v in dataclasses.asdict(one).items() if k != "values"}, **one.values}
                for one in self.searches
            ]
        )
        table.attrs["units"] = {"period": "s"}
        return table


@needs("cma", "filelock")
def tune(
    tuning: Tuning | ExactTuning | FileLike,
    *,
    out: str | Path,
    folder: str | Path | None = None,
    workers: int = 1,
    dask: str | None = None,
    engine: EngineChoice = "auto",
    as_simulated: bool = False,
    command: str = "quadcosim.tune",
    progress: ShareProgress = "bar",
    announce: Callable[[str], None] | None = inform,
) -> Tuned:
    """Tune the parameters of a controller, by runs or by exact expectations.

    `tuning` may be the path of its file, or the content of the file as a dictionary, as `load_tuning` takes them.
    A `Tuning` runs an ensemble of initial conditions and is judged on others, by `workers` processes or those of a
    `dask` scheduler, and an engine, as in `sweep`. An `ExactTuning` needs no runs, but one that checks the
    result; it linearises native FMUs if available, `as_simulated` if so requested, as `expect`.

    Writes a file of parameters into `out` for each period; it names `command` as its origin. Costs and results are
    kept in `folder`, default `results/NAME`: called again after an interruption, it loses the generation of points that
    it was evaluating, and ends with the same result. `progress` is called with the share
    done, `announce` with a line for all and one for each search; None for silence.

    Raises `UsageError` for an invalid tuning, `QuadcosimError` if a run fails, `KeyboardInterrupt` after Ctrl-C.
    """
    tuning = load_tuning(tuning)
    folder, announce = Path(folder or Path("results") / tuning.name), announce or (lambda line: None)
    announce(tuning.effort)
    done: Sequence[SearchResult]
    if isinstance(tuning, Tuning):
        if as_simulated:
            raise UsageError('--as-simulated: expected cost.by = "expect"; the cost of this tuning is that of runs')
        tuning, done = _search_by_runs(tuning, folder, workers, dask, engine, progress, announce)
    elif workers != 1 or engine != "auto" or dask is not None:
        raise UsageError("--workers, --dask and --engine: expected none; a tuning by expect makes no runs")
    else:
        base, _ = single_run_execution(tuning.base, "auto")
        tuning = dataclasses.replace(tuning, as_simulated=as_simulated or tuning.as_simulated, base=base)
        with share_reporter(progress, "searching") as report:
            find = functools.partial(search_exactly, tuning)
            done = run_searches(
                tuning, tuning.files(), folder, find, ExactTuningResult, engine="", progress=report, announce=announce
            )
    return Tuned(searches=tuple(done), written=tuple(write(tuning, done, Path(out), command)))


def _search_by_runs(
    tuning: Tuning,
    folder: Path,
    workers: int,
    dask: str | None,
    engine: EngineChoice,
    progress: ShareProgress,
    announce: Callable[[str], None],
) -> tuple[Tuning, list[TuningResult]]:
    """A tuning by runs, as it is run, and the results of its searches."""
    execution = choose_execution(
        engine, tuning.native, lambda native: dataclasses.replace(tuning, native=native).first_run()
    )
    tuning = dataclasses.replace(tuning, native=execution.native)
    files = tuning.files()
    if engine == "auto":
        execution = _as_before(execution, lambda name: _place(tuning, files, folder, TuningResult, name))
        execution.tell(announce)
    if follows := describe_references(tuning.origin, files.models_of(tuning.origin)):
        announce(f"follows {follows}")
    evaluator = RunEvaluator(files, workers, execution.engine, dask=dask)
    with share_reporter(progress, "searching") as report, evaluator as pool:
        run = functools.partial(pool.run_all, in_lanes=execution.in_lanes)

        def find(
            period: float | None, seed: int, report: Callable[[float], None], keeping: Callable[[Costs], Costs]
        ) -> TuningResult:
            return search(tuning, period, seed, run, pool.run_all, report, keeping)

        return tuning, run_searches(
            tuning, files, folder, find, TuningResult, engine=execution.name, progress=report, announce=announce
        )


def run_searches(
    tuning: TuningProblem,
    files: Files,
    folder: Path,
    find: Find[Result],
    kind: type[Result],
    *,
    engine: str,
    progress: Callable[[float], None],
    announce: Callable[[str], None],
) -> list[Result]:
    """The results of all searches, of class `kind`, each made by `find`.

    They are kept in `folder`, with the costs of all points: of the same tuning with the same software and engine no
    search is repeated, and none that is interrupted evaluates a point again.
    """
    for text in dict.fromkeys(text for period in tuning.searched_periods for text in tuning.warnings(period)):
        warn(text)
    searches = [(period, seed) for period in tuning.searched_periods for seed in tuning.seeds]
    with open_record(_place(tuning, files, folder, kind, engine)) as record:
        done = record.results(kind)
        for i, (period, seed) in enumerate(searches):
            if any((one.period, one.seed) == (period, seed) for one in done):
                continue
            one = find(period, seed, _part(progress, i, len(searches)), functools.partial(record.keeping, period))
            record.add(one)
            done.append(one)
            announce(f"{one.place}, seed {seed}: cost {one.cost:.5g}, {one.convergence}; {one.judgement}")
            if one.note:
                announce(one.note)
    return done


def write(tuning: TuningProblem, done: Sequence[SearchResult], out: Path, command: str) -> list[Path]:
    """Write the files of tuned parameters, one for each period; their paths."""
    texts = {
        f"{tuning.name}_{_named_by(best.period)}.toml": gains_text(tuning, best, done, command)
        for best in best_by_period(done)
    }
    with new_files(out) as new:
        for name, text in texts.items():
            write_atomically(new / name, text)
    return [out / name for name in texts]


def _named_by(period: float | None) -> str:
    """The end of the name of a file of tuned parameters, never none: it might be the tuning file itself."""
    return "own_periods" if period is None else f"{1000.0 * period:g}ms"


def _part(progress: Callable[[float], None], index: int, count: int) -> Callable[[float], None]:
    """The progress of one of several searches."""
    return lambda share: progress((index + share) / count)


def _as_before(execution: Execution, place: Callable[[str], Path]) -> Execution:
    """What `auto` has chosen, but with the engine of the record that there is, if there is one, at its `place`.

    Raises `QuadcosimError` if that engine is not available.
    """
    for engine in (execution.name, BATCH, "compiled"):
        if place(engine).is_file():
            return execution.as_before(engine, str(place(engine)), f"--engine {execution.name} begins another record")
    return execution


def _place(tuning: TuningProblem, files: Files, folder: Path, kind: type[SearchResult], engine: str) -> Path:
    """The path of the record, by a hash of everything that a search depends on."""
    content_of_tuning = json.dumps(dataclasses.asdict(tuning), default=str)
    fields = [each.name for each in dataclasses.fields(kind)]
    content = [
        type(tuning).__name__,
        content_of_tuning,
        sorted(files.hashes.items()),
        sorted(versions().items()),
        fields,
        engine,
    ]
    return folder / f"{hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]}.sqlite"
