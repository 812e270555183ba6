"""What an editor, a page or another tool shows of a name, alone, begins with the noun."""

import ast
import itertools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.places import ROOT

FOLDERS = ["orchestration", "fmu_kit", "controller_fmu", "plant_fmu", "quadcosim", "examples", "docs", "benchmarks"]
FRAGMENT = re.compile(
    r"\s*(?:$|[\[(]|(?:about|above|after|against|along|among|and|around|as|at|because|before|below|beside|between|but|by"
    r"|during|for|from|how|if|in|into|like|of|on|onto|or|over|per|since|so|than|that|then|through|to|under|until|upon"
    r"|what|when|where|which|while|who|with|within|without)\b)",
    re.I,
)
"""Beginning of a text that needs the name before it: a unit, a preposition or a conjunction"""
VARIABLE = re.compile(r'\b(?:Input|Output|State|Local|(?:Fixed)?Parameter)\(\s*"([^"]*)"')


def files(folder: str, *endings: str) -> list[Path]:
    return [path for path in sorted((ROOT / folder).rglob("*")) if path.name.endswith(endings)]


def attribute_texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Lines and texts of the docstrings of attributes: strings below an assignment."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for above, below in itertools.pairwise(body if isinstance(body, list) else ()):
            text = (
                below.value if isinstance(below, ast.Expr) and isinstance(above, (ast.Assign, ast.AnnAssign)) else None
            )
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                yield text.lineno, text.value


@pytest.mark.parametrize("folder", FOLDERS)
def test_docstrings_of_attributes_begin_with_the_noun(folder: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path in files(folder, ".py")
        for line, text in attribute_texts(ast.parse(path.read_text(encoding="utf-8")))
        if FRAGMENT.match(text)
    ]
    assert not found


@pytest.mark.parametrize("folder", FOLDERS)
def test_descriptions_of_variables_begin_with_the_noun(folder: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}: {text}"
        for path in files(folder, ".py", ".tmpl", ".md")
        for text in VARIABLE.findall(path.read_text(encoding="utf-8"))
        if FRAGMENT.match(text)
    ]
    assert not found
