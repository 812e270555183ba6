"""Errors that a user sees as one line."""

import difflib
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from orchestration.foundation.processes.passable import passable

MAX_MESSAGE_LENGTH = 4000
"""Largest number of characters in a message: names in it may come from a file and have any length"""
WHOLE_NUMBER = "a whole number from -2^63 to 2^63 - 1, or a float, as 1e19"
"""The words for what may be in place of a longer whole number"""
BEGINNING = 3
"""Least length of a beginning for which a name is taken"""
A_FLOAT = "a whole number that a float holds: all are up to 2**53"
"""The words for what of an integer of 64 bits a run can have"""

Value = TypeVar("Value")


@passable
class QuadcosimError(Exception):
    """A failure; the text states what went wrong and what was expected (exit code 1)."""

    def __init_subclass__(cls) -> None:
        passable(cls)

    def __init__(self, text: str) -> None:
        super().__init__(one_line(text))

    def __str__(self) -> str:
        return _wording(str(self.args[0]))


class UsageError(QuadcosimError):
    """The request is invalid as written (exit code 2)."""


class SimulatorError(QuadcosimError):
    """An FMU refused a call; `divergence` if it reports that the closed loop has diverged."""

    def __init__(self, text: str, *, divergence: bool = False, details: str = "") -> None:
        super().__init__(text)
        self.divergence = divergence
        self.details = details
        """The FMU's own traceback, for `--debug`."""
        self.result: Any = None
        """The `Result` so far of the run that it ended; None if nothing was recorded."""

    def timed(self, t: float) -> None:
        """Add the time [s] of the run at which it was raised."""
        self.args = (f"{self.args[0]}, at t = {t:g} s",)


class StoppedStepError(SimulatorError):
    """An FMU did not complete a step normally: it ends the run (`ends`), or has discarded the step.

    `whole` if it has reached the end of the step nevertheless.
    """

    def __init__(self, text: str, *, ends: bool = False, whole: bool = False, details: str = "") -> None:
        super().__init__(text, details=details)
        self.ends = ends
        self.whole = whole


class RefusedValueError(SimulatorError, UsageError):
    """An FMU refused a value that the request sets; the text is the FMU's own, prefixed by its instance name."""


def no_utf8(error: UnicodeEncodeError) -> UsageError:
    """The error for the name of a file or folder that cannot be encoded in UTF-8."""
    return UsageError(f"{error.object}: expected names of files and folders in UTF-8")


def one_line(text: str) -> str:
    """`text` in one line of printable characters, its middle cut to `MAX_MESSAGE_LENGTH`."""
    if not text.isprintable():
        text = "".join(
            c if c.isprintable() else c.encode("unicode_escape").decode() for c in " ".join(text.split("\n"))
        )
    half = MAX_MESSAGE_LENGTH // 2
    return text if len(text) <= MAX_MESSAGE_LENGTH else f"{text[: half - 1]}…{text[-half:]}"


def expected_name(name: str, known: Sequence[str]) -> str:
    """The end of a message about an unknown name: the closest of the known names, and all of them."""
    return f"{did_you_mean(name, known)} expected one of {', '.join(known)}".lstrip("; ")


def expect_one_of(argument: str, name: str, known: Sequence[str]) -> None:
    """Raise `UsageError` for a value of an argument that is none of the known names."""
    if name not in known:
        raise UsageError(f"{argument} = {name!r}: {expected_name(str(name), known)}")


def listed(names: Iterable[str], most: int = 12) -> str:
    """Names for a message: the first `most` of them, and how many more there are."""
    known = list(names)
    first = ", ".join(known[:most]) or "(none)"
    return first if len(known) <= most else f"{first} and {len(known) - most} more"


