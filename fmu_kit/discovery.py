"""The slaves that the modules of a folder define, found by reading their sources: nothing is imported."""

import ast
import importlib.util
from pathlib import Path

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
            if isinstance(node, ast.ClassDef) and _open_methods(name, node.name, root) == frozenset():
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


def _open_methods(module: str, name: str, root: Path | None, deepest: int = 20) -> frozenset[str] | None:
    """The methods that a class made from `Slave` still leaves to others, whatever modules lie between.

    None for a name that is no such class.
    """
    if (module, name) == BASE:
        return frozenset({"step"})
    try:
        path = module_path(module, root)
        body = tree_of(path.read_text(encoding="utf-8"), path).body
    except (OSError, PackagingError):
        return None
    if deepest == 0:
        return None
    for node in reversed(body):
        if isinstance(node, ast.ClassDef) and node.name == name:
            bases = [base.id for base in node.bases if isinstance(base, ast.Name) and base.id != name]
            inherited = [_open_methods(module, base, root, deepest - 1) for base in bases]
            found = [each for each in inherited if each is not None]
            return _left_open(node, frozenset().union(*found)) if found else None
        if isinstance(node, ast.ImportFrom):
            package = module if path.name == "__init__.py" else module.rpartition(".")[0]
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    return _open_methods(base, alias.name, root, deepest - 1)
    return None


def _left_open(node: ast.ClassDef, inherited: frozenset[str]) -> frozenset[str]:
    """What a class leaves open of what those that it is made of do, and what it leaves open itself."""
    methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
    abstract = {
        each.name
        for each in methods
        if any(isinstance(mark, ast.Name) and mark.id == "abstractmethod" for mark in each.decorator_list)
    }
    return (inherited - {each.name for each in methods}) | abstract
