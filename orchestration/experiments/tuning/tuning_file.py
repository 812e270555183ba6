"""Reads tuning files, and writes files of tuned parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, ClassVar, Literal

from orchestration.experiments.studies.study_file import (
    OF_BASE,
    AxisTable,
    FileLike,
    axis_of,
    base_of,
    control_loop_of,
    load,
)
from orchestration.experiments.tuning.exact import ExactTuning
from orchestration.experiments.tuning.tuning import Tuning
from orchestration.experiments.tuning.tuning_problem import SearchResult, TuningProblem
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.typed_tables import table_of
from orchestration.simulation.workers.provenance import versions
from orchestration.systems.system.description import describe_clock, describe_faults
from orchestration.systems.system.model import System
from orchestration.systems.system.starts import Starts

By = Literal["runs", "expect"]


class CostTable(table_of(TuningProblem, only=["cost"], called={"cost": "of"})):  # type: ignore[misc]
    """`[cost]`: the cost of a run, and of one that diverges; or its exact expectation, without runs."""

    by: By = "runs"
    """`runs`: the cost is evaluated by runs; `expect`: it is the exact expectation, as of `quadcosim expect`."""
    bad: float | None = None
    """The cost of a run that diverges, or whose cost has no value; no run costs more."""


class StartsTable(table_of(Starts)):  # type: ignore[misc]
    """`[starts]`: the initial conditions."""

    judged: int = 200
    """The number of further initial conditions that the result is judged on."""


class SearchTable(table_of(TuningProblem, only=["periods", "evaluations", "seeds"])):  # type: ignore[misc]
    """`[search]`: the effort."""


@record()
class TuningFile:
    """The tuning file: a scenario, or the path of one, and its parameters to tune."""

    cost: CostTable
    """The cost to minimise."""
    search: SearchTable
    """The effort of the search."""
    parameters: list[AxisTable]
    """The parameters to tune, each in a range: at least one."""
    starts: StartsTable | None = None
    """The initial conditions, and how many others the result is judged on."""
    name: str | None = None
    """The beginning of the names of the written files; default: the name of this file."""
    scenario: str | None = None
    """The path of the scenario file, or with `expect` of the system file, whose parameters are tuned."""
    base: dict[str, Any] = field(default_factory=dict)
    """The same given here instead of in a separate file: its tables."""
    ELSEWHERE: ClassVar[Mapping[str, str]] = {
        key: f'{hint}; the cost of a system is by = "expect" under [cost], and one by runs is for quadcosim sweep'
        for key, hint in OF_BASE.items()
    }


def load_tuning(tuning: Tuning | ExactTuning | FileLike) -> Tuning | ExactTuning:
    """Read a tuning file; paths in it are relative to its folder.

    Its content may be given as a dictionary, in which `base` may be a system or a scenario; a tuning is returned as it
    is. Raises `UsageError` for a file that cannot be read, an unknown key (naming the known ones) or an invalid value.
    """
    return load(tuning, "Tuning", (Tuning, ExactTuning), TuningFile, _tuning)


def _tuning(file: TuningFile, path: Path) -> Tuning | ExactTuning:
    parameters = tuple(axis_of(table) for table in file.parameters)
    for axis in parameters:
        if axis.values is not None or axis.multiplies:
            raise UsageError(f"parameters {axis.name}: expected start and stop, and what it sets")
    common: dict[str, Any] = {
        "name": file.name or path.stem, "parameters": parameters, "cost": file.cost.cost, **file.search.as_dict()
    }  # fmt: skip
    if file.cost.by == "expect":
        for key, present in (("cost.bad", file.cost.bad is not None), ("starts", file.starts is not None)):
            if present:
                raise UsageError(f'{key}: expected none with cost.by = "expect", which makes no runs')
        return ExactTuning(base=base_of(file, path.parent), **common)
    of_others = 'cost.by = "expect" for another system; runs of any system, and costs of them, are for quadcosim sweep'
    base = control_loop_of(file, path.parent, f", or {of_others}")
    if file.cost.bad is None:
        raise UsageError("cost.bad: expected a value")
    starts = file.starts or StartsTable()
    ensemble = Starts(**starts.as_dict(without=("judged",)))
    return Tuning(base=base, **common, bad=file.cost.bad, starts=ensemble, judged=starts.judged)


def gains_text(tuning: TuningProblem, best: SearchResult, all_results: Sequence[SearchResult], command: str) -> str:
    """The content of a file of tuned parameters by their tables, with their origin in comments."""
    import tomli_w

    others = [one for one in all_results if one.period == best.period]
    of, *more = tuning.describe_cost()
    system, known = tuning.system(best.period, best.values), versions()
    faults = [f"{x.name} {text}" for x in system.connections if (text := describe_faults(x))] or ["no faults"]
    software = f"quadcosim {known['quadcosim']}, sources {known['sources'][:16]}, numpy {known['numpy']}"
    periods = "the periods of the file" if best.period is None else f"a period of {best.period:g} s"
    lines = [
        f"Tuned for {periods} by: {command}",
        f"{best.evaluations} evaluations of {of}",
        *more,
        f"The loop is {'; '.join([describe_clock(system), *faults])}. By {software}.",
        *tuning.warnings(best.period),
        f"Of {len(others)} searches that of seed {best.seed} is taken, of least {best.compared}.",
        *([f"{best.of_ranges}."] if best.of_ranges else []),
        *(f"Seed {one.seed}: {one.convergence}; {one.judgement}." for one in others),
    ]
    document: dict[str, Any] = {}
    for target, value in best.values.items():
        *tables, name = target.split(".", 3 if isinstance(tuning.base, System) else 1)
        place = document
        for table in tables:
            place = place.setdefault(table, {})
        place[name] = float(f"{value:.6g}")
    return "".join(f"# {line}\n" for line in lines) + "\n" + tomli_w.dumps(document)
