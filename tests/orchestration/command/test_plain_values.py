"""Values of a command line that are taken as they are: the parser would give the same."""

from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
import typer.main

from orchestration.command import registry
from orchestration.command.registry import PlainCommand

TEXTS = ["0", "1", "-1", "+2", "1.5", ".5", "5.", "1e3", "1E-300", "1e999", "nan", "inf", " 1", "1_0", "0x1", "", "a"]
seen: list[Any] = []


def command(
    text: Annotated[str | None, typer.Option()] = None,
    number: Annotated[float, typer.Option()] = 2.0,
    whole: Annotated[int | None, typer.Option()] = None,
    ranged: Annotated[int | None, typer.Option(min=1, max=3)] = None,
    path: Annotated[Path | None, typer.Option()] = None,
    several: Annotated[list[str] | None, typer.Option()] = None,
    flag: Annotated[bool, typer.Option()] = False,
) -> None:
    seen.append((text, number, whole, ranged, path, several, flag))


def outcome(*words: str) -> Any:
    app = typer.Typer()
    app.command(cls=PlainCommand)(command)
    seen.clear()
    try:
        typer.main.get_command(app)([*words], prog_name="x", standalone_mode=False)
    except Exception as error:
        return type(error), str(error)
    return repr(seen)


def test_each_value_is_what_the_parser_makes_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[list[str]] = [[], ["--flag"], ["--several", "a", "--several", "b"]]
    lines += [[f"--{name}={text}"] for name in ("text", "number", "whole", "ranged", "path") for text in TEXTS]
    found = [outcome(*line) for line in lines]
    monkeypatch.setattr(registry, "_plain", lambda value, parameter: registry._LEFT)
    for line, one in zip(lines, found, strict=True):
        assert one == outcome(*line), line
