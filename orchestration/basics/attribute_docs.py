"""What the source says of the fields of a class, read without importing it: `--help` loads no record."""

import ast
import functools
import importlib.util
import inspect
import itertools
from collections.abc import Mapping
from typing import NamedTuple


class Said(NamedTuple):
    """A field in the words of its source."""

    text: str
    """What stands below it, in one line."""
    default: str
    """Its default as it is written; empty where it has none."""


@functools.cache
def attribute_docs(module: str, name: str) -> Mapping[str, Said]:
    """By field what is said of it in the class `name` of a module; none where there is no source."""
    body = next((node.body for node in _classes(module) if node.name == name), [])
    return {
        field.target.id: Said(
            inspect.cleandoc(said.value.value).replace("\n", " "),
            "" if field.value is None else ast.unparse(field.value),
        )
        for field, said in itertools.pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(said, ast.Expr)
        and isinstance(said.value, ast.Constant)
        and isinstance(said.value.value, str)
    }


@functools.cache
def _classes(module: str) -> list[ast.ClassDef]:
    spec = importlib.util.find_spec(module)
    get_source = getattr(spec.loader, "get_source", None) if spec is not None else None
    source = get_source(module) if get_source is not None else None
    return [node for node in ast.parse(source or "").body if isinstance(node, ast.ClassDef)]
