"""What a command answers: one document for programs, and the same in lines to read."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from orchestration.basics.documents import plain


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Goes to standard output: with `--json` the document, else the lines."""

    document: object
    """of numbers, texts, truth values, lists, mappings, paths and dataclasses of them"""
    lines: Sequence[str]
    good: bool = True
    """else the command ends with exit code 1"""

    @property
    def as_json(self) -> str:
        """The document as JSON; numbers that JSON does not have, as infinity, are null."""
        return json.dumps(plain(self.document), indent=2)


def of_files(paths: Iterable[PurePath]) -> Answer:
    """The files that were written, one a line."""
    written = list(paths)
    return Answer(document={"files": written}, lines=[str(path) for path in written])
