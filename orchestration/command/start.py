"""The entry point of `quadcosim`; it imports little, as the environment may make Python find foreign modules."""

import atexit
import gc
import os
import sys

from orchestration.foundation.processes.subprocesses import ROOT, misleading_variables, one_thread

_AGAIN = "import sys; sys.path.insert(0, sys.argv.pop(1)); from orchestration.command.start import main; main()"


def main() -> None:
    """Run the command line; if it cannot be loaded, report the environment variables that may be the cause.

    `doctor` then runs without them, to report their effect on FMUs. If PYTHONHOME keeps Python from starting, this is
    not reached.
    """
    one_thread()
    _collect_rarely()
    if sys.argv[1:] == ["--version"]:  # fast for scripts: needs no command line
        from orchestration.command.version import own_version

        print(own_version())
        return
    try:
        from orchestration.command import cli
    except KeyboardInterrupt:
        sys.exit(130)
    except MemoryError:
        sys.exit("quadcosim: there is not enough memory")
    except Exception as error:
        misleading = misleading_variables()
        if not misleading or sys.flags.ignore_environment:
            raise
        if sys.argv[1:2] == ["doctor"] and os.name == "posix":
            os.execv(sys.executable, [sys.executable, "-E", "-c", _AGAIN, ROOT, *sys.argv[1:]])
        variables = " ".join(f"{name}={value}" for name, value in misleading.items())
        print(f"quadcosim: it does not start with {variables}: {type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
    cli.main()


def _collect_rarely() -> None:
    """Collect garbage rarely, and not at exit: that took a fifth of the CPU time of a short command."""
    gc.set_threshold(100_000)
    atexit.register(gc.freeze)


if __name__ == "__main__":
    main()
