"""The code blocks of a page, and the comments before them about running them.

A comment stands before its block, and is visible in the source of the page:

    <!-- not run: needs MATLAB -->                                            the whole block
    <!-- not run: `make test`: takes ten minutes -->                          the lines that begin so
    <!-- instead of `quadcosim sweep`: `quadcosim status`: takes an hour -->  another line in their place
"""

import re
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

SHELL = ("", "sh", "bash")
"""Languages of lines for a shell, an indented block included"""
SHOWN, OUTPUT = "text", "output"
"""Language of drawings and formulas; with the name OUTPUT, of the output of the lines before it"""


@dataclass(frozen=True, kw_only=True)
class Note:
    """A line or block that is not run as written, and the reason."""

    command: str | None
    """prefix of the lines; None: the whole block"""
    instead: str | None
    """the line that is run instead"""
    reason: str


@dataclass(frozen=True, kw_only=True)
class Block:
    """A code block; `name` is the file of which it is the text, or empty."""

    page: Path
    line: int
    language: str
    name: str
    text: str
    notes: tuple[Note, ...]

    @property
    def place(self) -> str:
        """Page and line where it begins."""
        return f"{self.page}:{self.line}"

    @property
    def is_shell(self) -> bool:
        """Whether its lines are for a shell."""
        return self.language in SHELL

    @property
    def is_shown(self) -> bool:
        """Whether it is only shown to the reader."""
        return self.language == SHOWN and self.name != OUTPUT

    @property
    def skipped(self) -> str | None:
        """The reason why none of it is run; None if some of it is."""
        return next((note.reason for note in self.notes if note.command is None), None)

    @property
    def lines(self) -> list[str]:
        """The lines for a shell, with continued lines joined."""
        return [line for line in self.text.replace("\\\n", "").splitlines() if line.split("#")[0].strip()]

    def note_on(self, line: str) -> Note | None:
        """The note on a line, if any."""
        return next((n for n in self.notes if n.command is not None and line.startswith(n.command)), None)


def blocks_of(page: Path, root: Path) -> list[Block]:
    """The code blocks of a page in order; raises `ValueError` for a comment that matches no line."""
    found, notes = [], []
    parser = MarkdownIt("commonmark").enable("table").disable("inline")  # what is in lines is not looked at
    for token in parser.parse((root / page).read_text(encoding="utf-8")):
        line = 1 + (token.map or [0])[0]
        if token.type == "html_block":
            notes += _notes(token.content, f"{page}:{line}")
        elif token.type in ("fence", "code_block"):
            language, _, name = token.info.strip().partition(" ")
            block = Block(page=page, line=line, language=language, name=name, text=token.content, notes=tuple(notes))
            _expect_fitting(block)
            found.append(block)
            notes = []
        elif token.type == "inline" and notes:
            raise ValueError(f"{page}:{line}: expected a code block after the comment about one")
    return found


def _notes(comments: str, place: str) -> list[Note]:
    return [
        _note(" ".join(text.split()), place)
        for text in re.findall(r"<!-- ((?:not run|instead of)\b.*?) -->", comments, re.S)
    ]


def _note(text: str, place: str) -> Note:
    whole = re.fullmatch(r"not run: ([^`].*)", text)
    part = re.fullmatch(r"not run: `([^`]+)`: (.+)", text)
    other = re.fullmatch(r"instead of `([^`]+)`: `([^`]+)`: (.+)", text)
    if whole is not None:
        return Note(command=None, instead=None, reason=whole[1])
    if part is not None:
        return Note(command=part[1], instead=None, reason=part[2])
    if other is not None:
        return Note(command=other[1], instead=other[2], reason=other[3])
    raise ValueError(f"{place}: {text}: expected one of the forms that docs/newcomer/blocks.py shows")


def _expect_fitting(block: Block) -> None:
    for note in block.notes:
        if note.command is not None and not any(line.startswith(note.command) for line in block.lines):
            raise ValueError(f"{block.place}: no line begins with {note.command}, as the comment before it states")
