"""Reads files that say what is tuned, and writes what was found."""

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, Literal

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.basics.typed_tables import table_of
from orchestration.studies.study_file import AxisTable, axis_of, base_of, load, loop_of
from orchestration.system.model import System
from orchestration.tuning.exact import ExactTuning
from orchestration.tuning.sought import Outcome, Sought
from orchestration.tuning.tuning import Tuning

By = Literal["runs", "expect"]


class CostTable(table_of(Sought, only=["cost"], called={"cost": "of"})):  # type: ignore[misc]
    """`[cost]`: by runs, of one that survives and of one that diverges; or its exact expectation, without a run."""

    by: By = "runs"
    """Whether runs are made, or the cost is what `quadcosim expect` gives."""
    bad: float | None = None
    """The cost of a run that diverges, or whose cost has no value; no run costs more."""


JUDGED = "judged"
"""Key of `[starts]`: how many more starts, after those that are tuned on, the result is judged on"""
USUALLY_JUDGED = 200
"""of them, unless told"""


class SearchTable(table_of(Sought, only=["periods", "evaluations", "seeds"])):  # type: ignore[misc]
    """`[search]`: the effort."""


@record()
class TuningFile:
    """The file: a scenario, or the path of one, and what of it is tuned."""

    cost: CostTable
    """What is made small."""
    search: SearchTable
    """How long is searched."""
    parameters: list[AxisTable]
    """What is tuned, each in a range: two at least."""
    starts: dict[str, Any] = field(default_factory=dict)
    """The initial states that are flown from; and `judged`: on how many more, after these, it is judged (200)."""
    name: str | None = None
    """What the files of the result are called by; without it, the name of the file."""
    scenario: str | None = None
    """The path of the scenario file, or by `expect` of the system file, whose parameters are tuned."""
    base: dict[str, Any] = field(default_factory=dict)
    """The same here instead of in a file of its own: its tables."""


def load_tuning(path: str | Path) -> Tuning | ExactTuning:
    """Read such a file; paths in it are relative to its folder.

    Raises `UsageError` for a file that cannot be read, a key that does not exist (naming those that do) or a value
    that cannot be.
    """
    return load(Path(path), "tuning file", TuningFile, _tuning)


def _tuning(file: TuningFile, path: Path) -> Tuning | ExactTuning:
    parameters = tuple(axis_of(table, path.parent) for table in file.parameters)
    for axis in parameters:
        if axis.values is not None or axis.multiplies:
            raise UsageError(f"parameters {axis.name}: expected start and stop, and what it sets")
    common: dict[str, Any] = {
        "name": file.name or path.stem, "parameters": parameters, "cost": file.cost.cost, **file.search.model_dump()
    }  # fmt: skip
    if file.cost.by == "expect":
        for key, given in (("cost.bad", file.cost.bad is not None), ("starts", bool(file.starts))):
            if given:
                raise UsageError(f'{key}: expected none with cost.by = "expect", which makes no runs')
        return ExactTuning(base=base_of(file, path.parent), **common)
    if file.cost.bad is None:
        raise UsageError("cost.bad: expected a value")
    base, starts = loop_of(file, path.parent), dict(file.starts)
    judged = starts.pop(JUDGED, USUALLY_JUDGED)
    if isinstance(judged, bool) or not isinstance(judged, int):
        raise UsageError(f"starts.{JUDGED} = {judged!r}: expected a valid integer")
    ensemble = base.ensemble(starts, beside=(JUDGED,))
    return Tuning(base=base, **common, bad=file.cost.bad, starts=ensemble, judged=judged)


def gains_text(tuning: Sought, best: Outcome, all_found: Sequence[Outcome], command: str) -> str:
    """The file of tuned gains: parameters by their tables, and where they come from in comments."""
    import tomli_w

    others = [one for one in all_found if one.period == best.period]
    of, *more = tuning.described()
    lines = [
        f"Tuned for a period of {best.period:g} s by: {command}",
        f"{best.evaluations} evaluations of {of}",
        *more,
        f"Of {len(others)} searches that of seed {best.seed} is taken: it costs least on these, {best.cost:.5g}.",
        *(f"Seed {one.seed}: {one.judgement}." for one in others),
    ]
    document: dict[str, Any] = {}
    for target, value in best.values.items():
        *tables, name = target.split(".", 3 if isinstance(tuning.base, System) else 1)
        place = document
        for table in tables:
            place = place.setdefault(table, {})
        place[name] = float(f"{value:.6g}")
    return "".join(f"# {line}\n" for line in lines) + "\n" + tomli_w.dumps(document)
