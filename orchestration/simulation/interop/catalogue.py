"""The tools that run a system, and the call of each."""

import importlib
import importlib.metadata
import os
import subprocess
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.processes import subprocesses
from orchestration.simulation.interop.job import Job, Rows


@dataclass(frozen=True, kw_only=True)
class Tool:
    """One way of one tool to run a system, or one component of it."""

    name: str
    packages: tuple[str, ...]
    """Packages that it needs from pip"""
    call: str
    """module:function in `orchestration.simulation.interop.tools`"""
    alone: str | None = None
    """the component that it runs, if it is no master"""
    converts: bool = False
    """whether it supports connections between variables of different types"""
    sets_reals_only: bool = False
    """whether it sets all parameters as Reals, which those of another type refuse"""
    python: str | None = None
    """environment variable with the path of a Python with its packages, if these conflict with those of this project"""

    def versions(self) -> dict[str, str]:
        """The versions of its packages; raises `ModuleNotFoundError`, naming the package, if one is not installed.

        Raises `UsageError` if the Python that it needs is not given, or lacks the packages.
        """
        if self.python is None:
            return {package: importlib.metadata.version(package) for package in self.packages}
        ask = "import importlib.metadata, sys; print(*map(importlib.metadata.version, sys.argv[1:]))"
        try:
            done = subprocess.run(
                [self._other_python(), "-I", "-c", ask, *self.packages], capture_output=True, text=True, check=True
            )
        except (OSError, subprocess.CalledProcessError):
            raise self._no_python() from None
        return dict(zip(self.packages, done.stdout.split(), strict=True))

    def command(self, job: Path, rows: Path) -> list[str] | subprocesses.Module:
        """The command or module that runs a job in a separate process and writes the rows."""
        if self.python is None:
            return subprocesses.Module.of("orchestration.simulation.interop.tool_process", self.name, job, rows)
        module, _, function = self.call.partition(":")
        script = Path(__file__).parent / "tools" / f"{module}.py"
        return [self._other_python(), "-I", str(script), function, str(job), str(rows)]

    def _other_python(self) -> str:
        path = os.environ.get(self.python or "")
        if not path:
            raise self._no_python()
        return str(Path(path).absolute())  # not resolved: an environment is a link

    def _no_python(self) -> UsageError:
        return UsageError(
            f"--tool {self.name}: expected in {self.python} the path of a Python in a separate environment, "
            f"with {', '.join(self.packages)} installed there by pip"
        )

    def function(self) -> Callable[[Job], Rows]:
        """The function of its call."""
        module, _, name = self.call.partition(":")
        function: Callable[[Job], Rows] = getattr(
            importlib.import_module(f"orchestration.simulation.interop.tools.{module}"), name
        )
        return function


COFMUPY = "QUADCOSIM_COFMUPY"
"""path of a Python with cofmupy, which requires other versions of fmpy and pythonfmu than this project"""

TOOLS = {
    name: Tool(name=name, **{**keys, "packages": tuple(keys["packages"])})
    for name, keys in read_toml(Path(__file__).with_suffix(".toml"), "catalogue of tools").items()
}


def chosen(names: Sequence[str] | None, components: Collection[str]) -> list[Tool]:
    """The tools of these names, each once; raises `UsageError` naming those that exist.

    Without names, all but those that need a separate Python that is not given, or a component that a system of these
    `components` does not have.
    """
    for name in names or ():
        if name not in TOOLS:
            raise UsageError(f"--tool {name}: expected one of {'; '.join(TOOLS)}")
        alone = TOOLS[name].alone
        if alone is not None and alone not in components:
            raise UsageError(f"--tool {name}: expected a system with a component {alone}")
    if not names:
        possible = [tool for tool in TOOLS.values() if tool.alone is None or tool.alone in components]
        return [tool for tool in possible if tool.python is None or os.environ.get(tool.python)]
    return [TOOLS[name] for name in dict.fromkeys(names)]
