"""The choice of an engine for many runs: by default the fastest available, with the reason if it is not the fastest."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, cast, get_args

from orchestration.components.building.fmus import native_twins
from orchestration.components.fmi.foreign_calls import isolated_call
from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import QuadcosimError, UsageError, expected_name
from orchestration.foundation.basics.terminal import warn
from orchestration.simulation.engines.batch.shape import expect_lanes
from orchestration.simulation.engines.master import BATCH, Engine, engine_named
from orchestration.simulation.engines.resolved import check_against_fmus
from orchestration.systems.system.files import Files, files_of, with_files
from orchestration.systems.system.model import System
from orchestration.systems.system.request import Twin, system_of

EngineChoice = Literal["auto", "python", "compiled", "batch"]
"""`auto`: `batch` if available, else native FMUs one at a time, else the FMUs as they are"""


@dataclass(frozen=True, kw_only=True)
class Execution:
    """How a number of runs is executed."""

    native: bool
    """whether with the native twins of the FMUs"""
    in_lanes: bool
    """whether many at once, in SIMD lanes"""
    engine: Engine | None
    """Engine for runs one at a time; None: the fastest that each can use"""
    reason: str | None = None
    """why `auto` did not choose the fastest"""
    failed: bool = False
    """whether that is a failure here, as of a compiler, and not what the runs are"""

    @property
    def name(self) -> str:
        """The name as in `--engine`."""
        return BATCH if self.in_lanes else self.engine or "compiled"

    def __str__(self) -> str:
        if self.in_lanes:
            return f"engine {self.name}: native FMUs, many runs at once"
        what = "native FMUs" if self.native else "the FMUs as they are"
        return f"engine {self.name}: {what}, one run at a time" + (f" ({self.reason})" if self.reason else "")

    def tell(self, announce: Callable[[str], None]) -> None:
        """Announce it, or warn where the fastest has failed: other engines have other last bits."""
        (warn if self.failed else announce)(str(self))

    def as_before(self, engine: str, where: str, remedy: str) -> "Execution":
        """What `auto` has chosen, but with the engine of what was begun before; raises `QuadcosimError` without it."""
        if engine == self.name:
            return self
        if engine == BATCH:
            raise QuadcosimError(f"{where}: expected engine {BATCH}, as of the runs there ({self.reason}); {remedy}")
        reason = "as the runs there"
        return replace(self, in_lanes=False, engine=engine_named(engine), reason=reason, failed=False)


def engine_choice(name: str) -> EngineChoice:
    """The engine of this name; raises `UsageError` for an unknown name."""
    known = get_args(EngineChoice)
    if name not in known:
        raise UsageError(f"--engine {name}: {expected_name(name, known)}")
    return cast(EngineChoice, name)


def choose_execution(
    engine: EngineChoice,
    native: bool,
    first: Callable[[bool], tuple[System, Files]],
    *,
    no_lanes: Callable[[], str | None] = lambda: None,
) -> Execution:
    """How runs are executed by an engine, with native twins if `native` is requested.

    `first` returns the first run, checked, and its files, with native twins or not; `no_lanes`, called after it, a
    reason that rules out lanes. Raises `UsageError`, naming the obstacle, if requested lanes are impossible.
    """
    engine = engine_choice(engine)
    if engine in ("python", "compiled"):
        return Execution(native=native, in_lanes=False, engine=engine)
    if engine == BATCH:
        checked = first(True)
        if (why := no_lanes()) is not None:
            raise UsageError(f"--engine {engine}: {why}")
        _expect_lanes(*checked)
        return Execution(native=True, in_lanes=True, engine=None)
    try:
        system, files = first(True)
    except QuadcosimError as error:  # an invalid request is reported when it is run
        return _slower(native, error)
    try:
        if (why := no_lanes()) is not None:
            raise UsageError(why)
        _expect_lanes(system, files)
    except QuadcosimError as error:
        return _slower(True, error)
    return Execution(native=True, in_lanes=True, engine=None)


def _slower(native: bool, error: QuadcosimError) -> Execution:
    """Runs one at a time, after an error of what is faster; a `UsageError` says that they cannot be otherwise."""
    return Execution(
        native=native, in_lanes=False, engine=None, reason=str(error), failed=not isinstance(error, UsageError)
    )


def _expect_lanes(system: System, files: Files) -> None:
    isolated_call(files.fmus.values(), _compile_lanes, with_files(system, {**files.fmus, **files.tables}))


def _compile_lanes(system: System) -> None:
    models = {name: read_model(Path(each.fmu), each.access) for name, each in system.components.items()}
    expect_lanes(check_against_fmus(system, models).system, models)


def single_run_execution(request: Twin, engine: Engine | Literal["auto"]) -> tuple[Twin, Execution]:
    """The request to run one at a time, and how: with `auto`, the native twins of its FMUs if available."""
    if engine != "auto":
        return request, Execution(native=False, in_lanes=False, engine=engine_named(engine, "auto"))
    native = native_twins(request)
    try:
        files_of(system_of(native))
    except QuadcosimError as error:
        return request, _slower(False, error)
    return native, Execution(native=True, in_lanes=False, engine=None)
