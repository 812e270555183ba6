"""The slaves that the modules of a folder define, found by reading their sources: nothing is imported."""

import ast
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
    root, package = _root_of(folder.resolve())
    found = []
    for path in sorted(folder.resolve().glob("*.py")):
        name = ".".join((*package, path.stem)) if path.stem != "__init__" else ".".join(package)
        if not name:
            continue
        for node in parse_source(path.read_text(encoding="utf-8"), path).body:
            if isinstance(node, ast.ClassDef) and _is_concrete(name, node.name, root):
                found.append(Target(name, node.name, root))
    return found


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
    """A class among the ancestors of a slave: its module, its name, and whether each of its methods is abstract."""

    module: str
    name: str
    methods: tuple[tuple[str, bool], ...]


def _is_concrete(module: str, name: str, root: Path) -> bool:
    """Whether a class is derived from `Slave` and has no abstract method."""
    first: dict[str, bool] = {}
    for each in _ancestry(module, name, root):
        first = dict(each.methods) | first
    return first.get("step") is False and not any(first.values())


def _ancestry(module: str, name: str, root: Path | None, deepest: int = 20) -> list[_Class]:
    """A class and its ancestors up to `Slave`, in method resolution order, through any modules between them.

    Empty for a name that is not a class derived from `Slave`.
    """
    if (module, name) == BASE:
        return [_Class(module, name, (("step", True),))]
    try:
        path = module_path(module, root)
        body = parse_source(path.read_text(encoding="utf-8"), path).body
    except (OSError, PackagingError):
        return []
    if deepest == 0:
        return []
    for node in reversed(body):
        if isinstance(node, ast.ClassDef) and node.name == name:
            bases = [base.id for base in node.bases if isinstance(base, ast.Name) and base.id != name]
            above = [found for base in bases if (found := _ancestry(module, base, root, deepest - 1))]
            own = _Class(module, name, tuple(_methods(node)))
            return [own, *_linearised([*above, [found[0] for found in above]])] if above else []
        if isinstance(node, ast.ImportFrom):
            package = module if path.name == "__init__.py" else module.rpartition(".")[0]
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    return _ancestry(base, alias.name, root, deepest - 1)
    return []


def _linearised(lineages: list[list[_Class]]) -> Iterator[_Class]:
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
