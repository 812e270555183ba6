"""Docstrings of the fields of a class, read from its source without importing it, so that `--help` loads no record."""

import ast
import functools
import importlib.util
import inspect
import itertools
from collections.abc import Mapping
from typing import NamedTuple


class FieldDoc(NamedTuple):
    """The documentation of a field."""

    text: str
    """The string below the field, in one line."""
    default: str
    """Source text of its default; empty if it has none."""


@functools.cache
def attribute_docs(module: str, name: str) -> Mapping[str, FieldDoc]:
    """The documentation of each field of the class `name` in a module; empty if there is no source."""
    body = next((node.body for node in _classes(module) if node.name == name), [])
    return {
        field.target.id: FieldDoc(
            inspect.cleandoc(doc.value.value).replace("\n", " "),
            "" if field.value is None else ast.unparse(field.value),
        )
        for field, doc in itertools.pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(doc, ast.Expr)
        and isinstance(doc.value, ast.Constant)
        and isinstance(doc.value.value, str)
    }


@functools.cache
def _classes(module: str) -> list[ast.ClassDef]:
    spec = importlib.util.find_spec(module)
    get_source = getattr(spec.loader, "get_source", None) if spec is not None else None
    source = get_source(module) if get_source is not None else None
    return [node for node in ast.parse(source or "").body if isinstance(node, ast.ClassDef)]
