"""Where a call of the operating system fails, files are old or new, and errors are one line."""

import json
import sys
from pathlib import Path

import pytest

from tests.faults import page, shim
from tests.fmus.process import run


@pytest.mark.skipif(shim.lack() is not None, reason=shim.lack() or "")
def test_files_are_old_or_new_whichever_call_fails(tmp_path: Path) -> None:
    rows = tmp_path / "rows.json"
    done = run(sys.executable, "-m", "tests.faults", "new", "ssp", "--most", "2", "--out", str(rows))
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    found = json.loads(rows.read_text())
    assert {row["operation"].partition(":")[0] for row in found} >= {"write", "open", "rename", "fsync"}
    assert {row["outcome"] for row in found} == set(page.GOOD)


def test_the_page_has_the_counts_of_the_rows() -> None:
    rows = json.loads(page.DATA.read_text(encoding="utf-8"))
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.page(text, rows) == text
    assert page.as_json(rows) == page.DATA.read_text(encoding="utf-8")
