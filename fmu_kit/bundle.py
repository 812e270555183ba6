"""The sources that an FMU bundles: those its slave needs, found without importing any, in a package unique to it."""

import ast
import functools
import importlib.util
import re
import sys
from dataclasses import dataclass
from pathlib import Path

from fmu_kit.syntax_trees import parse_module, statements
from fmu_kit.variants import MODULE, Variant

SHARED_PACKAGES = ("fmu_kit", "pythonfmu")
"""Packages that every FMU bundles; beyond them, a slave may import what lies beside it and the standard library."""

EMPTY_INIT = {"pythonfmu/__init__.py"}
"""Package files replaced by empty ones, since pythonfmu's own imports its builder."""


class PackagingError(Exception):
    """The slave cannot be packed, for the reason that the text gives."""


@dataclass(frozen=True, slots=True)
class Target:
    """A slave class, by the module that defines it."""

    module: str
    model: str
    root: Path | None = None
    """the folder that is searched for modules first; None: only `sys.path` is searched"""
    variant: Variant | None = None
    """Variant of the slave, with fixed values; None: the slave itself"""

    @classmethod
    def parse(cls, text: str, root: Path | None = None) -> "Target":
        """From `module:Class`; raises `PackagingError` for another form."""
        module, colon, model = text.partition(":")
        if not (module and colon and model):
            raise PackagingError(f"{text}: expected module:Class")
        return cls(module, model, root)

    def bundles(self, module: str) -> bool:
        """Whether the FMU bundles a module: one of the kit, of pythonfmu, of the slave's package or beside that.

        What lies beside the slave in site-packages is not bundled.
        """
        top, own = module.partition(".")[0], self.module.partition(".")[0]
        if top in (*SHARED_PACKAGES, own):
            return True
        path = module_path(own, self.root)
        folder = path.parent.parent if path.name == "__init__.py" else path.parent
        beside = (folder / top / "__init__.py").is_file() or (folder / f"{top}.py").is_file()
        return beside and folder.name not in ("site-packages", "dist-packages")

    @property
    def name(self) -> str:
        """The name of its FMU."""
        return self.model if self.variant is None else self.variant.name

    @property
    def entry(self) -> str:
        """The module that defines what is packed."""
        return self.module if self.variant is None else MODULE

    @property
    def fragment(self) -> Path:
        """The path of the hand-written part of its documentation, if it has one: beside it, under its name."""
        return module_path(self.module, self.root).with_name(f"{self.model}.html")

    @property
    def icon(self) -> Path:
        """The path of its icon, if it has one."""
        return module_path(self.module, self.root).with_name(f"{self.model}.png")


def bundled_sources(target: Target) -> dict[str, str]:
    """The text of every module that the slave needs, by its path in the bundle; none is imported.

    Raises `PackagingError` for an import of what is neither bundled nor in the standard library.
    """
    sources: dict[str, str] = {}
    found: set[str] = set()
    waiting = [target.module, "fmu_kit.failure"]
    while waiting:
        module = waiting.pop()
        if module in found:
            continue
        found.add(module)
        path = module_path(module, target.root)
        key = _path_in_bundle(module, path)
        sources[key] = "" if key in EMPTY_INIT else path.read_text(encoding="utf-8")
        package = module if path.name == "__init__.py" else module.rpartition(".")[0]
        waiting += _imported_modules(sources[key], package, path, target)
        if "." in module:
            waiting.append(module.rpartition(".")[0])
    if target.variant is not None:
        sources[f"{MODULE}.py"] = target.variant.source(target.module, target.model)
    return dict(sorted(sources.items()))


def module_path(module: str, root: Path | None = None) -> Path:
    """The path of a module's source, found without importing anything; raises `PackagingError` if it has none."""
    top, *rest = module.split(".")
    base = _top_level(top, root)
    if base is None:
        raise PackagingError(f"{module}: expected an importable package with sources")
    if rest or base.is_dir():
        base = base.joinpath(*rest)
        base = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
    if not base.is_file():
        raise PackagingError(f"{module}: no source at {base}")
    return base


def _top_level(name: str, root: Path | None) -> Path | None:
    """The folder of a package or the file of a module."""
    if root is not None:
        if (root / name / "__init__.py").is_file():
            return root / name
        if (root / f"{name}.py").is_file():
            return root / f"{name}.py"
    try:
        return _installed(name, tuple(sys.path))
    except LookupError:
        return None


@functools.cache
def _installed(name: str, path: tuple[str, ...]) -> Path:
    """The path at which Python finds a package or module while `sys.path` is `path`.

    Raises `LookupError` if there is none, which is not cached, since it may be installed later.
    """
    spec = importlib.util.find_spec(name) if name else None
    if spec is None or spec.origin is None or not spec.has_location:
        raise LookupError(name)
    origin = Path(spec.origin)
    return origin.parent if origin.name == "__init__.py" else origin


def path_in_bundle(module: str, root: Path | None = None) -> str:
    """The path of a module in the bundle."""
    return _path_in_bundle(module, module_path(module, root))


def _path_in_bundle(module: str, path: Path) -> str:
    return "/".join(module.split(".")) + ("/__init__.py" if path.name == "__init__.py" else ".py")


def parse_source(text: str, path: Path) -> ast.Module:
    """The syntax tree of a source; raises `PackagingError` if it is not Python."""
    try:
        return parse_module(text, str(path))
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None) or 1
        raise PackagingError(f"{path}:{line}: {getattr(error, 'msg', error)}; expected Python") from error


@functools.cache
def _imported_modules(text: str, package: str, path: Path, target: Target) -> tuple[str, ...]:
    """The bundled modules that a source imports; raises `PackagingError` for a form that cannot be renamed."""
    found = []
    for node in _imports(text, path):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
            if any(target.bundles(name) for name in names):
                raise PackagingError(f"{path}:{node.lineno}: expected `from package.module import name` in an FMU")
        else:
            base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            names = [base]
            if target.bundles(base):
                root = target.root
                found += [base, *(f"{base}.{alias.name}" for alias in node.names if _is_module(base, alias.name, root))]
                continue
        for name in names:
            if name.partition(".")[0] not in sys.stdlib_module_names:
                raise PackagingError(f"{path}:{node.lineno}: imports {name}, but an FMU has the standard library only")
    return tuple(found)


@functools.cache
def _imports(text: str, path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """The import statements of a source."""
    return tuple(node for node in statements(parse_source(text, path)) if isinstance(node, ast.Import | ast.ImportFrom))


def _is_module(package: str, name: str, root: Path | None) -> bool:
    base = module_path(package, root)
    return base.name == "__init__.py" and ((base.parent / f"{name}.py").is_file() or (base.parent / name).is_dir())


def rename_imports(text: str, bundle: str, target: Target) -> str:
    """The source with its imports of bundled packages redirected to the bundle."""
    lines = text.encode().splitlines(keepends=True)
    imports = [
        node
        for node in statements(parse_module(text))
        if isinstance(node, ast.ImportFrom) and node.level == 0 and target.bundles(node.module or "")
    ]
    for node in sorted(imports, key=lambda node: -node.col_offset):  # from the right, so that columns stay valid
        line, column = lines[node.lineno - 1], node.col_offset
        moved = re.sub(rb"from\s+", f"from {bundle}.".encode(), line[column:], count=1)
        lines[node.lineno - 1] = line[:column] + moved
    return b"".join(lines).decode()
