"""Reads files that say what is tuned, and writes what was found."""

from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from orchestration.basics.errors import UsageError
from orchestration.basics.records import record
from orchestration.basics.typed_tables import table_of
from orchestration.studies.study_file import AxisTable, axis_of, load, loop_of
from orchestration.tuning.tuning import Found, Tuning


class CostTable(table_of(Tuning, only=["cost", "bad"], called={"cost": "of"})):  # type: ignore[misc]
    """`[cost]`: of a run that survives, by its objectives, and of one that diverges."""


JUDGED = "judged"
"""Key of `[starts]`: how many more starts, after those that are tuned on, the result is judged on"""
USUALLY_JUDGED = 200
"""of them, unless told"""


class SearchTable(table_of(Tuning, only=["periods", "evaluations", "seeds"])):  # type: ignore[misc]
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
    """The path of the scenario file whose controller is tuned."""
    base: dict[str, Any] = field(default_factory=dict)
    """The same here instead of in a file of its own: the tables of a scenario file."""


def load_tuning(path: str | Path) -> Tuning:
    """Read such a file; paths in it are relative to its folder.

    Raises `UsageError` for a file that cannot be read, a key that does not exist (naming those that do) or a value
    that cannot be.
    """
    return load(Path(path), "tuning file", TuningFile, _tuning)


def _tuning(file: TuningFile, path: Path) -> Tuning:
    base = loop_of(file, path.parent)
    parameters = tuple(axis_of(table, path.parent) for table in file.parameters)
    for axis in parameters:
        if axis.values is not None or axis.multiplies:
            raise UsageError(f"parameters {axis.name}: expected start and stop, and what it sets")
    starts = dict(file.starts)
    judged = starts.pop(JUDGED, USUALLY_JUDGED)
    if isinstance(judged, bool) or not isinstance(judged, int):
        raise UsageError(f"starts.{JUDGED} = {judged!r}: expected a valid integer")
    return Tuning(
        name=file.name or path.stem,
        base=base,
        parameters=parameters,
        **file.cost.model_dump(),
        **file.search.model_dump(),
        starts=base.ensemble(starts, beside=(JUDGED,)),
        judged=judged,
    )


def gains_text(tuning: Tuning, best: Found, all_found: Sequence[Found], command: str) -> str:
    """The file of tuned gains: parameters by their tables, and where they come from in comments."""
    import tomli_w

    others = [one for one in all_found if one.period == best.period]
    lines = [
        f"Tuned for a period of {best.period:g} s by: {command}",
        f"{best.evaluations} evaluations of the mean of ({tuning.cost}), {tuning.bad:g} where it diverges,",
        f"over {tuning.starts.count} starts and {tuning.origin.stop_time:g} s.",
        f"Of {len(others)} searches that of seed {best.seed} is taken: it costs least on these, {best.cost:.5g}.",
        *(f"Seed {one.seed}: {one.judgement}." for one in others),
    ]
    tables: dict[str, dict[str, float]] = {}
    for target, value in best.values.items():
        side, _, name = target.partition(".")
        tables.setdefault(side, {})[name] = float(f"{value:.6g}")
    return "".join(f"# {line}\n" for line in lines) + "\n" + tomli_w.dumps(tables)
