"""The tools that fly, and the call of each."""

import importlib
import importlib.metadata
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from orchestration.errors import UsageError
from orchestration.interop.job import Job, Rows


@dataclass(frozen=True, kw_only=True)
class Tool:
    """One way of one tool to fly both FMUs, or one of them."""

    name: str
    packages: tuple[str, ...]
    """that pip installs for it"""
    call: str
    """module:function in `orchestration.interop.tools`"""
    components: tuple[str, ...] = ("controller", "plant")

    def versions(self) -> dict[str, str]:
        """Of its packages; raises `ModuleNotFoundError`, naming the package, if one is not installed."""
        return {package: importlib.metadata.version(package) for package in self.packages}

    def function(self) -> Callable[[Job], Rows]:
        """The call."""
        module, _, name = self.call.partition(":")
        function: Callable[[Job], Rows] = getattr(
            importlib.import_module(f"orchestration.interop.tools.{module}"), name
        )
        return function


TOOLS = {
    tool.name: tool
    for tool in (
        Tool(name="libcosim", packages=("libcosimpy",), call="libcosim:fly"),
        Tool(name="libcosim, SSP", packages=("libcosimpy",), call="libcosim:fly_ssp"),
        Tool(name="ecos", packages=("ecospy", "tbb"), call="ecos:fly"),
        Tool(name="ecos, SSP", packages=("ecospy", "tbb"), call="ecos:fly_ssp"),
        Tool(name="fmpy, SSP", packages=("fmpy",), call="fmpy:fly_ssp"),
        Tool(name="fmucontainer", packages=("fmu-manipulation-toolbox",), call="container:fly_jacobi"),
        Tool(name="fmucontainer -sequential", packages=("fmu-manipulation-toolbox",), call="container:fly_sequential"),
        Tool(name="fmpy, plant alone", packages=("fmpy",), call="fmpy:fly_plant", components=("plant",)),
        Tool(name="fmpy, controller alone", packages=("fmpy",), call="fmpy:fly_controller", components=("controller",)),
    )
}


def chosen(names: Sequence[str] | None) -> list[Tool]:
    """The tools of these names, each once, all if there are none; raises `UsageError` naming those that exist."""
    for name in names or ():
        if name not in TOOLS:
            raise UsageError(f"--tool {name}: expected one of {'; '.join(TOOLS)}")
    return [TOOLS[name] for name in dict.fromkeys(names or TOOLS)]
