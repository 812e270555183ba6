"""The process of a call: `python -m orchestration.components.fmi.foreign_process` obeys."""

import pickle
from typing import Any

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes.channel import Parent


def main() -> None:
    """Send the result of the call, or the exception that it raises."""
    parent = Parent()
    result = error = None
    try:
        function, arguments = parent.receive()
        result = function(*arguments)
        _expect_picklable(result, f"the result of {getattr(function, '__name__', function)}")
    except Exception as raised:
        error, result = _picklable(raised), None
    parent.send((result, error))


def _picklable(error: Exception) -> Exception:
    """The error, or one with its text if it cannot be pickled."""
    text = f"{type(error).__name__}: {error}"
    try:
        _expect_picklable(error, text)
    except QuadcosimError as why:
        return why
    return error


def _expect_picklable(content: Any, name: str) -> None:
    try:
        pickle.loads(pickle.dumps(content, pickle.HIGHEST_PROTOCOL))
    except Exception as error:
        raise QuadcosimError(f"{name}; it cannot be passed on by its process: {error}") from None


if __name__ == "__main__":
    main()
