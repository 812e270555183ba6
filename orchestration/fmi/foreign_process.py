"""The process of a call: `python -m orchestration.processes.call_process` is told a function and its arguments."""

from orchestration.processes.channel import Parent


def main() -> None:
    """Say what comes of the call, or what it raises."""
    parent = Parent()
    result = error = None
    try:
        function, arguments = parent.hear()
        result = function(*arguments)
    except Exception as raised:
        error = raised
    parent.say((result, error))


if __name__ == "__main__":
    main()
