"""Calls that load third-party FMUs run in a separate process: however that ends, this process goes on."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from orchestration.components.fmi.read_description import read_model
from orchestration.foundation.basics.errors import SimulatorError
from orchestration.foundation.processes import subprocesses
from orchestration.foundation.processes.child import Child, Died
from orchestration.foundation.processes.resource_limits import UNLIMITED, Limits
from orchestration.foundation.processes.typed_frames import result_kind

T = TypeVar("T")


class LostError(SimulatorError):
    """The process of third-party FMUs has ended; the text states how."""


def isolated_call(fmus: Iterable[Path], function: Callable[..., T], *arguments: object) -> T:
    """Call a function that loads these FMUs, in a separate process unless all of them were built here from this
    project's sources.

    Returns or raises what the function does. Raises `LostError` if the process ends before.
    """
    if all(read_model(path).is_own for path in fmus):
        return function(*arguments)
    try:
        with Child(
            subprocesses.Module("orchestration.components.fmi.foreign_process", (), loads=(function.__module__,)),
            limits=replace(UNLIMITED, memory=Limits.memory),
        ) as child:
            child.send((function, arguments))
            result, error = child.receive(tuple[result_kind(function) | None, Exception | None])  # type: ignore[misc]
    except Died as death:
        raise LostError(f"the process of the FMUs {death}") from None
    if error is not None:
        raise error
    value: T = result
    return value
