"""Where `quadcosim` starts: it holds as little as it can, for the environment may have Python find foreign modules."""

import os
import sys

from orchestration.processes.subprocesses import ROOT, misleading_variables, one_thread

_AGAIN = "import sys; sys.path.insert(0, sys.argv.pop(1)); from orchestration.command.start import main; main()"


def main() -> None:
    """Run the command line; where it cannot be loaded, say which variable is in the way.

    `doctor` goes on without it, to say what that does to FMUs. A Python that PYTHONHOME keeps from starting at all
    never comes here.
    """
    one_thread()
    if sys.argv[1:] == ["--version"]:  # which scripts ask, and which needs no command line
        from orchestration.command.version import own

        print(own())
        return
    try:
        from orchestration.command import cli
    except Exception as error:
        given = misleading_variables()
        if not given or sys.flags.ignore_environment:
            raise
        if sys.argv[1:2] == ["doctor"] and os.name == "posix":
            os.execv(sys.executable, [sys.executable, "-E", "-c", _AGAIN, ROOT, *sys.argv[1:]])
        variables = " ".join(f"{name}={value}" for name, value in given.items())
        print(f"quadcosim: it does not start with {variables}: {type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
    cli.main()


if __name__ == "__main__":
    main()
