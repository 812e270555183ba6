"""Reads study files."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeAlias, TypeVar, cast

from orchestration.experiments.studies.axes import CONTROLLER, Axis, LinkedSettings, Scale, Value, span
from orchestration.experiments.studies.study import Study
from orchestration.foundation.basics.documents import copied_tables, read_toml, tables_in
from orchestration.foundation.basics.errors import UsageError, prefixed, shown
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.typed_tables import parsed, table_of
from orchestration.simulation.requests.request import load_request, request_from_tables
from orchestration.systems.system.distribution import as_text
from orchestration.systems.system.model import System
from orchestration.systems.system.paths import value_at
from orchestration.systems.system.request import ControlLoop, Request, system_of


@record()
class AxisTable:
    """`[[axes]]`: one or several targets, and a list, a range with a number, or a range to sample."""

    name: str
    """The name of the axis: a column of the table of runs."""
    sets: list[str] | None = None
    """The paths that get its value; without `sets` and `multiplies`, the name is the path."""
    multiplies: list[str] | None = None
    """The paths whose value in the base it multiplies."""
    values: list[Value | dict[str, Any]] | None = None
    """The values; a table is a distribution."""
    start: float | None = None
    """The first value of a range."""
    stop: float | None = None
    """The last value of a range."""
    number: int | None = None
    """The number of values in the range; a range without a number is sampled."""
    scale: Scale = "linear"
    """Whether the range has equal steps or equal ratios."""


@record()
class LabelledAxisTable(AxisTable):
    """`[[axes]]` of a study, whose values may have labels, or be designs: lists."""

    values: list[Value | dict[str, Any] | list[Value | dict[str, Any]]] | None = None  # type: ignore[assignment]
    """The values; a table is a distribution, a list a design: a value for each path of `sets`, `{}` for none."""
    labels: list[str] | None = None
    """The names of its values, in their order, which tables, figures and `--at` have in place of these."""


OF_BASE = dict.fromkeys(
    ("stop_time", "components"),
    'it is of a system or scenario file, which scenario = "FILE.toml" names here; or expected under [base]',
)
"""Hints where the keys of a base belong, for every file that has one"""
METRICS = "metrics of your own are expressions under [base.objectives], or [objectives] of the scenario or system file"


class DesignTable(
    table_of(  # type: ignore[misc]
        Study, only=["method", "samples", "design_seed", "vary_seed", "repeat"], called={"design_seed": "seed"}
    )
):
    """`[design]`: how axes without values are sampled, and which axis repeats."""


@record()
class StudyFile:
    """The study file: the base as the tables of a system or a scenario, or the path of one; axes, design."""

    name: str | None = None
    """The name of the study and of its folder in `results/`; default: that of the file."""
    scenario: str | None = None
    """The path of the system file or scenario file that the study varies."""
    base: dict[str, Any] = field(default_factory=dict)
    """The same given here instead of in a separate file: the tables of a system file or a scenario file."""
    axes: list[LabelledAxisTable] = field(default_factory=list)
    """The axes."""
    design: DesignTable = field(default_factory=DesignTable)
    """The sampling of the axes without values."""
    keep_signals: list[int] | bool = False
    """The runs whose signals are kept, by their index in the design; true for all."""
    ELSEWHERE: ClassVar[Mapping[str, str]] = {
        **OF_BASE,
        "metrics": METRICS,
        "objectives": METRICS,
        "controllers": "parameters of one of several controllers stand under [controllers.NAME] of a vehicle file, "
        'vehicle = "FILE.toml" under [base]; the same controller with several is what quadcosim compare takes',
    }
    """Hints where the content of these keys belongs"""


FileLike: TypeAlias = str | os.PathLike[str] | Mapping[str, Any]
"""The path of a file, or its content as a dictionary"""


def load_study(study: Study | FileLike) -> Study:
    """Read a study file; paths in it are relative to its folder.

    Its content may be given as a dictionary, in which `base` may be a system or a scenario; a study is returned as it
    is. Raises `UsageError` for a file that cannot be read, an unknown key (naming the known ones) or an invalid value.
    """
    return load(study, "Study", (Study,), StudyFile, _study)


class HasBase(Protocol):
    """A file that is based on a system or a scenario: its tables, or the path of one."""

    @property
    def scenario(self) -> str | None:
        """The path."""

    @property
    def base(self) -> dict[str, Any]:
        """The tables."""


File = TypeVar("File")
Result = TypeVar("Result")


def load(
    given: object,
    name: str,
    kinds: tuple[type, ...],
    shape: type[File],
    make: Callable[[File, Path], Result],
) -> Result:
    """What is one of some `kinds`, else that which `make` makes of a file of a shape, or of its content.

    `name` is that of the kinds in errors. Raises `UsageError` that names the file.
    """
    if isinstance(given, kinds):
        return cast("Result", given)
    if isinstance(given, Mapping):
        tables = copied_tables(given)
        if isinstance(base := tables.get("base"), Request):
            tables["base"] = tables_in(base.to_toml())
        return make(parsed(tables, shape), Path())
    if not isinstance(given, (str, os.PathLike)):
        raise UsageError(
            f"{shown(repr(given))}: expected a {name}, the path of a file of one, or its tables as a dictionary"
        )
    path = Path(given)
    tables = read_toml(path, f"{name.lower()} file")
    with prefixed(f"{path}: "):
        return make(parsed(tables, shape), path)


def base_of(file: HasBase, folder: Path) -> Request:
    """The system or scenario that a file is based on."""
    if file.scenario is not None and file.base:
        own = ", ".join(f"[{key}]" if isinstance(value, dict) else key for key, value in file.base.items())
        raise UsageError(f"scenario and base: expected one of them; put {own} into {file.scenario}")
    for key in ("scenario", "system"):
        if isinstance(name := file.base.get(key), str):
            raise UsageError(f'base.{key}: expected the path of a file in place of [base], as scenario = "{name}"')
    return load_request(folder / file.scenario) if file.scenario else request_from_tables(file.base, folder)


def control_loop_of(file: HasBase, folder: Path, otherwise: str) -> ControlLoop:
    """Likewise for files that need initial conditions.

    Raises `UsageError` for a system without known ones, which says what takes it `otherwise`; also for one that stands
    in the wrong place.
    """
    named = next((name for key in ("system", "scenario") if isinstance(name := file.base.get(key), str)), "")
    misplaced = load_request(folder / named) if (folder / named).is_file() else None
    base = misplaced if isinstance(misplaced, System) else base_of(file, folder)
    if not isinstance(base, ControlLoop):
        raise UsageError(f"base: expected a scenario of the quadrotor, whose initial conditions are known{otherwise}")
    return base


def _study(file: StudyFile, path: Path) -> Study:
    if file.design.design_seed < 0:
        raise UsageError(f"design.seed = {file.design.design_seed}: expected a whole number from 0")
    for table in file.axes:
        _expect_designs(table)
    axes = tuple(axis_of(table) for table in file.axes)
    settings = [_settings(table, axis) for table, axis in zip(file.axes, axes)]
    base, together = _with_controllers(base_of(file, path.parent), axes, settings)
    axes, together = _labelled(file.axes, axes, settings, together)
    study = Study(
        name=file.name or path.stem,
        base=base,
        axes=axes,
        together=together,
        **file.design.as_dict(),
        keep_signals=file.keep_signals if isinstance(file.keep_signals, bool) else tuple(file.keep_signals),
        folder=path.parent.absolute(),
    )
    if not study.points:
        raise UsageError("axes: expected at least one point")
    _expect_consumed(file, study)
    return study


Settings: TypeAlias = Sequence[Mapping[str, Value]]
"""The value of each path that an axis sets, for each of its values"""


def _settings(table: LabelledAxisTable, axis: Axis) -> Settings:
    """What the values of an axis set."""
    if _has_designs(table):
        designs = [given for given in table.values or () if isinstance(given, list)]
        return [
            {path: value for path, value, item in zip(axis.targets, _values(given), given) if item != {}}
            for given in designs
        ]
    return [dict.fromkeys(axis.targets, value) for value in axis.values or ()]


def _expect_designs(table: LabelledAxisTable) -> None:
    """Raise `UsageError` for lists that do not fit the paths of their axis."""
    paths = table.sets or []
    for given in table.values or () if _has_designs(table) else ():
        if not isinstance(given, list) or len(given) != len(paths) or len({*paths}) < len(paths):
            one_each = f"one for each path of sets = {shown(paths)}"
            raise UsageError(f"axis {table.name}: values has {shown(given)}: expected lists of values, {one_each}")


def _has_designs(table: LabelledAxisTable) -> bool:
    return any(isinstance(value, list) for value in table.values or ())


def _with_controllers(
    base: Request, axes: tuple[Axis, ...], settings: Sequence[Settings]
) -> tuple[Request, tuple[LinkedSettings, ...]]:
    """The base, and what an axis of controllers sets besides: each has the parameters of the base's vehicle for it."""
    of_controllers = [each for each in zip(axes, settings) if {*each[0].targets} & CONTROLLER]
    if not of_controllers or not isinstance(base, ControlLoop) or base.vehicle is None:
        return base, ()
    vehicle, bare = base.vehicle, base.without_vehicle()
    sets: dict[tuple[Value, ...], dict[str, Value]] = {}
    chosen, own = of_controllers[0]
    for value, choice in zip(chosen.values or (), own):
        parameters = vehicle.parameters_for(str(next(choice[target] for target in choice if target in CONTROLLER)))
        for axis in axes:
            for target in {*axis.targets} & parameters.keys():
                raise UsageError(
                    f"axis {axis.name}: {target} is the vehicle's, expected no axis of it beside one of controllers"
                )
        given = {name for name in parameters if value_at(system_of(bare), *bare.paths_of(name)) is not None}
        sets[value,] = {name: value for name, value in parameters.items() if name not in given}
    return bare, (LinkedSettings(axes=(chosen.name,), sets=sets),)


