"""The command `quadcosim`."""

import copy
import functools
import importlib
import sys
import traceback
from typing import Annotated, Any

import typer
import typer.core

from orchestration.command import registry
from orchestration.command.options import option
from orchestration.command.registry import OutputOptions, TakesPlainValues, ask, option_group
from orchestration.components.building import consent
from orchestration.foundation.basics.errors import (
    QuadcosimError,
    SimulatorError,
    UsageError,
    did_you_mean,
    no_utf8,
    without_unit,
    worded_by,
)
from orchestration.foundation.basics.extras import lack_of
from orchestration.foundation.basics.terminal import banners_to_stderr, inform, report_error
from orchestration.foundation.processes.subprocesses import misleading_variables

NO_THREAD = "can't start new thread"
"""Text of the error of Python if the system has no room for another one"""
_SYNONYMS = {
    "--store": "--out", "--step-size": "--output-interval", "--start-values": "--set", "--output-variables": "--record",
    "--input-file": "--inputs", "--output-file": "--output", "--relative-tolerance": "--tolerance",
    "--interface-type": "--interface",
}  # fmt: skip
"""Options that some commands take, by those of others, or of fmpy, for the same"""


class _Interrupted(Exception):
    """Ctrl-C; the text states the progress of the work."""


class _OutputClosed(Exception):
    """The reader of standard output has closed it."""


class _Commands(TakesPlainValues, typer.core.TyperGroup):
    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError as end:
            raise _OutputClosed from end
        except (KeyboardInterrupt, typer.Abort) as stop:  # the parser would keep only an exit code
            raise _Interrupted(str(stop)) from stop


app = typer.Typer(
    name="quadcosim",
    cls=_Commands,
    epilog="A first flight: quadcosim run --out results/paper. Exit codes: 0 done, 1 failed or a check did not pass, "
    "2 wrong usage, 130 stopped by Ctrl-C, 141 output closed by its reader.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
@option_group("output_options", OutputOptions)
def quadcosim(
    context: typer.Context,
    version: Annotated[
        bool, option("--version", "Print the version and exit; with -v also those of its dependencies.", "")
    ] = False,
    *,
    output_options: OutputOptions,
) -> None:
    """Fly a quadrotor controller, or run any FMUs, under a realistic digital clock."""
    registry.set_output_options(output_options, anew=True)
    if version:
        from orchestration.command.version import versions

        registry.print_result(versions(everything=output_options.verbose or output_options.as_json))
        raise typer.Exit
    if context.invoked_subcommand is None:
        raise UsageError("expected a command; quadcosim --help lists them")


COMMANDS = {
    "Run": (
        *("run.run", "scheduling.schedule", "plotting.plot", "report.report", "live.live"),
        *("new.new", "new.examples", "systems.show", "systems.connect", "systems.schema"),
    ),
    "Study": (
        *("limit.limit", "studies.sweep", "studies.status", "studies.draw", "studies.export"),
        *("controllers.compare", "controllers.tune", "exact.expect"),
        *("margin.margin", "margin.linearise", "loops.bode", "loops.step", "loops.locus"),
    ),
    "FMUs": ("fmus.build", "new.wrap", "fmus.validate", "fmus.doctor"),
    "Other tools": ("other_tools.export_c", "other_tools.ssp", "other_tools.interop"),
}
"""Modules of this package with the functions of commands, by groups, in the order of the help"""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with one of the codes in its help; an error is one line."""
    with worded_by(str):
        _run(arguments)


def _run(arguments: list[str] | None) -> None:
    words = sys.argv[1:] if arguments is None else arguments
    registry.arguments = words
    registry.set_output_options(OutputOptions(), anew=True)
    try:
        with banners_to_stderr(), consent.asking(ask):
            parser = command_line(words[0] if words else "")
            code = parser(words or ["--help"], prog_name="quadcosim", standalone_mode=False)
        sys.exit(code if words else 2)
    except (KeyboardInterrupt, _Interrupted) as stop:
        report_error(f"interrupted {stop}".rstrip())
        sys.exit(130)
    except (BrokenPipeError, _OutputClosed):
        sys.exit(141)
    except Exception as error:
        sys.exit(_report(error))


@functools.cache
def command_line(command: str = "") -> Any:
    """The parser of one command, or of all if there is none of this name; modules of all commands are slow to load."""
    known = [(group, *place.split(".")) for group, places in COMMANDS.items() for place in places]
    named = [each for each in known if typer.main.get_command_name(each[2]) == command]
    part = copy.copy(app)
    part.registered_commands = []
    for group, module, function in named or known:
        registry.add(part, group, getattr(importlib.import_module(f"orchestration.command.{module}"), function))
    return typer.main.get_command(part)


def _report(error: Exception) -> int:
    """Print an error in one line; the exit code."""
    if registry.output_options.debug:
        traceback.print_exc()
        if isinstance(error, SimulatorError) and error.details:
            inform(f"in the FMU:\n{error.details}")
    misuse = _usage_message(error)
    if isinstance(error, UnicodeEncodeError) and error.reason.startswith("surrogates"):
        error = no_utf8(error)
    if isinstance(error, (QuadcosimError, OSError)):
        text = str(error)
    elif misuse is not None:
        text = f"{misuse} (see --help)"
    elif isinstance(error, MemoryError):
        text = "there is not enough memory" + (f": {error}" if str(error) else "")
    elif isinstance(error, RuntimeError) and str(error) == NO_THREAD:
        text = f"there is not enough memory, or there are too many processes: {error}"
    elif isinstance(error, ModuleNotFoundError) and (lack := lack_of(error.name)) is not None:
        text = lack
    elif isinstance(error, ImportError) and (variables := misleading_variables()):
        text = f"{error}; try without {' '.join(variables)}, which may make Python load modules of another installation"
    else:
        text = f"{type(error).__name__}: {error} (an error of quadcosim itself; --debug shows where)"
    report_error(text, error)
    return 2 if misuse is not None or isinstance(error, UsageError) else 1


def _usage_message(error: Exception) -> str | None:
    """The parser's message on a wrong command line; None for another kind of error."""
    describe = getattr(error, "format_message", None)
    if describe is None:
        return None
    for problem in getattr(error.__cause__, "errors", list)():  # of Pydantic, which converts what is given
        if problem["type"] in ("float_parsing", "int_parsing"):
            kind = "a number" if problem["type"] == "float_parsing" else "a whole number"
            given = f"{error.param.opts[0]} {problem['input']}"  # type: ignore[attr-defined]
            return f"{given}: expected {without_unit(kind, problem['input'])}"
    flag, known = getattr(error, "option_name", None), getattr(error, "possibilities", None)
    if not (flag and known):
        return str(describe())
    takes = {name for parameter in error.ctx.command.params for name in parameter.opts}  # type: ignore[attr-defined]
    meant = _SYNONYMS.get(flag)
    return f"No such option: {flag}{did_you_mean(flag, known) if meant not in takes else f'; did you mean {meant}?'}"


if __name__ == "__main__":
    main()
