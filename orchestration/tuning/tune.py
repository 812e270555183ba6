"""Searches for every period and seed of a tuning, and nothing twice."""

import dataclasses
import functools
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from orchestration.basics.errors import UsageError
from orchestration.basics.extras import explains_missing, needs
from orchestration.basics.progress import ShareProgress, share_reporter
from orchestration.basics.terminal import inform
from orchestration.building.inputs import Files
from orchestration.results import html
from orchestration.system.references import describe_references
from orchestration.tuning.exact import ExactFound, ExactTuning, search_exactly
from orchestration.tuning.sought import Outcome, Sought, best_by_period
from orchestration.tuning.tuning import Found, Tuning, search
from orchestration.tuning.tuning_file import gains_text
from orchestration.workers.choice import EngineChoice, choose_execution, single_run_execution
from orchestration.workers.executors import RunEvaluator
from orchestration.workers.provenance import versions

if TYPE_CHECKING:
    import pandas as pd

One = TypeVar("One", bound=Outcome)


@dataclass(frozen=True, kw_only=True, repr=False)
class Tuned:
    """What a tuning has found."""

    searches: tuple[Outcome, ...]
    """Every search, one for each period and seed."""
    written: tuple[Path, ...]
    """The files of tuned parameters, one for each period, that scenario files and comparisons read."""

    @property
    def best(self) -> dict[float, Outcome]:
        """By period [s] the search whose parameters cost least where they were tuned."""
        return {one.period: one for one in best_by_period(self.searches)}

    def __repr__(self) -> str:
        best = "; ".join(f"{period:g} s: {found.judgement}" for period, found in self.best.items())
        return f"<Tuned: {len(self.searches)} searches; {best}>"

    def _repr_html_(self) -> str:
        """As notebooks show it: the best of each period."""
        rows = [
            (f"{name} at {period:g} s", html.number(value), "")
            for period, found in self.best.items()
            for name, value in {**found.values, "cost": found.cost, **found.figures}.items()
        ]
        return html.card("A tuning", None, None, f"{len(self.searches)} searches", rows)

    @explains_missing
    def to_pandas(self) -> "pd.DataFrame":
        """A row for each search: period [s], seed, tuned values, cost, and what else is known of its outcome."""
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
    tuning: Tuning | ExactTuning,
    *,
    out: str | Path,
    folder: str | Path | None = None,
    workers: int = 1,
    engine: EngineChoice = "auto",
    command: str = "quadcosim.tune",
    progress: ShareProgress = "bar",
    announce: Callable[[str], None] | None = inform,
) -> Tuned:
    """Tune the parameters of a controller, by runs or by exact expectations.

    A `Tuning` flies an ensemble of starts and is judged on others: by `workers` processes and an engine as in `sweep`.
    An `ExactTuning` flies nothing; it measures native FMUs where they can be had.

    For each period of the tuning a file of parameters is written into `out`; it says that it was made by `command`.
    What each search has found is kept in `folder`, default `results/NAME`, so that no search is done twice. `progress`
    hears the share that is done, `announce` a line for each search; None for silence.

    Raises `UsageError` for what cannot be, `QuadcosimError` if a run fails, `KeyboardInterrupt` after Ctrl-C.
    """
    folder, announce = Path(folder or Path("results") / tuning.name), announce or (lambda line: None)
    done: Sequence[Outcome]
    if isinstance(tuning, Tuning):
        done = _flown(tuning, folder, workers, engine, progress, announce)
    elif workers != 1 or engine != "auto":
        raise UsageError("--workers and --engine: expected none; a tuning by expect flies nothing")
    else:
        exact = dataclasses.replace(tuning, base=single_run_execution(tuning.base, "auto")[0])
        with share_reporter(progress, "searching") as hear:
            find = functools.partial(search_exactly, exact)
            done = searched(exact, exact.files(), folder, find, ExactFound, progress=hear, announce=announce)
    return Tuned(searches=tuple(done), written=tuple(write(tuning, done, Path(out), command)))


def _flown(
    tuning: Tuning,
    folder: Path,
    workers: int,
    engine: EngineChoice,
    progress: ShareProgress,
    announce: Callable[[str], None],
) -> list[Found]:
    """What the searches of a tuning by runs find."""
    how = choose_execution(engine, tuning.native, lambda native: dataclasses.replace(tuning, native=native).first())
    asked = dataclasses.replace(tuning, native=how.native)
    files = asked.files()
    if engine == "auto":
        announce(str(how))
    if follows := describe_references(asked.origin, files.models_of(asked.origin)):
        announce(f"follows {follows}")
    with share_reporter(progress, "searching") as hear, RunEvaluator(files, workers, how.engine) as pool:
        fly = functools.partial(pool.run_all, in_lanes=how.in_lanes, on_gpu=how.on_gpu)

        def find(period: float, seed: int, heard: Callable[[float], None]) -> Found:
            return search(asked, period, seed, fly, pool.run_all, heard)

        return searched(asked, files, folder, find, Found, progress=hear, announce=announce)


def searched(
    tuning: Sought,
    files: Files,
    folder: Path,
    find: Callable[[float, int, Callable[[float], None]], One],
    kind: type[One],
    *,
    progress: Callable[[float], None],
    announce: Callable[[str], None],
) -> list[One]:
    """What each search finds, of a kind, by its period, seed and who hears its share; that is kept in `folder`.

    A search that is done, of the same tuning with the same software, is not done again.
    """
    record = folder / f"{_key(tuning, files, kind)[:16]}.json"
    done = [kind(**each) for each in json.loads(record.read_text())] if record.is_file() else []
    searches = [(period, seed) for period in tuning.periods for seed in tuning.seeds]
    for i, (period, seed) in enumerate(searches):
        if any((one.period, one.seed) == (period, seed) for one in done):
            continue
        one = find(period, seed, _part(progress, i, len(searches)))
        done.append(one)
        announce(f"period {period:g} s, seed {seed}: cost {one.cost:.5g}; {one.judgement}")
        folder.mkdir(parents=True, exist_ok=True)
        record.write_text(json.dumps([dataclasses.asdict(each) for each in done], indent=2))
    return done


def write(tuning: Sought, done: Sequence[Outcome], out: Path, command: str) -> Iterator[Path]:
    """Write the files of tuned parameters, one for each period; their paths."""
    out.mkdir(parents=True, exist_ok=True)
    for best in best_by_period(done):
        path = out / f"{tuning.name}_{1000.0 * best.period:g}ms.toml"
        path.write_text(gains_text(tuning, best, done, command))
        yield path


def _part(progress: Callable[[float], None], index: int, count: int) -> Callable[[float], None]:
    """The progress of one of several searches."""
    return lambda share: progress((index + share) / count)


def _key(tuning: Sought, files: Files, kind: type[Outcome]) -> str:
    """Of all that a search depends on."""
    asked = json.dumps(dataclasses.asdict(tuning), default=str)
    told = [each.name for each in dataclasses.fields(kind)]
    content = [type(tuning).__name__, asked, sorted(files.hashes.items()), sorted(versions().items()), told]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()