def _labelled(
    tables: list[LabelledAxisTable],
    axes: tuple[Axis, ...],
    settings: Sequence[Settings],
    together: tuple[LinkedSettings, ...],
) -> tuple[tuple[Axis, ...], tuple[LinkedSettings, ...]]:
    """The axes with labels as their values, and what these stand for, before what was `together` already.

    Designs without labels have the text of their values as theirs.
    """
    named, stands_for = list(axes), []
    for i, (table, axis) in enumerate(zip(tables, axes)):
        if table.labels is None and not _has_designs(table):
            continue
        values = axis.values or ()
        names = list(map(str, values)) if table.labels is None else table.labels
        if axis.multiplies or not len({*names}) == len(names) == len(values):
            raise UsageError(
                f"axis {axis.name}: labels = {shown(names)}: expected a different one for each value that it sets"
            )
        sets: dict[tuple[Value, ...], Mapping[str, Value]] = {
            (name,): changes for name, changes in zip(names, settings[i])
        }
        stands_for.append(LinkedSettings(axes=(axis.name,), sets=sets))
        label = dict(zip(values, names))
        together = tuple(
            replace(each, sets={(label[key[0]],): changes for key, changes in each.sets.items()})
            if each.axes == (axis.name,)
            else each
            for each in together
        )
        named[i] = replace(axis, targets=(), values=tuple(names))
    return tuple(named), (*stands_for, *together)


