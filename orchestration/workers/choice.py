"""What flies many runs where nobody asks for an engine: the fastest that can be had, and why not a faster one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, cast, get_args

from orchestration.basics.errors import QuadcosimError, UsageError, expected_name
from orchestration.building.fmus import native_twins
from orchestration.building.inputs import Files, files_of
from orchestration.engines.batch.shape import expect_lanes
from orchestration.engines.engine import Engine
from orchestration.engines.wiring import checked
from orchestration.system.model import System
from orchestration.system.request import Twin, system_of

EngineChoice = Literal["auto", "python", "compiled", "batch", "cuda"]
"""`auto`: `batch` where it can be had, else native FMUs one at a time, else the FMUs as they are"""


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """How many runs are flown."""

    native: bool
    """whether by the native twins of the FMUs"""
    in_lanes: bool
    """whether many at once, as lanes of batches"""
    engine: Engine | None
    """of runs that are flown one at a time; None: the fastest that each can have"""
    reason: str | None = None
    """why it is not the fastest, where that was to be taken"""
    on_gpu: bool = False
    """whether the lanes are threads of a GPU"""

    @property
    def name(self) -> str:
        """As `--engine` has it."""
        if self.in_lanes:
            return "cuda" if self.on_gpu else "batch"
        return self.engine or "compiled"

    def __str__(self) -> str:
        if self.in_lanes:
            return f"engine {self.name}: native FMUs, many runs at once"
        what = "native FMUs" if self.native else "the FMUs as they are"
        return f"engine {self.name}: {what}, one run at a time" + (f" ({self.reason})" if self.reason else "")


def choice_named(name: str) -> EngineChoice:
    """The engine of that name; raises `UsageError` for another name than those that there are."""
    known = get_args(EngineChoice)
    if name not in known:
        raise UsageError(f"--engine {name}: {expected_name(name, known)}")
    return cast(EngineChoice, name)


def chosen(
    engine: EngineChoice, native: bool, first: Callable[[bool], tuple[System, Files]], *, apart: str | None = None
) -> Chosen:
    """How runs are flown by an engine, with `native` if that was asked for.

    `first` gives the first run, checked, and its files, by native twins or not; `apart` is why runs are no lanes,
    whatever they are. Raises `UsageError` naming what stands in the way of lanes if these were asked for, and
    `QuadcosimError` without a GPU if that was.
    """
    if engine in ("python", "compiled"):
        return Chosen(native=native, in_lanes=False, engine=engine)
    if engine in ("batch", "cuda"):
        if apart is not None:
            raise UsageError(f"--engine {engine}: {apart}")
        if engine == "cuda":
            from orchestration.engines.cuda.fleet import expect_gpu  # others need not wait for what it loads

            expect_gpu()
        _expect_lanes(*first(True))
        return Chosen(native=True, in_lanes=True, engine=None, on_gpu=engine == "cuda")
    try:
        system, files = first(True)
    except QuadcosimError as error:  # what is wrong with the request is said by whoever flies it
        return Chosen(native=native, in_lanes=False, engine=None, reason=str(error))
    try:
        if apart is not None:
            raise UsageError(apart)
        _expect_lanes(system, files)
    except QuadcosimError as error:
        return Chosen(native=True, in_lanes=False, engine=None, reason=str(error))
    return Chosen(native=True, in_lanes=True, engine=None)


def _expect_lanes(system: System, files: Files) -> None:
    models = files.models_of(system)
    expect_lanes(checked(system, models).system, models)


def alone(request: Twin, engine: Engine | Literal["auto"]) -> tuple[Twin, Chosen]:
    """What is flown one run at a time, and how: by `auto` the native twins of its FMUs where they can be had."""
    if engine != "auto":
        return request, Chosen(native=False, in_lanes=False, engine=engine)
    native = native_twins(request)
    try:
        files_of(system_of(native))
    except QuadcosimError as error:
        return request, Chosen(native=False, in_lanes=False, engine=None, reason=str(error))
    return native, Chosen(native=True, in_lanes=False, engine=None)
