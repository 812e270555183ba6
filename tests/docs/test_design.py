"""The page on the compiler does what it says: its blocks run one after the other, and print what is shown."""

import contextlib
import io
import sys
from pathlib import Path
from typing import Any

import pytest

from docs.newcomer.blocks import blocks_of
from tests.fmu_kit.compiler.compiled import compiler
from tests.places import ROOT


def test_the_blocks_of_the_compilers_page_print_what_it_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiler("cc")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    names: dict[str, Any] = {}
    printed = ""
    shown = 0
    try:
        for block in blocks_of(Path("docs/design/compiler.md"), ROOT):
            if block.name:
                Path(block.name).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                with contextlib.redirect_stdout(io.StringIO()) as output:
                    exec(compile(block.text, block.place, "exec"), names)
                printed = output.getvalue()
            else:
                shown += 1
                assert printed.strip() == block.text.strip(), block.place
    finally:
        sys.modules.pop("tank", None)
    assert shown == 3
