"""The doctor's report as lines of text."""

from collections.abc import Iterable, Iterator

from orchestration.components.checks.doctor.binaries import Dependency, newest
from orchestration.components.checks.doctor.dependencies import PYTHON_DLL, missing_versions, needed, offered, part_for
from orchestration.components.checks.doctor.fmu import PLATFORMS, InspectedFmu, PlatformBinary
from orchestration.components.checks.doctor.machine import Library, Machine
from orchestration.components.checks.doctor.report import DoctorReport
from orchestration.components.checks.doctor.verdict import Host, UnexaminedFmu, Verdict

_WIDTH = 12

Row = tuple[str, str, bool]
"""Label, text, and whether it is a problem."""


def as_text(report: DoctorReport) -> str:
    """A block of lines for the machine and one for each FMU; problems are marked with an exclamation mark."""
    blocks = [_block("this machine", _machine_rows(report.machine))]
    blocks += [_verdict_block(verdict, report.machine) for verdict in report.verdicts]
    return "\n\n".join(blocks)


def _verdict_block(verdict: Verdict | UnexaminedFmu, machine: Machine) -> str:
    if isinstance(verdict, UnexaminedFmu):
        return _block(str(verdict.path), [("file", verdict.failure, True)])
    return _block(str(verdict.fmu.path), _fmu_rows(verdict, machine))


def _block(title: str, rows: Iterable[Row]) -> str:
    lines = [f"{'!' if bad else ' '} {label:<{_WIDTH}} {text}" for label, text, bad in rows]
    return "\n".join([title, *lines])


def _machine_rows(machine: Machine) -> Iterator[Row]:
    yield "system", ", ".join(filter(None, (machine.system, machine.architecture, machine.glibc))), False
    linked = {True: "shared libpython", False: "libpython linked in", None: "libpython unknown"}[machine.shared]
    yield "Python", f"{machine.python}, {machine.executable}, {linked}", False
    for library in machine.python_libraries:
        yield "libpython", f"{library.version}, {library.path} ({library.found_by})", False
    if not machine.python_libraries:
        yield "libpython", "none for a host that is not Python", False
    yield "temp folder", str(machine.temp_folder), False


def _fmu_rows(verdict: Verdict, machine: Machine) -> Iterator[Row]:
    fmu, here = verdict.fmu, part_for(verdict.fmu, machine)
    for part in fmu.platforms:
        yield from _platform_rows(part, machine, fmu.version, part is here)
    yield from _python_rows(fmu, machine)
    if fmu.needs_tool is not None:
        yield "tool", f"{fmu.needs_tool}, declared by the FMU (needsExecutionTool)", False
    for problem in verdict.problems:
        yield "file", problem, True
    for problem in verdict.elsewhere:
        yield "elsewhere", problem, False
    loads = verdict.failure is None
    yield _host_row("Python host", "fmpy and others", verdict.python_host, loads=loads)
    yield _host_row("other host", "Simulink, Modelica tools, C", verdict.other_host, loads=loads)
    yield "tried here", "loads" if verdict.failure is None else verdict.failure, verdict.failure is not None


def _host_row(label: str, examples: str, host: Host, *, loads: bool) -> Row:
    ready = (
        ("ready" if loads else "the libraries that it names are here")
        if host.start is None
        else f"start it as {host.start}"
    )
    parts = [ready if host.ready else f"needs {'; '.join(host.needs)}", *filter(None, [host.note])]
    return label, f"{examples}: {'; '.join(parts)}", not host.ready


def _platform_rows(part: PlatformBinary, machine: Machine, version: int, here: bool) -> Iterator[Row]:
    if part.binary is None:
        return
    known = "" if part.platform in PLATFORMS[version] else f"; FMI {version}.0 has no such platform"
    yield part.platform, f"{part.binary.target}: {'fits' if here else 'not for'} this machine{known}", False
    if part.binary.dependencies is None:
        yield "", "its dependencies are unknown", False
    if here:
        yield from (_dependency_row(dependency, machine) for dependency in needed(part))
    elif part.binary.dependencies:
        yield "", f"needs {', '.join(_with_versions(dependency) for dependency in needed(part))}", False
    if part.binary.python_symbols:
        count = len(part.binary.python_symbols)
        needs = "finds a libpython itself" if part.finds_python else "needs a libpython that its host has loaded"
        yield "", f"{needs}, globally visible ({count} symbols)", False


def _with_versions(dependency: Dependency) -> str:
    return " ".join((dependency.name, *newest(dependency.versions)))


def _dependency_row(dependency: Dependency, machine: Machine) -> Row:
    libraries = [found.get(dependency.name) for found in (machine.found, machine.found_by_python)]
    program, python = (_found_text(dependency, library) for library in libraries)
    bad = any(library is None or missing_versions(dependency, library) for library in libraries)
    here = program if program == python else f"{program}, in Python {python}"
    return "", f"needs {_with_versions(dependency)}; here {here}", bad and not PYTHON_DLL.fullmatch(dependency.name)


def _found_text(dependency: Dependency, library: Library | None) -> str:
    return "none" if library is None else offered(dependency, library) or str(library.path)


def _python_rows(fmu: InspectedFmu, machine: Machine) -> Iterator[Row]:
    if fmu.python is None:
        return
    version = f"Python {fmu.requires_python}" if fmu.requires_python else "a version of Python that is not declared"
    imports = [name if machine.modules.get(name) else f"{name} (not here)" for name in fmu.python.imports]
    packages = ", ".join(imports) or "the standard library only"
    yield "Python", f"made by pythonfmu; needs {version} and {packages}", False
