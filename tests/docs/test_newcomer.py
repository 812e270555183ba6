"""What can be seen of the pages without following them: each block is known, names flags that exist, and can be read.

`make newcomer` follows them all.
"""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from docs.newcomer.blocks import Block, blocks_of
from docs.newcomer.following import BlockFailed, Newcomer
from docs.newcomer.pages import pages
from docs.newcomer.readers import reader_of
from orchestration.command.cli import command_line
from orchestration.foundation.basics.documents import read_toml
from tests.commands import Main
from tests.places import ROOT

PAGES = pages(ROOT)
BLOCKS = [block for page in PAGES for block in blocks_of(page, ROOT)]
LINES = [(block, line) for block in BLOCKS if block.is_shell and not block.name for line in block.lines]
COMMANDS = [
    (block, words[1:]) for block, line in LINES if (words := shlex.split(line, comments=True))[0] == "quadcosim"
]
GROUP: Any = command_line()


def page(folder: Path, text: str) -> list[Block]:
    """The blocks of a page with this text."""
    (folder / "page.md").write_text(text)
    return blocks_of(Path("page.md"), folder)


def follow_page(text: str, folder: Path) -> Newcomer:
    """A newcomer who has followed a page with this text."""
    newcomer = Newcomer(folder, lambda line: None)
    newcomer.start_page()
    for block in page(folder, text):
        newcomer.follow(block)
    return newcomer


def test_every_page_is_read_the_readme_first() -> None:
    assert PAGES[0] == Path("README.md")
    assert len(BLOCKS) > 80
    assert {path.relative_to(ROOT) for path in (ROOT / "docs").rglob("*.md")} <= set(PAGES)


def test_every_block_is_run_read_written_or_said_not_to_be() -> None:
    known = [b for b in BLOCKS if b.is_shell or b.is_shown or b.name or b.language in ("python", "toml")]
    assert [block.place for block in BLOCKS if block not in known and block.skipped is None] == []


def test_an_indented_block_is_lines_for_a_shell_and_formulas_are_marked_as_text() -> None:
    begins = re.compile(r"[A-Z_]+=\S+ |[\w./-]+( |$)", re.ASCII)
    assert [f"{block.place}: {line}" for block, line in LINES if not begins.match(line)] == []


def test_every_reason_is_one_that_a_reader_understands() -> None:
    reasons = {note.reason for block in BLOCKS for note in block.notes}
    assert all(len(reason.split()) > 1 for reason in reasons)


def test_every_command_of_the_pages_has_the_flags_and_arguments_that_it_is_given() -> None:
    assert len(COMMANDS) > 60
    for block, (name, *arguments) in COMMANDS:
        if name.startswith("-") or "--help" in arguments:
            continue
        ends = [at for at, word in enumerate(arguments) if word in (">", "&&", "|")]
        try:
            GROUP.commands[name].make_context(name, arguments[: ends[0]] if ends else arguments)
        except Exception as error:
            raise AssertionError(f"{block.place}: quadcosim {name} {' '.join(arguments)}") from error


def test_every_file_that_a_command_of_the_pages_reads_is_there_or_made_by_its_page() -> None:
    for block, words in COMMANDS:
        made = {b.name for b in BLOCKS if b.page == block.page and b.name}
        made |= {word for b, line in LINES if b.page == block.page for word in shlex.split(line, comments=True)[1:]}
        read = [word for word in words if word.endswith(".toml") and "/" in word and not word.startswith("results")]
        assert [word for word in read if word not in made and not (ROOT / word).is_file()] == [], block.place
        assert [w for w in read if w.startswith(("studies/", "examples/")) and not (ROOT / w).is_file()] == []


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == "toml"], ids=lambda b: b.place)
def test_every_toml_block_is_read_by_what_it_is_for(block: Block, tmp_path: Path) -> None:
    for folder in ("examples", "gains", "studies"):  # what a block names lies beside it, in the top folder
        (tmp_path / folder).symlink_to(ROOT / folder)
    path = tmp_path / "block.toml"
    path.write_text(block.text, encoding="utf-8")
    if block.skipped is None:
        kind, read = reader_of(read_toml(path, "block"))
        assert read(path) is not None, kind


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == "python"], ids=lambda b: b.place)
def test_every_python_block_compiles(block: Block) -> None:
    if block.skipped is None:
        compile(block.text, block.place, "exec")


FLIGHTS = [words for _, words in COMMANDS if words[0] == "run" and not {"--resume", "--help", "--out"} & set(words)]


@pytest.mark.parametrize(
    "words",
    [w for w in FLIGHTS if not any(word.endswith((".toml", ".csv", ".fmu", ".ssp")) for word in w)],
    ids=" ".join,
)
def test_flights_of_the_pages_begin(words: list[str], main: Main) -> None:
    flags = [] if "--stop-time" in words else ["--stop-time", "0.02"]
    main(*(words if flags else words[: words.index("--stop-time")]), "--native", "-q", "--stop-time", "0.02")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("    false\n", "ended with 1"),
        ("    echo one\n\n```text output\ntwo\n```\n", "expected the output before it to have two"),
        ("```c\nint x;\n```\n", "expected a name for the file"),
    ],
)
def test_a_newcomer_ends_where_a_page_is_wrong(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(BlockFailed, match=said):
        follow_page(text, tmp_path)


def test_a_newcomer_writes_files_stays_where_it_went_and_looks_at_what_was_printed(tmp_path: Path) -> None:
    text = (
        "```csv a.csv\n1,2\n```\n\n    mkdir deep && cp a.csv deep && cd deep\n    cat a.csv\n\n"
        "```text output\n1,…\n```\n"
    )
    newcomer = follow_page(text, tmp_path)
    assert newcomer.done == 3


def test_what_is_not_run_is_counted_with_its_reason_and_another_line_run_instead(tmp_path: Path) -> None:
    text = (
        "<!-- not run: needs a board -->\n\n```c\nint x;\n```\n\n"
        "<!-- instead of `false`: `touch done`: takes hours -->\n<!-- not run: `exit`: ends it -->\n\n"
        "    false # now\n    exit 3\n"
    )
    newcomer = follow_page(text, tmp_path)
    assert [one.reason for one in newcomer.skipped] == ["needs a board", "takes hours", "ends it"]
    assert (tmp_path / "done").is_file()


@pytest.mark.parametrize(
    "text",
    [
        "<!-- not run: `ls`: why -->\n\n    cat x\n",
        "<!-- not run -->\n\n    cat x\n",
        "<!-- not run: why -->\n\nText.\n",
    ],
)
def test_a_comment_that_fits_no_block_is_refused(text: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=re.escape("page.md:")):
        page(tmp_path, text)
