"""The districts and rooms on the page of the architecture, from the contracts and the packages' own docstrings.

`python -m docs.make_architecture` writes them into `docs/architecture.md`, between its two markers.
"""

import ast
from pathlib import Path

from orchestration.foundation.basics.documents import read_toml

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/architecture.md"
BEGIN, END = "<!-- python -m docs.make_architecture -->\n", "<!-- end -->\n"


def layers() -> dict[str, list[list[str]]]:
    """Floors of each package that a contract holds, the top one first; a floor is the names of its folders."""
    contracts = read_toml(ROOT / "pyproject.toml", "project")["tool"]["importlinter"]["contracts"]
    return {
        contract["containers"][0]: [layer.split(" | ") for layer in contract["layers"]]
        for contract in contracts
        if contract.get("exhaustive")
    }


def page(text: str) -> str:
    """The page of that text with districts and rooms as they are now."""
    before, _, rest = text.partition(BEGIN)
    return before + BEGIN + _districts() + END + rest.partition(END)[2]


def _districts() -> str:
    floors = layers()
    names = [district for (district,) in floors["orchestration"]]
    lines = ["", "| district | what it is for |", "|---|---|"]
    lines += [f"| [`{name}/`](#{name}) | {_docstring(f'orchestration/{name}')[0]} |" for name in names]
    for name in names:
        lines += ["", f"### `{name}/`", *_docstring(f"orchestration/{name}")[1:]]
        if rooms := floors.get(f"orchestration.{name}"):
            lines += ["", "| floor | room | what is in it |", "|---|---|---|"]
        for number, floor in zip(range(len(rooms or ()), 0, -1), rooms or ()):
            for room in floor:
                lines += [f"| {number} | `{room}` | {_docstring(f'orchestration/{name}/{room}')[0]} |"]
    return "\n".join([*lines, "", ""])


def _docstring(package: str) -> list[str]:
    text = (ROOT / package / "__init__.py").read_text(encoding="utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").splitlines()


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
