"""The Python sources that pythonfmu has packed into an FMU, and their imports, found without importing."""

import ast
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fmu_kit.syntax_trees import parse_module
from orchestration.components.fmi.slaves import ENTRY
from orchestration.foundation.processes.passable import passable

_MODULES = (".py", ".so", ".pyd")
_IMPORT_ERRORS = {"ImportError", "ModuleNotFoundError"}


@passable
@dataclass(frozen=True, kw_only=True)
class PythonSources:
    """The requirements of the sources in an FMU of pythonfmu."""

    imports: tuple[str, ...]
    """Top-level packages that are neither bundled nor in the standard library of this Python."""
    problems: tuple[str, ...]


def read(files: Mapping[str, bytes]) -> PythonSources | None:
    """Read the sources in `resources`, of files by name; None for an FMU that pythonfmu did not make."""
    if ENTRY not in files:
        return None
    bundled = set(filter(None, map(_bundled, files)))
    imports: set[str] = set()
    problems = []
    entry = files[ENTRY].decode("utf-8", "replace").strip()
    if f"resources/{entry}.py" not in files:
        problems.append(f"{ENTRY} names {entry}, but there is no resources/{entry}.py")
    for name in files:
        if name.startswith("resources/") and name.endswith(".py"):
            try:
                imports |= set(_needed(parse_module(files[name])))
            except (SyntaxError, ValueError) as error:
                problems.append(f"{name}: not Python {sys.version_info[0]}.{sys.version_info[1]}: {error}")
    beyond = imports - bundled - sys.stdlib_module_names
    return PythonSources(imports=tuple(sorted(beyond)), problems=tuple(problems))


def _bundled(name: str) -> str | None:
    """The name by which a file of the archive, or the package that it is in, can be imported."""
    folder, _, place = name.partition("/")
    return (
        place.partition("/" if "/" in place else ".")[0] if folder == "resources" and place.endswith(_MODULES) else None
    )


def _needed(node: ast.AST) -> Iterator[str]:
    """Top-level packages imported in a tree, without optional ones."""
    if isinstance(node, ast.Import):
        yield from (alias.name.partition(".")[0] for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        if node.level == 0 and node.module is not None:
            yield node.module.partition(".")[0]
    elif isinstance(node, ast.Try) and any(map(_catches_import_error, node.handlers)):
        for statement in (*node.orelse, *node.finalbody):
            yield from _needed(statement)
    elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
        for statement in node.orelse:
            yield from _needed(statement)
    else:
        for child in ast.iter_child_nodes(node):
            yield from _needed(child)


def _catches_import_error(handler: ast.ExceptHandler) -> bool:
    caught = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(isinstance(error, ast.Name) and error.id in _IMPORT_ERRORS for error in caught)