def _expect_consumed(file: StudyFile, study: Study) -> None:
    """Raise `UsageError` for sampling keys without sampled axes, and for indices of runs that do not exist."""
    if all(axis.values is not None for axis in study.axes):
        for key, field in (("method", "method"), ("samples", "samples"), ("seed", "design_seed")):
            if getattr(file.design, field) != getattr(Study, field):
                raise UsageError(f"design.{key}: expected none; every axis has its values, so nothing is sampled")
    for index in () if isinstance(study.keep_signals, bool) else study.keep_signals:
        if not 0 <= index < len(study.points):
            raise UsageError(f"keep_signals: {index}: expected the indices of runs, from 0 to {len(study.points) - 1}")


def axis_of(table: AxisTable) -> Axis:
    """The axis of a table; raises `UsageError` for an invalid one."""
    if table.sets is not None and table.multiplies is not None:
        raise UsageError(f"axis {table.name}: expected sets or multiplies, not both")
    targets = tuple(table.multiplies or table.sets or [table.name])
    ranged = table.start is not None and table.stop is not None
    range_keys = (table.start, table.stop, table.number) != (None, None, None) or table.scale != "linear"
    if (table.values is None) != ranged or (table.values is not None and range_keys):
        raise UsageError(f"axis {table.name}: expected values, or start and stop, with number or to be sampled")
    values: tuple[Value, ...] | None = None if table.values is None else _values(table.values)
    low, high = table.start or 0.0, 1.0 if table.stop is None else table.stop
    if table.number is not None:
        values = span(table.name, low, high, table.number, table.scale)
    return Axis(
        name=table.name,
        targets=targets,
        multiplies=table.multiplies is not None,
        values=values,
        low=low,
        high=high,
        scale=table.scale,
    )


def _values(listed: Iterable[Value | dict[str, Any] | list[Any]]) -> tuple[Value, ...]:
    """Listed values, distributions as the text of their table, designs as that of their values."""
    return tuple(
        as_text(value)
        if isinstance(value, dict)
        else ", ".join(map(str, _values(value)))
        if isinstance(value, list)
        else value
        for value in listed
    )
