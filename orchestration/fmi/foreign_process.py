"""The process of a call: `python -m orchestration.fmi.foreign_process` is told a function and its arguments."""

import pickle
from typing import Any

from orchestration.basics.errors import QuadcosimError
from orchestration.processes.channel import Parent


def main() -> None:
    """Say what comes of the call, or what it raises."""
    parent = Parent()
    result = error = None
    try:
        function, arguments = parent.receive()
        result = function(*arguments)
        _expect_passable(result, f"the result of {getattr(function, '__name__', function)}")
    except Exception as raised:
        error, result = _passable(raised), None
    parent.send((result, error))


def _passable(error: Exception) -> Exception:
    """The error, or its words where the error itself cannot be passed on."""
    words = f"{type(error).__name__}: {error}"
    try:
        _expect_passable(error, words)
    except QuadcosimError as why:
        return why
    return error


def _expect_passable(content: Any, name: str) -> None:
    try:
        pickle.loads(pickle.dumps(content, pickle.HIGHEST_PROTOCOL))
    except Exception as error:
        raise QuadcosimError(f"{name}; it cannot be passed on by its process: {error}") from None


if __name__ == "__main__":
    main()
