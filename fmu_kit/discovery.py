"""The slaves that the modules of a folder define, found by reading their sources: nothing is imported."""

import ast
import functools
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fmu_kit.bundle import PackagingError, Target, module_path, parse_source

BASE = ("fmu_kit.slave", "Slave")


def slaves_in(folder: Path) -> list[Target]:
    """The concrete slave classes of a folder, by module; raises `PackagingError`.

    A folder with `__init__.py` is a package, imported from the folder of its outermost package; otherwise each
    module is imported by itself.
    """
    return [target for target, left_open in _derived_in(folder) if not left_open]


def unfinished_in(folder: Path) -> dict[str, list[str]]:
    """The abstract classes of a folder that are derived from `Slave`, each with the methods that it leaves open."""
    return {target.model: left_open for target, left_open in _derived_in(folder) if left_open}


def _derived_in(folder: Path) -> Iterator[tuple[Target, list[str]]]:
    root, package = _root_of(folder.resolve())
    for path in sorted(folder.resolve().glob("*.py")):
        name = ".".join((*package, path.stem)) if path.stem != "__init__" else ".".join(package)
        if not name:
            continue
        for known in _definitions(path.read_text(encoding="utf-8"), path):
            left_open = _left_open(name, known.name, root) if isinstance(known, _Class) else None
            if left_open is not None:
                yield Target(name, known.name, root), left_open


def slave_beside(fmu: Path) -> Target | None:
    """The slave from which an .fmu of this name in this folder is built; None if no module there defines it."""
    definition = f"class {fmu.stem}"
    for path in sorted(fmu.parent.glob("*.py")):
        if definition in path.read_text(encoding="utf-8", errors="ignore"):
            return next((target for target in slaves_in(fmu.parent) if target.model == fmu.stem), None)
    return None


def _root_of(folder: Path) -> tuple[Path, tuple[str, ...]]:
    """The folder that contains the outermost package around a folder, and the path of the folder from there."""
    names: tuple[str, ...] = ()
    while (folder / "__init__.py").is_file():
        folder, names = folder.parent, (folder.name, *names)
    return folder, names


class _Class(NamedTuple):
    """A class of a module: its name, those of its bases, and whether each of its methods is abstract."""

    name: str
    bases: tuple[str, ...]
    methods: tuple[tuple[str, bool], ...]


class _Import(NamedTuple):
    """A name that a module imports from another one, `level` packages above."""

    name: str
    level: int
    module: str
    original: str


@functools.lru_cache(maxsize=1024)
def _definitions(text: str, path: Path) -> tuple[_Class | _Import, ...]:
    """The classes that a source defines and the names that it imports, on its top level, in their order."""
    found: list[_Class | _Import] = []
    for node in parse_source(text, path).body:
        if isinstance(node, ast.ClassDef):
            bases = tuple(base.id for base in node.bases if isinstance(base, ast.Name) and base.id != node.name)
            found.append(_Class(node.name, bases, tuple(_methods(node))))
        elif isinstance(node, ast.ImportFrom):
            found += [_Import(a.asname or a.name, node.level, node.module or "", a.name) for a in node.names]
    return tuple(found)


class _Ancestor(NamedTuple):
    """A class among the ancestors of a slave, with the module that defines it."""

    module: str
    definition: _Class


def _left_open(module: str, name: str, root: Path) -> list[str] | None:
    """The abstract methods of a class that is derived from `Slave`; None for any other."""
    first: dict[str, bool] = {}
    for each in _ancestry(module, name, root):
        first = dict(each.definition.methods) | first
    return [method for method, is_abstract in first.items() if is_abstract] if "step" in first else None


def _ancestry(module: str, name: str, root: Path | None, deepest: int = 20) -> list[_Ancestor]:
    """A class and its ancestors up to `Slave`, in method resolution order, through any modules between them.

    Empty for a name that is not a class derived from `Slave`.
    """
    if (module, name) == BASE:
        return [_Ancestor(module, _Class(name, (), (("step", True),)))]
    try:
        path = module_path(module, root)
        known = _definitions(path.read_text(encoding="utf-8"), path)
    except (OSError, PackagingError):
        return []
    last = next((one for one in reversed(known) if one.name == name), None)
    if last is None or deepest == 0:
        return []
    if isinstance(last, _Import):
        package = module if path.name == "__init__.py" else module.rpartition(".")[0]
        base = importlib.util.resolve_name("." * last.level + last.module, package)
        return _ancestry(base, last.original, root, deepest - 1)
    above = [found for base in last.bases if (found := _ancestry(module, base, root, deepest - 1))]
    return [_Ancestor(module, last), *_linearised([*above, [found[0] for found in above]])] if above else []


def _linearised(lineages: list[list[_Ancestor]]) -> Iterator[_Ancestor]:
    """The C3 linearisation of the ancestors of several bases; ends early where there is none."""
    while lineages := [line for line in lineages if line]:
        first = next((line[0] for line in lineages if not any(line[0] in other[1:] for other in lineages)), None)
        if first is None:
            return
        yield first
        lineages = [line[1:] if line[0] == first else line for line in lineages]


def _methods(node: ast.ClassDef) -> Iterator[tuple[str, bool]]:
    """Each method that a class defines, and whether it is abstract."""
    for each in node.body:
        if isinstance(each, ast.FunctionDef):
            marks = each.decorator_list
            yield each.name, any(isinstance(mark, ast.Name) and mark.id == "abstractmethod" for mark in marks)
