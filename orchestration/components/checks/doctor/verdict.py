"""The requirements of an FMU compared with a machine: pure functions of the two."""

from dataclasses import dataclass
from pathlib import Path

from packaging.specifiers import InvalidSpecifier, SpecifierSet

from orchestration.components.checks.doctor.binaries import LINUX, WINDOWS
from orchestration.components.checks.doctor.dependencies import PYTHON_DLL, missing_dependencies, part_for
from orchestration.components.checks.doctor.fmu import CALLED, KINDS, InspectedFmu, PlatformBinary
from orchestration.components.checks.doctor.machine import Machine
from orchestration.components.checks.doctor.pythons import BY_LOADER, ON_PATH, PRELOADED, PythonLibrary
from orchestration.components.fmi.slaves import uri_is_read

LIBPYTHON_VARIABLE = "QUADCOSIM_LIBPYTHON"
"""environment variable with the path of a libpython for the loader in an FMU"""

INSTALL_LIBPYTHON = "apt install libpython3-dev (Debian, Ubuntu), dnf install python3-libs (Fedora)"


@dataclass(frozen=True, kw_only=True)
class Host:
    """Whether a kind of host can load an FMU."""

    needs: tuple[str, ...] = ()
    """Things that are missing"""
    start: str | None = None
    """The command that starts the host, if more than its name is needed."""
    note: str | None = None
    """Note on a thing that cannot be determined here"""

    @property
    def ready(self) -> bool:
        """Whether nothing is missing."""
        return not self.needs


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """An FMU on a machine."""

    fmu: InspectedFmu
    platforms: tuple[str, ...]
    """The folders in `binaries/` that are for the machine."""
    python_host: Host
    other_host: Host
    failure: str | None
    """Why it did not load in the trial; None if it did."""

    @property
    def problems(self) -> tuple[str, ...]:
        """The problems of the file itself that concern this machine."""
        parts = self._of_parts(here=True)
        if self.fmu.python is not None:
            parts += self.fmu.python.problems
        requires = self.fmu.requires_python
        if requires is not None and not is_specifier(requires):
            parts.append(f"Python requires = {requires}: expected a version specifier such as >=3.10")
        return tuple(parts)

    @property
    def elsewhere(self) -> tuple[str, ...]:
        """The problems of the file for other machines."""
        return tuple(self._of_parts(here=False))

    @property
    def good(self) -> bool:
        """Whether it loads and nothing is missing."""
        return self.python_host.ready and self.other_host.ready and self.failure is None and not self.problems

    def _of_parts(self, *, here: bool) -> list[str]:
        parts = [part for part in self.fmu.platforms if (part.platform in self.platforms) == here]
        return [f"{part.platform}: {part.problem}" for part in parts if part.problem is not None]


@dataclass(frozen=True, kw_only=True)
class UnexaminedFmu:
    """An FMU that was not examined."""

    path: Path
    failure: str
    """the reason"""

    @property
    def good(self) -> bool:
        """False, as it is not known to load."""
        return False


def judge(fmu: InspectedFmu, machine: Machine, failure: str | None) -> Verdict:
    """The verdict; `failure` is the reason why the FMU did not load here, if it did not."""
    hosts = python_host(fmu, machine), other_host(fmu, machine)
    return Verdict(
        fmu=fmu, platforms=machine.platforms(fmu.version), python_host=hosts[0], other_host=hosts[1], failure=failure
    )


def python_host(fmu: InspectedFmu, machine: Machine) -> Host:
    """A host in this Python, such as fmpy."""
    part = part_for(fmu, machine)
    needs = _general_needs(fmu, machine, part)
    if part is not None:
        needs += missing_dependencies(part, machine.found_by_python)
    if satisfies(machine.python, fmu.requires_python) is False:
        needs.append(f"Python {fmu.requires_python}; this is {machine.python}")
    missing = [name for name in _imports(fmu) if not machine.modules.get(name, False)]
    if missing:
        needs.append(f"{', '.join(missing)} where this Python can import it")
    return Host(needs=tuple(needs))


