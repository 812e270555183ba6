"""The command `quadcosim`."""

import copy
import difflib
import functools
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
import typer.core

from orchestration.basics.errors import QuadcosimError, SimulatorError, UsageError, no_utf8, worded_by
from orchestration.basics.extras import extra_of
from orchestration.basics.terminal import inform, progress_bar, report_error, warn
from orchestration.basics.units import after
from orchestration.building import consent
from orchestration.command import completion, exact, interop, margin, plotting, scheduling, studies
from orchestration.command import new as beginning
from orchestration.command import registry as registering
from orchestration.command import report as reports
from orchestration.command import systems as system_commands
from orchestration.command.answer import Answer, of_files
from orchestration.command.build_flag import ask
from orchestration.command.flags import EngineFlag, FlightFlags, Timing, flies, request_from
from orchestration.command.limit_flags import LimitFlags, ProcessFlags
from orchestration.command.output_options import Manners
from orchestration.command.registry import FLY, FMUS, TOOLS
from orchestration.command.shared_flags import takes
from orchestration.command.variant_flags import VariantFlags
from orchestration.fmi.banners import banners_to_stderr
from orchestration.processes.subprocesses import misleading_variables

if TYPE_CHECKING:
    from orchestration.runs.result import Result


class _Stopped(Exception):
    """Ctrl-C; the text says how far the work was."""


class _Unread(Exception):
    """Whoever read standard output has gone."""


class _Commands(typer.core.TyperGroup):
    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except BrokenPipeError as end:
            raise _Unread from end
        except (KeyboardInterrupt, typer.Abort) as stop:  # of which the parser would keep an exit code only
            raise _Stopped(str(stop)) from stop


app = typer.Typer(
    name="quadcosim",
    cls=_Commands,
    epilog="A first flight: quadcosim run --out results/paper. Exit codes: 0 done, 1 it failed or something is not as "
    "it should be, 2 wrong usage, 130 stopped by Ctrl-C, 141 the reader of the output has gone.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
@takes("manners", Manners)
def quadcosim(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", metavar="", help="Print the version and stop; with -v also those of its dependencies."
        ),
    ] = False,
    *,
    manners: Manners,
) -> None:
    """Fly a quadrotor controller, or run any FMUs, under a realistic digital clock."""
    registering.behave(manners, anew=True)
    if version:
        from orchestration.command.version import versions

        registering.give(versions(everything=manners.verbose or manners.as_json))
        raise typer.Exit
    if context.invoked_subcommand is None:
        raise UsageError("expected a command; quadcosim --help lists them")


@takes("variant", VariantFlags)
def build(
    slave: Annotated[
        str | None,
        typer.Argument(
            metavar="[FOLDER]",
            help="Folder of modules that define slaves, FOLDER/NAME for one, or the name of one of this project's; "
            "without one, all of this project's, or UnifiedController with --name.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for the FMUs; default: FOLDER, or fmus/ for this project's."),
    ] = None,
    native: Annotated[
        bool,
        typer.Option("--native", help="Without Python inside, by a C compiler; default folder: native/."),
    ] = False,
    target: Annotated[
        str | None,
        typer.Option(
            "--target",
            metavar="all|linux64,linux-aarch64,win64,darwin64",
            autocompletion=completion.among("all", "linux64", "linux-aarch64", "win64", "darwin64"),
            help="Systems to build --native for, with the compiler of the package ziglang.",
            show_default=False,
        ),
    ] = None,
    fmi: Annotated[
        int, typer.Option("--fmi", min=2, max=3, help="Version of FMI, 3 with --native only; then in native/fmi3/.")
    ] = 2,
    *,
    variant: VariantFlags,
) -> Answer:
    """Build every slave that the modules of FOLDER define, each as an .fmu. Same sources give the same bytes.

    With --name one slave is built as another FMU: parameters that are fixed by --set and --vehicle are constants of it.
    """
    from orchestration.building import builder, fmus
    from orchestration.building.models import MODELS
    from orchestration.quadrotor.wiring import DEFAULT_CONTROLLER

    if target is not None and not native:
        raise UsageError("--target: expected --native with it; FMUs with Python inside are the same for all systems")
    if fmi == 3 and not native:
        raise UsageError("--fmi 3: expected --native with it; FMUs with Python inside are of FMI 2.0")
    packing = builder.IN_PYTHON if not native else builder.NATIVE_FMI_3 if fmi == 3 else builder.NATIVE
    if variant.are_given and variant.name is None:
        raise UsageError("--set, --vehicle: expected --name NAME, what the FMU with these values is called")
    if variant.name is not None and variant.name in MODELS:
        raise UsageError(f"--name {variant.name}: expected another name than that of a slave")
    asked = [slave] if slave is not None else [DEFAULT_CONTROLLER] if variant.are_given else list(MODELS)
    slaves = variant.applied_to([each for name in asked for each in builder.slaves_named(name)])
    folder = None if slave in (None, *MODELS) else Path(str(slave))
    if folder is not None:
        folder = folder if folder.is_dir() else folder.parent
        consent.agree(folder)
    where = out or (folder or fmus.default_folder()) / packing.folder
    with progress_bar("building") as progress:
        how: Any = {"packing": packing, "systems": target, "progress": progress}
        return of_files(builder.build_slaves(slaves, where, inform, **how))


