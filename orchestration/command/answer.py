"""What a command answers: one document for programs, and the same in lines to read."""

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any


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
        return json.dumps(_plain(self.document), indent=2)


def of_files(paths: Iterable[PurePath]) -> Answer:
    """The files that were written, one a line."""
    written = list(paths)
    return Answer(document={"files": written}, lines=[str(path) for path in written])


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain({field.name: getattr(value, field.name) for field in dataclasses.fields(value)})
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
