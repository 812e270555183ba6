"""The process of a call: `python -m orchestration.components.fmi.foreign_process` obeys."""

from orchestration.foundation.basics.errors import QuadcosimError
from orchestration.foundation.processes.channel import Parent


def main() -> None:
    """Send the result of the call, or the exception that it raises."""
    parent = Parent()
    function, arguments = parent.receive()
    try:
        result = function(*arguments)
    except Exception as error:
        parent.send((None, error))
        return
    try:
        parent.send((result, None))
    except TypeError as error:
        name = getattr(function, "__name__", function)
        parent.send((None, QuadcosimError(f"the result of {name}; it cannot be passed on by its process: {error}")))


if __name__ == "__main__":
    main()