@takes("variant", VariantFlags)
def export_c(
    out: Annotated[Path, typer.Option("--out", help="Folder for NAME.h and NAME.c.", metavar="DIR")],
    slave: Annotated[
        str,
        typer.Argument(
            help="UnifiedController, QuadrotorPlant, a folder of modules that define slaves, or FOLDER/NAME."
        ),
    ] = "UnifiedController",
    single: Annotated[
        bool, typer.Option("--single", help="In single precision, with the functions of libm; else double, without.")
    ] = False,
    *,
    variant: VariantFlags,
) -> Answer:
    """Write a controller, or any slave, as two files in C for a microcontroller: no allocation, C99."""
    from orchestration.building import builder

    written = builder.export_c(variant.applied_to(builder.slaves_named(slave)), out, single=single)
    return of_files(each for path in written for each in (path.with_suffix(".h"), path))


@takes("process", ProcessFlags)
@flies
def run(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file, or SSP; without one, the paper's flight.", show_default=False),
    ] = None,
    timing: Timing = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Directory for signals, events, metrics and figures.", metavar="DIR")
    ] = None,
    figures: Annotated[bool, typer.Option(help="Draw the figures into the directory.")] = True,
    pause_at: Annotated[
        float | None, typer.Option("--pause-at", help="Pause here; the state is saved in --out DIR.", metavar="SECONDS")
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume", help="Resume the run paused in DIR; the results are the same to the bit.", metavar="DIR"
        ),
    ] = None,
    engine: EngineFlag = None,
    *,
    flags: FlightFlags,
    process: ProcessFlags,
) -> Answer:
    """Run a scenario or a system and print its metrics. FMUs that are missing or out of date are built first."""
    from orchestration.engines.engine import engine_named
    from orchestration.runs.simulation import run as fly  # what reads and writes files is loaded where there are any

    if resume is not None and (scenario is not None or pause_at is not None or flags != FlightFlags()):
        raise UsageError("--resume: expected no scenario and no flags of the flight; the paused run has its own")
    if pause_at is not None and out is None:
        raise UsageError("--pause-at: expected --out DIR for the state")
    with progress_bar("flying") as progress:
        how: Any = {"progress": progress, "announce": inform, "engine": engine_named(engine), **vars(process)}
        if resume is not None:
            from orchestration.runs import pause

            result: Result | None = pause.resume(resume, out, figures=figures, **how)
        elif pause_at is not None and out is not None:
            from orchestration.runs import pause

            chosen = request_from(scenario, flags, timing)
            result = pause.run_until(chosen, pause_at, out, figures=figures, **how)
        elif out is not None:
            from orchestration.runs.run_directory import keep_run

            chosen = request_from(scenario, flags, timing)
            result = keep_run(out, lambda to: fly(chosen, recorder=to, **how), figures=figures)
        else:
            result = fly(request_from(scenario, flags, timing), **how)
    if result is None:
        inform(f"paused in {out}; go on with: quadcosim run --resume {out}")
        return Answer(document={"paused_in": out}, lines=[])
    for warning in result.warnings:
        warn(warning)
    exact.say_if_endless(result.request)
    if follows := result.provenance["follows"]:
        inform(f"follows {follows}")
    if out is not None:
        inform(f"results in {out}")
    elif not registering.manners.as_json:
        inform("add --out DIR to keep the signals and the figures")
    return _metrics(result)


