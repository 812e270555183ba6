"""Failures that a user sees as one line."""

import difflib
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

LONGEST = 4000
"""Characters of a message; what a message names may come from a file and be of any length."""


class QuadcosimError(Exception):
    """Something went wrong; the text says what, and what was expected (exit code 1)."""

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))

    def __str__(self) -> str:
        return _said(super().__str__())


class UsageError(QuadcosimError):
    """The request cannot be carried out as it is written (exit code 2)."""


class SimulatorError(QuadcosimError):
    """An FMU refused a call; `divergence` if it says that the closed loop has diverged."""

    def __init__(self, text: str, *, divergence: bool = False, details: str = "") -> None:
        super().__init__(text)
        self.divergence = divergence
        self.details = details
        """The FMU's own traceback, for `--debug`."""


class StoppedStepError(SimulatorError):
    """An FMU has not simply done a step: it ends the run (`ends`), or has discarded the step.

    `whole` if it has come to the end of the step nevertheless.
    """

    def __init__(self, text: str, *, ends: bool = False, whole: bool = False, details: str = "") -> None:
        super().__init__(text, details=details)
        self.ends = ends
        self.whole = whole


class RefusedValueError(SimulatorError, UsageError):
    """An FMU refused a value that the request sets; the text is the FMU's own, after the side it is on."""


def no_utf8(error: UnicodeEncodeError) -> UsageError:
    """The error for the name of a file or folder that no text in UTF-8 can have in it."""
    return UsageError(f"{error.object}: expected names of files and folders in UTF-8")


def one_line(text: str) -> str:
    """`text` in one line of printable characters, cut where it is longer than a message may be."""
    if not text.isprintable():
        text = "".join(
            c if c.isprintable() else c.encode("unicode_escape").decode() for c in " ".join(text.split("\n"))
        )
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"


def expected_name(name: str, known: Sequence[str]) -> str:
    """The end of a message about a name that is none: the closest of those that are, and all of them."""
    close = _closest(name, known)
    hint = "" if close is None else f"did you mean {close}? "
    return f"{hint}expected one of {', '.join(known)}"


def no_such_key(table: str, key: str, known: Sequence[str], beside: str = "") -> str:
    """What is said of a key that nobody reads; `table` is what it stands in, with its dot, `beside` ends the list."""
    return f"{table}{key}: no such key; expected one of {', '.join(known)}{beside}{did_you_mean(key, known)}"


def did_you_mean(name: str, known: Sequence[str]) -> str:
    """The end of a message that lists what there is: which of it is closest to a name that is none, if any is close."""
    close = _closest(name, known)
    return "" if close is None else f"; did you mean {close}?"


def _closest(name: str, known: Sequence[str]) -> str | None:
    return next(iter(difflib.get_close_matches(name, known, n=1)), None)


def shown(value: object) -> str:
    """A value as a message gives it: a float to twelve digits, 0.3 for 0.30000000000000004; anything long cut."""
    text = repr(float(f"{value:.12g}")) if isinstance(value, float) else str(value)
    return text if len(text) <= 100 else f"{text[:99]}…"


Words = Callable[[str], str]
_said: Words = str
"""In whose words errors are told; they are written in those of the command line"""


@contextmanager
def at_place(place: str) -> Iterator[None]:
    """What is wrong inside is told of a part of `place`."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{place}.{error}") from error


@contextmanager
def told_in(words: Words) -> Iterator[None]:
    """Errors are told in these words while the block runs."""
    before = _said
    tell_in(words)
    try:
        yield
    finally:
        tell_in(before)


def tell_in(words: Words) -> None:
    """From here on errors are told in these words: `str` for those of the command line, or `in_python`."""
    global _said
    _said = words


_ARGUMENTS = {"from": "first", "to": "last", "out": "folder"}
"""What Python calls a flag where that is not its name"""
_COMMAND_OR_FLAG = re.compile(r"quadcosim \S+(?: --[a-z-]+)+|(?<![\w-])--([a-z][a-z-]*)")
_GIVEN = re.compile(r"--([a-z-]+) ([^\s,]*)(?: (?=--)|$)")


def in_python(text: str) -> str:
    """A message with arguments in place of flags: `first = 1, last = 0: expected …` for `--from 1 --to 0: …`.

    A whole command that it names is left as it is.
    """
    head, colon, rest = text.partition(": ")
    given = _GIVEN.findall(head)
    if given and _GIVEN.sub("", head) == "":
        head = ", ".join(f"{_argument(flag)} = {value}" for flag, value in given)
    return _COMMAND_OR_FLAG.sub(lambda found: _argument(found[1]) if found[1] else found[0], f"{head}{colon}{rest}")


def _argument(flag: str) -> str:
    return _ARGUMENTS.get(flag, flag.replace("-", "_"))