def no_such_key(table: str, key: str, known: Sequence[str], beside: str = "") -> str:
    """The message about an unknown key; `table` is the path of its table with the dot, `beside` ends the list."""
    return f"{table}{key}: no such key; expected one of {', '.join(known)}{beside}{did_you_mean(key, known)}"


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """The end of a message about an unknown `name`: the `most` known names that are closest to it, if any is close.

    Capitals count as small letters: who writes `position.X` means `position.x`. Those that `name` begins come first.
    """
    in_small, small = {each.casefold(): each for each in known}, name.casefold()
    begun = sorted((each for each in in_small if len(small) >= BEGINNING and each.startswith(small)), key=len)
    close = [*dict.fromkeys([*begun, *difflib.get_close_matches(small, list(in_small), n=most)])][:most]
    return f"; did you mean {' or '.join(in_small[each] for each in close)}?" if close else ""


class UnknownNameError(UsageError, KeyError):
    """A mapping of results has no such name."""


class Named(dict[str, Value]):
    """Values by name, with the names that there are in the error for an unknown one."""

    def __missing__(self, name: str) -> Value:
        near = did_you_mean(name, [*self], most=3)
        raise UnknownNameError(f"there is no {name}{near or '; expected one of ' + listed(self)}")


def shown(value: object) -> str:
    """A value as text for a message: a float to twelve digits, 0.3 for 0.30000000000000004; long text is cut."""
    text = repr(float(f"{value:.12g}")) if isinstance(value, float) else str(value)
    return text if len(text) <= 100 else f"{text[:99]}…"


_WITH_UNIT = re.compile(r"'?[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*(?P<unit>[^\W\d][^']*)'?")
_OF_TIME = re.compile(r"[munµμ]?s|m?secs?|(milli|micro|nano)?seconds?|min|minutes?|h|hours?|[kM]?Hz")


def without_unit(expected: str, value: object) -> str:
    """What is `expected` in place of a value: of a number with a unit without it, and of a time in which one."""
    found = _WITH_UNIT.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        return expected
    text, count = re.subn(r"\bnumber\b", "number without its unit", expected, count=1)
    return text + "; times are in seconds" if count and _OF_TIME.fullmatch(found["unit"]) else text


def told_apart(value: float, bound: float, digits: int = 6) -> tuple[str, str]:
    """A value and its bound as texts, with as many digits as it takes for the texts to compare as the numbers do."""
    for count in range(digits, 18):
        texts = f"{value:.{count}g}", f"{bound:.{max(count, 6)}g}"
        seen, limit = map(float, texts)
        if (seen < limit, seen > limit) == (value < bound, value > bound):
            break
    return texts


Wording = Callable[[str], str]
_wording: Wording = str
"""Translates the text of errors, which is written in terms of the command line"""


@contextmanager
def prefixed(prefix: str) -> Iterator[None]:
    """Prefix the `UsageError`s of a block, as with `PLACE.` or `FILE: `."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{prefix}{error}") from error


@contextmanager
def worded_by(wording: Wording) -> Iterator[None]:
    """Use this wording of errors while the block runs."""
    before = _wording
    set_wording(wording)
    try:
        yield
    finally:
        set_wording(before)


def set_wording(wording: Wording) -> None:
    """Set the wording of errors: `str` for that of the command line, or `in_python`."""
    global _wording
    _wording = wording


_ARGUMENTS = {"from": "first", "to": "last"}
"""Flags whose Python argument has another name"""
_COMMAND_OR_FLAG = re.compile(r"quadcosim \S+(?: --[a-z-]+)+|(?<![\w-])--([a-z][a-z-]*)")
_FLAG_VALUE = re.compile(r"--([a-z-]+) ([^\s,]*)(?: (?=--)|$)")


def in_python(text: str) -> str:
    """A message with arguments in place of flags: `first = 1, last = 0: expected …` for `--from 1 --to 0: …`.

    Whole commands in it are left as they are.
    """
    head, colon, rest = text.partition(": ")
    flags = _FLAG_VALUE.findall(head)
    if flags and _FLAG_VALUE.sub("", head) == "":
        head = ", ".join(f"{_argument(flag)} = {value}" for flag, value in flags)
    return _COMMAND_OR_FLAG.sub(lambda match: _argument(match[1]) if match[1] else match[0], f"{head}{colon}{rest}")


def _argument(flag: str) -> str:
    return _ARGUMENTS.get(flag, flag.replace("-", "_"))
