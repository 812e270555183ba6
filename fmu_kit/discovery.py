"""The slaves that the modules of a folder define, found by reading their sources: nothing is imported."""

import ast
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fmu_kit.bundle import PackagingError, Target, module_path, tree_of

BASE = ("fmu_kit.slave", "Slave")


def slaves_in(folder: Path) -> list[Target]:
    """The slave classes of a folder that leave no method open, by module; raises `PackagingError`.

    A folder with `__init__.py` is a package, and found by its name where its outermost package lies; in another
    one each module stands for itself.
    """
    root, package = _root_of(folder.resolve())
    found = []
    for path in sorted(folder.resolve().glob("*.py")):
        name = ".".join((*package, path.stem)) if path.stem != "__init__" else ".".join(package)
        if not name:
            continue
        for node in tree_of(path.read_text(encoding="utf-8"), path).body:
            if isinstance(node, ast.ClassDef) and _is_whole(name, node.name, root):
                found.append(Target(name, node.name, root))
    return found


def slave_beside(fmu: Path) -> Target | None:
    """The slave that an .fmu of this name in this folder is built from; None if no module there defines it."""
    named = f"class {fmu.stem}"
    for path in sorted(fmu.parent.glob("*.py")):
        if named in path.read_text(encoding="utf-8", errors="ignore"):
            return next((target for target in slaves_in(fmu.parent) if target.model == fmu.stem), None)
    return None


def _root_of(folder: Path) -> tuple[Path, tuple[str, ...]]:
    """Where the outermost package around a folder lies, and the path of the folder from there."""
    names: tuple[str, ...] = ()
    while (folder / "__init__.py").is_file():
        folder, names = folder.parent, (folder.name, *names)
    return folder, names


class _Class(NamedTuple):
    """One of those that a slave is made of: where it stands, and for each method that it has whether it is open."""

    module: str
    name: str
    methods: tuple[tuple[str, bool], ...]


def _is_whole(module: str, name: str, root: Path) -> bool:
    """Whether a class is made from `Slave` and leaves none of its methods to others."""
    first: dict[str, bool] = {}
    for each in _ancestry(module, name, root):
        first = dict(each.methods) | first
    return first.get("step") is False and not any(first.values())


def _ancestry(module: str, name: str, root: Path | None, deepest: int = 20) -> list[_Class]:
    """A class and those that it is made of, up to `Slave`, in the order in which Python looks for a method.

    Empty for a name that is no such class, whatever modules lie between.
    """
    if (module, name) == BASE:
        return [_Class(module, name, (("step", True),))]
    try:
        path = module_path(module, root)
        body = tree_of(path.read_text(encoding="utf-8"), path).body
    except (OSError, PackagingError):
        return []
    if deepest == 0:
        return []
    for node in reversed(body):
        if isinstance(node, ast.ClassDef) and node.name == name:
            bases = [base.id for base in node.bases if isinstance(base, ast.Name) and base.id != name]
            above = [found for base in bases if (found := _ancestry(module, base, root, deepest - 1))]
            own = _Class(module, name, tuple(_methods(node)))
            return [own, *_merged([*above, [found[0] for found in above]])] if above else []
        if isinstance(node, ast.ImportFrom):
            package = module if path.name == "__init__.py" else module.rpartition(".")[0]
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    return _ancestry(base, alias.name, root, deepest - 1)
    return []


def _merged(lines: list[list[_Class]]) -> Iterator[_Class]:
    """Of the lines of ancestors of several bases the one that keeps their order (C3); ends where there is none."""
    while lines := [line for line in lines if line]:
        first = next((line[0] for line in lines if not any(line[0] in other[1:] for other in lines)), None)
        if first is None:
            return
        yield first
        lines = [line[1:] if line[0] == first else line for line in lines]


def _methods(node: ast.ClassDef) -> Iterator[tuple[str, bool]]:
    """Each method that a class defines, and whether it leaves that open."""
    for each in node.body:
        if isinstance(each, ast.FunctionDef):
            marks = each.decorator_list
            yield each.name, any(isinstance(mark, ast.Name) and mark.id == "abstractmethod" for mark in marks)
