"""The slaves that the modules of a folder define, found by reading their sources: nothing is imported."""

import ast
import importlib.util
from pathlib import Path

from fmu_kit.bundle import PackagingError, Target, module_path, tree_of

BASE = ("fmu_kit.slave", "Slave")


def slaves_in(folder: Path) -> list[Target]:
    """The slave classes of a folder that say what they are (`description`), by module; raises `PackagingError`.

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
            if isinstance(node, ast.ClassDef) and _describes_itself(node) and _is_slave(name, node.name, root):
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


def _describes_itself(node: ast.ClassDef) -> bool:
    assigned = [target for each in node.body if isinstance(each, ast.Assign) for target in each.targets]
    assigned += [each.target for each in node.body if isinstance(each, ast.AnnAssign) and each.value is not None]
    return any(isinstance(target, ast.Name) and target.id == "description" for target in assigned)


def _is_slave(module: str, name: str, root: Path, deepest: int = 20) -> bool:
    """Whether a name in a module is `Slave` or a class made from it, whatever modules lie between."""
    if (module, name) == BASE:
        return True
    try:
        path = module_path(module, root)
        body = tree_of(path.read_text(encoding="utf-8"), path).body
    except (OSError, PackagingError):
        return False
    if deepest == 0:
        return False
    for node in reversed(body):
        if isinstance(node, ast.ClassDef) and node.name == name:
            bases = [base.id for base in node.bases if isinstance(base, ast.Name) and base.id != name]
            return any(_is_slave(module, base, root, deepest - 1) for base in bases)
        if isinstance(node, ast.ImportFrom):
            package = module if path.name == "__init__.py" else module.rpartition(".")[0]
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    return _is_slave(base, alias.name, root, deepest - 1)
    return False
