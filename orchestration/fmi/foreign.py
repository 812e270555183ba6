"""What is computed by FMUs of others is computed in a process of its own: however that ends, this one goes on."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from orchestration.basics.errors import SimulatorError
from orchestration.fmi.model import read_model
from orchestration.processes import subprocesses
from orchestration.processes.child import Child, Died
from orchestration.processes.limits import UNLIMITED, Limits

T = TypeVar("T")


class LostError(SimulatorError):
    """The process that FMUs of others were in has ended; the text says how."""


def computed(fmus: Iterable[Path], function: Callable[..., T], *arguments: object) -> T:
    """What a function gives, or raises, that loads these FMUs: here, if all of them are of this project's kit.

    Raises `LostError` if the process that it has else ends before.
    """
    if all(read_model(path).is_of_this_kit for path in fmus):
        return function(*arguments)
    command = subprocesses.command("orchestration.fmi.foreign_process")
    try:
        with Child(command, limits=replace(UNLIMITED, memory=Limits.memory)) as child:
            child.send((function, arguments))
            result, error = child.receive()
    except Died as death:
        raise LostError(f"the process of the FMUs {death}") from None
    if error is not None:
        raise error
    given: T = result
    return given
