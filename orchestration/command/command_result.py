"""The result of a command: a document for programs, and lines of text for readers."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath

from orchestration.foundation.basics.documents import plain


@dataclass(frozen=True, kw_only=True)
class CommandResult:
    """Printed to standard output: with `--json` the document, else the lines."""

    document: object
    """of numbers, texts, booleans, lists, mappings, paths and dataclasses of them"""
    lines: Sequence[str]
    good: bool = True
    """false: exit code 1"""

    @property
    def as_json(self) -> str:
        """The document as JSON; numbers that JSON lacks, such as infinity, are null."""
        return json.dumps(plain(self.document), indent=2)


def result_of_files(paths: Iterable[PurePath]) -> CommandResult:
    """The paths of files that were written, one per line."""
    written = list(paths)
    return CommandResult(document={"files": written}, lines=[str(path) for path in written])