def other_host(fmu: InspectedFmu, machine: Machine) -> Host:
    """A host that is not Python: Simulink, Modelica tools, programs in C."""
    part = part_for(fmu, machine)
    needs = _general_needs(fmu, machine, part)
    if part is None:
        return Host(needs=tuple(needs))
    needs += missing_dependencies(part, machine.found, without=PYTHON_DLL)
    if part.binary is None or part.binary.dependencies is None:
        return Host(needs=tuple(needs), note="the dependencies of its binary are unknown")
    if not needs_python(part):
        return Host(needs=tuple(needs))
    library = python_library(fmu, machine)
    if library is None:
        return Host(needs=(*needs, _python_to_install(fmu, machine)))
    packages = ", ".join(_imports(fmu))
    note = f"Python {library.version} must be able to import {packages}" if packages else None
    return Host(needs=tuple(needs), start=_start(library, part), note=note)


def python_library(fmu: InspectedFmu, machine: Machine) -> PythonLibrary | None:
    """The best Python for a host that is not Python, among those that satisfy the FMU."""
    fitting = (one for one in machine.python_libraries if satisfies(one.version, fmu.requires_python) is not False)
    return next(fitting, None)


def needs_python(part: PlatformBinary) -> bool:
    """Whether the binary needs a Python of any version from its host or the machine."""
    if part.binary is None:
        return False
    names = part.binary.dependency_names
    if part.binary.system == WINDOWS:
        return any(map(PYTHON_DLL.fullmatch, names))
    return bool(part.binary.python_symbols) and not any(name.startswith("libpython") for name in names)


def satisfies(version: str, requires: str | None) -> bool | None:
    """Whether a version of Python satisfies a requirement; None if there is none, or an invalid one."""
    if requires is None or not is_specifier(requires):
        return None
    return SpecifierSet(requires).contains(version, prereleases=True)


def is_specifier(text: str) -> bool:
    """Whether `text` is a version specifier."""
    try:
        SpecifierSet(text)
    except InvalidSpecifier:
        return False
    return True


def _general_needs(fmu: InspectedFmu, machine: Machine, part: PlatformBinary | None) -> list[str]:
    needs = []
    if fmu.kinds[0] not in CALLED:
        needs.append(f"an FMU for {' or '.join(KINDS[kind] for kind in CALLED)}; it is for {KINDS[fmu.kinds[0]]}")
    if part is None:
        needs.append(f"an FMU with a binary for {machine.system}, {machine.architecture}")
    decoded = part is not None and part.finds_python
    if fmu.python is not None and not decoded and not uri_is_read(machine.temp_folder):
        needs.append(
            "a temp folder (TMPDIR, TEMP) with a path of ASCII letters, digits, - . _ ~ and spaces; "
            f"pythonfmu crashes in {machine.temp_folder}"
        )
    return needs


def _imports(fmu: InspectedFmu) -> tuple[str, ...]:
    return () if fmu.python is None else fmu.python.imports


def _python_to_install(fmu: InspectedFmu, machine: Machine) -> str:
    required = f"Python {fmu.requires_python or '3'}"
    if machine.system == LINUX:
        return f"a shared libpython of {required}: {INSTALL_LIBPYTHON}"
    return f"python3.dll of {required} on PATH"


def _start(library: PythonLibrary, part: PlatformBinary) -> str | None:
    if library.found_by in (PRELOADED, ON_PATH) or (part.finds_python and library.found_by == BY_LOADER):
        return None
    if library.path.suffix == ".dll":
        return f'set "PATH={library.path.parent};%PATH%" && TOOL'
    home = "" if library.home is None else f"PYTHONHOME={library.home} "
    return f"{home}{LIBPYTHON_VARIABLE if part.finds_python else 'LD_PRELOAD'}={library.path} TOOL"