@takes("limits", LimitFlags)
def validate(
    fmu: Annotated[list[Path] | None, typer.Argument(help="FMUs; without any, those of this project.")] = None,
    *,
    limits: LimitFlags,
) -> Answer:
    """Check FMUs: archive, description, and what they do when they run; exit code 1 if there is any problem.

    Any co-simulation FMU of FMI 2.0 or 3.0 will do; those that quadcosim built must keep the rules of this project too.
    All of it is done in a process of its own within limits.
    """
    from orchestration.building import fmus
    from orchestration.building.models import MODELS
    from orchestration.checks.validation.validator import validate as findings_of

    paths = fmu or [fmus.locate(name, inform) for name in MODELS]
    for path in paths:
        if not path.is_file():
            raise UsageError(f"{path}: expected an .fmu file")
    document, lines, problems = [], [], 0
    with progress_bar("checking") as progress:
        for done, path in enumerate(paths):
            progress(done / len(paths))
            findings = findings_of(path, limits=limits.limits)
            document.append({"fmu": path, "findings": findings})
            count = sum(not finding.note for finding in findings)
            problems += count
            lines.append(f"{path}: {count or 'no'} problem{'' if count == 1 else 's'}{'' if count else ' found'}")
            lines.extend(f"  {finding}" for finding in findings)
    return Answer(document=document, lines=lines, good=not problems)


@takes("limits", LimitFlags)
def doctor(
    fmu: Annotated[list[Path] | None, typer.Argument(help="FMUs; without any, those of this project.")] = None,
    *,
    limits: LimitFlags,
) -> Answer:
    """List what FMUs require and what this machine lacks, and load them; exit code 1 if anything is missing."""
    from orchestration.building import fmus
    from orchestration.building.models import MODELS
    from orchestration.checks.doctor.as_lines import as_text
    from orchestration.checks.doctor.report import as_tables, examine

    report = examine(fmu or [fmus.locate(name, inform) for name in MODELS], limits.limits)
    return Answer(document=as_tables(report), lines=as_text(report).splitlines(), good=report.good)


