"""The commands that build and check FMUs."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fmu_kit.scratch import temporary_folder
from orchestration.command import verdicts
from orchestration.command.options import option
from orchestration.command.registry import CommandResult, expect_positive, option_group, result_of_files
from orchestration.command.variant_flags import VariantFlags
from orchestration.components.building import consent
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.terminal import in_columns, inform, progress_bar
from orchestration.foundation.processes.resource_limits import Limits

if TYPE_CHECKING:
    from orchestration.components.checks.validation.finding import Finding


@dataclass(frozen=True, kw_only=True)
class LimitFlags:
    """The limits of checks; raises `UsageError` for values that are not positive."""

    time_limit: Annotated[float, option("--time-limit", "Time limit for all checks of an FMU.", "SECONDS")] = (
        Limits.time
    )
    memory_limit: Annotated[
        float, option("--memory-limit", "Memory of the FMU's process and its children (Linux).", "MB")
    ] = Limits.memory
    size_limit: Annotated[
        float, option("--size-limit", "Size of an unpacked FMU, and of a file that it writes.", "MB")
    ] = Limits.size
    output_limit: Annotated[float, option("--output-limit", "Output that an FMU may print.", "MB")] = Limits.output

    def __post_init__(self) -> None:
        for name in ("time", "memory", "size", "output"):
            expect_positive(f"--{name}-limit", getattr(self, f"{name}_limit"), "seconds" if name == "time" else "MB")

    @property
    def limits(self) -> Limits:
        """The limits for the process."""
        return Limits(time=self.time_limit, memory=self.memory_limit, size=self.size_limit, output=self.output_limit)


@option_group("variant", VariantFlags)
def build(
    slave: Annotated[
        str | None,
        typer.Argument(
            help="Folder of modules that define slaves, FOLDER/NAME for one, or the name of a slave of this project; "
            "default: all of this project, or UnifiedController with --name.",
            metavar="[FOLDER]",
        ),
    ] = None,
    out: Annotated[
        Path | None, option("--out", "Folder for the FMUs; default: FOLDER, or fmus/ for this project's.")
    ] = None,
    native: Annotated[
        bool, option("--native", "Without Python inside, by a C compiler; default folder: native/.")
    ] = False,
    target: Annotated[
        str | None,
        option(
            "--target",
            "Systems to build --native for, with the compiler of the package ziglang.",
            "all|linux64,linux-aarch64,win64,darwin64",
        ),
    ] = None,
    fmi: Annotated[
        int, option("--fmi", "Version of FMI, 3 with --native only; then in native/fmi3/.", min=2, max=3)
    ] = 2,
    clock: Annotated[
        bool, option("--clock", "With --fmi 3: slaves that sample have an input clock; in native/fmi3/clocked/.", "")
    ] = False,
    *,
    variant: VariantFlags,
) -> CommandResult:
    """Build every slave that the modules of FOLDER define, each as an .fmu. Same sources give the same bytes.

    With --name one slave is built as another FMU, in which parameters fixed by --set and --vehicle are constants.
    """
    from orchestration.components.building import builder, fmus, wrap
    from orchestration.components.building.models import MODELS
    from orchestration.quadrotor.scenarios.wiring import DEFAULT_CONTROLLER

    if target is not None and not native:
        raise UsageError("--target: expected --native with it; FMUs with Python inside are the same for all systems")
    if fmi == 3 and not native:
        raise UsageError("--fmi 3: expected --native with it; FMUs with Python inside are of FMI 2.0")
    if clock and fmi != 3:
        raise UsageError("--clock: expected --native --fmi 3 with it; there are no clocks before")
    of_fmi_3 = builder.CLOCKED_FMI_3 if clock else builder.NATIVE_FMI_3
    packing = builder.IN_PYTHON if not native else of_fmi_3 if fmi == 3 else builder.NATIVE
    if variant.is_set and variant.name is None:
        raise UsageError("--set, --vehicle: expected --name NAME, the name of the FMU with these values")
    if variant.name is not None and variant.name in MODELS:
        raise UsageError(f"--name {variant.name}: expected another name than that of a slave")
    names = [slave] if slave is not None else [DEFAULT_CONTROLLER] if variant.is_set else list(MODELS)
    slaves = variant.applied_to([each for name in names for each in builder.slaves_named(name)])
    folder = fmus.default_folder()
    if slave is not None and slave not in MODELS:
        folder = builder.folder_of(slave)
        consent.agree(folder)
        for path in builder.described_in(folder) if Path(slave).is_dir() else ():
            if all(wrap.is_out_of_date(wrap.fmu_of(path, version), path) for version in (2, 3)):
                inform(f"{path}: describes code in C, of which there is no FMU, or an older one: quadcosim wrap {path}")
    with progress_bar("building") as progress:
        how: Any = {"packing": packing, "systems": target, "progress": progress}
        return result_of_files(builder.build_slaves(slaves, out or folder / packing.folder, inform, **how))


@option_group("limits", LimitFlags)
def validate(
    fmu: Annotated[
        list[Path] | None,
        typer.Argument(help="FMUs, or files that describe code in C; without any, FMUs of this project."),
    ] = None,
    rules: Annotated[bool, option("--rules", "List all rules, with what they check.")] = False,
    *,
    limits: LimitFlags,
) -> CommandResult:
    """Check FMUs: archive, description and behaviour in test runs; exit code 1 if there is any problem.

    Accepts any FMU of FMI 2.0 or 3.0: for co-simulation, model exchange, in event mode, for scheduled execution. Those
    built by quadcosim are checked for the rules of this project too. All checks run in a separate process with limits.
    A file that wrap takes is made an FMU as with sanitize = true, which is not kept: its code is checked while it runs.
    """
    from orchestration.components.building import fmus
    from orchestration.components.building.models import MODELS

    if rules:
        return _rules()
    paths = fmu or [fmus.locate(name, inform) for name in MODELS]
    for path in paths:
        if not path.is_file():
            raise UsageError(f"{path}: no such file")
    document, lines, problems = [], [], 0
    with progress_bar("checking") as progress:
        for done, path in enumerate(paths):
            progress(done / len(paths))
            findings = _findings(path, limits.limits)
            document.append({"fmu": path, "findings": findings})
            count = sum(not finding.note for finding in findings)
            problems += count
            lines.append(f"{path}: {count or 'no'} problem{'' if count == 1 else 's'}{'' if count else ' found'}")
            lines.extend(f"  {finding}" for finding in findings)
    verdict = verdicts.of_problems(problems, len(paths))
    return CommandResult(document={"fmus": document}, verdict=verdict, lines=lines, good=not problems)


def _findings(path: Path, limits: Limits) -> list["Finding"]:
    """Those of an FMU, or of the code that a file describes."""
    from orchestration.components.building import wrap
    from orchestration.components.building.models import WRAPPED
    from orchestration.components.checks.validation.validator import validate as findings_of

    if path.suffix != WRAPPED:
        return findings_of(path, limits=limits)
    consent.agree(path.parent)
    with temporary_folder() as folder:
        return findings_of(wrap.build(path, folder / wrap.fmu_of(path).name, sanitize=True), limits=limits)


def _rules() -> CommandResult:
    """All rules, with what they check."""
    from orchestration.components.checks.validation import rules
    from orchestration.components.checks.validation.finding import name_of

    groups = {"for every FMU": rules.STANDARD, "for FMUs that quadcosim built": rules.OURS}
    checked = {
        of: {name_of(rule): (rule.__doc__ or "").splitlines()[0] for rule in group} for of, group in groups.items()
    }
    lines = [line for of, group in checked.items() for line in ("", of, *in_columns([*group.items()]))]
    return CommandResult(document={"rules": checked}, lines=lines[1:])


@option_group("limits", LimitFlags)
def doctor(
    fmu: Annotated[list[Path] | None, typer.Argument(help="FMUs; without any, those of this project.")] = None,
    *,
    limits: LimitFlags,
) -> CommandResult:
    """List what FMUs require and what this machine lacks, and load them; exit code 1 if anything is missing."""
    from orchestration.components.building import fmus
    from orchestration.components.building.models import MODELS
    from orchestration.components.checks.doctor.as_lines import as_text
    from orchestration.components.checks.doctor.report import as_tables, examine

    report = examine(fmu or [fmus.locate(name, inform) for name in MODELS], limits.limits)
    lines = as_text(report).splitlines()
    return CommandResult(document=as_tables(report), verdict=verdicts.of_doctor(report), lines=lines, good=report.good)