@flies
def ssp(
    scenario: Annotated[
        Path | None,
        typer.Argument(help="System or scenario file; without one, the paper's flight.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="The file; default: QuadrotorLoop.ssp in fmus/, or NAME.ssp here.", metavar="FILE"),
    ] = None,
    read_back: Annotated[
        bool,
        typer.Option(
            "--read-back", help="Begin to fly it in libcosim, ecos and fmpy, where installed, and tell what each says."
        ),
    ] = False,
    *,
    flags: FlightFlags,
) -> Answer:
    """Write FMUs, connections and parameters as one SSP 1.0 file for other tools, and beside it its timing."""
    from orchestration.building import fmus
    from orchestration.interop.reading_back import readings
    from orchestration.requests.ssp import writing
    from orchestration.requests.ssp.export import export_of

    asked = request_from(scenario, flags)
    if asked.title is not None or scenario is None:
        usual = fmus.default_folder() / f"{asked.title}.ssp"
    else:
        usual = Path(f"{scenario.stem}.ssp")
    written, timing = writing.write_with_timing(asked, out or usual, inform, warn)
    inform(f"{timing} has its timing, for quadcosim run")
    masters: dict[str, str | None] = {}
    for reading in readings(written, export_of(asked)) if read_back else ():
        masters[reading.master] = reading.refusal
        if reading.refusal is None:
            inform(f"{reading.master} flies it")
        else:
            warn(f"{reading.master} does not fly it: {reading.refusal}")
    return Answer(document={"files": [written, timing], "masters": masters}, lines=[str(written)])


registering.add(app, FLY, run)
scheduling.register(app)
plotting.register(app)
reports.register(app)
beginning.register(app)
system_commands.register(app)
studies.register(app)
exact.register(app)
margin.register(app)
registering.add(app, FMUS, build, validate, doctor)
registering.add(app, TOOLS, export_c, ssp)
interop.register(app)


def _metrics(result: "Result") -> Answer:
    from orchestration.results.criterion import unmet

    found = {**result.metrics, "wall_time": result.provenance["wall_time"], "engine": result.provenance["engine"]}
    width, units = max(map(len, found)), {**result.units, "wall_time": "s"}
    lines = []
    for name, value in found.items():
        shown = f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
        lines.append(f"{name:<{width}}  {shown}{'' if value is None else after(units.get(name))}")
    if result.divergence is not None:
        lines.append(f"diverged: {result.divergence}")
    if (missed := unmet(result.system, result.metrics, result.units)) is not None:
        inform(f"not good: {missed}")
    if result.termination is not None:
        lines.append(f"terminated: {result.termination}")
    return Answer(document=found, lines=lines)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and end with one of the codes that its help names; one line for an error, in its words."""
    with worded_by(str):
        _run(arguments)


def _run(arguments: list[str] | None) -> None:
    given = sys.argv[1:] if arguments is None else arguments
    registering.arguments = given
    registering.behave(Manners(), anew=True)
    try:
        with banners_to_stderr(), consent.asking(ask):
            read = _command_line(given[0] if given else "")
            code = read(given or ["--help"], prog_name="quadcosim", standalone_mode=False)
        sys.exit(code if given else 2)
    except (KeyboardInterrupt, _Stopped) as stop:
        report_error(f"interrupted {stop}".rstrip())
        sys.exit(130)
    except (BrokenPipeError, _Unread):
        sys.exit(141)
    except Exception as error:
        sys.exit(_told(error))


@functools.cache
def _command_line(command: str) -> Any:
    """What reads arguments that begin with a command, with that alone: to make all takes a tenth of `--help`."""
    asked = [each for each in app.registered_commands if command == _name_of(each)]
    part = copy.copy(app)
    part.registered_commands = asked or app.registered_commands
    return typer.main.get_command(part)


def _name_of(command: typer.models.CommandInfo) -> str:
    assert command.callback is not None
    return typer.main.get_command_name(command.callback.__name__)


def _told(error: Exception) -> int:
    """Says what went wrong; the exit code."""
    if registering.manners.debug:
        traceback.print_exc()
        if isinstance(error, SimulatorError) and error.details:
            inform(f"in the FMU:\n{error.details}")
    misread = _misread(error)
    if isinstance(error, UnicodeEncodeError) and error.reason.startswith("surrogates"):
        error = no_utf8(error)
    if isinstance(error, (QuadcosimError, OSError)):
        text = str(error)
    elif misread is not None:
        text = f"{misread} (--help lists what there is)"
    elif isinstance(error, ModuleNotFoundError) and (extra := extra_of(error.name)) is not None:
        text = f"{error.name} is not installed; this command needs: pip install 'quadcosim[{extra}]'"
    elif isinstance(error, ImportError) and (given := misleading_variables()):
        text = f"{error}; try without {' '.join(given)}, which may have Python take modules of another one"
    else:
        text = f"{type(error).__name__}: {error} (an error of quadcosim itself; --debug shows where)"
    report_error(text, error)
    return 2 if misread is not None or isinstance(error, UsageError) else 1


def _misread(error: Exception) -> str | None:
    """What the parser says of the command line; None for an error of another kind."""
    describe = getattr(error, "format_message", None)
    if describe is None:
        return None
    flag, known = getattr(error, "option_name", None), getattr(error, "possibilities", None)
    if not (flag and known):
        return str(describe())
    return f"No such option: {flag}. Did you mean {difflib.get_close_matches(flag, known, n=1, cutoff=0.0)[0]}?"


if __name__ == "__main__":
    main()
