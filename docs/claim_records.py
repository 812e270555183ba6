"""Claims as records: `docs/claims/NAME.toml`, their numbers from `docs/data`, and the sentences of the pages from them.

`python -m docs.claim_records` writes every sentence into its pages, as `make findings` does; a page is up to date if
that changes nothing.
"""

import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from functools import cache
from pathlib import Path
from typing import Any, Literal

from docs.pages import fill
from orchestration.foundation.basics.documents import read_toml
from orchestration.foundation.basics.errors import UsageError
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.typed_tables import parsed

ROOT = Path(__file__).parent.parent
CLAIMS = Path(__file__).parent / "claims"
DATA = Path(__file__).parent / "data"
SUMMARY = "docs/findings.md"
"""The page that lists the sentences of all claims"""
STEPS, LIVE = "docs/drag_the_clock.md", "paper_flight.html"
"""The page of what is shown, and the page in which it runs, beside it"""
ENOUGH = 2
"""Refuters that must have been flown, else a claim is marked"""
ONE_ONLY = "one comparison only"
COMPARED = "quadcosim compare studies/comparisons/"
"""Words that attempts do not repeat"""
MARKED = re.compile(r"<!-- (claims? .+?) -->")
"""Places of pages that are written from the records"""
FILES = {
    r"quadcosim \w+ (studies/\S+\.toml)": "{0}",
    r"python -m docs\.comparisons (\w+)": "studies/comparisons/{0}.toml",
}
"""Commands that name a file, and where it is"""


@record()
class Conditions:
    """Under which a claim was found."""

    vehicle: str
    starts: str
    horizon: str
    constant: str
    """Settings that were held constant."""


@record()
class Tried:
    """An attempt to refute a claim: another opponent, tuning, ratio, or an error of a nominal value."""

    against: str
    command: str
    """The command that flies it."""
    number: str
    """Its result, with numbers by name."""
    verdict: Literal["holds", "limited", "refuted"]
    """Verdict on the claim, after it."""


@record()
class Shown:
    """A run that shows a claim in the page of the paper's flight."""

    step: int
    """Its place among all that are shown, from 1."""
    says: str
    at: str
    """Values that the address of the page has."""
    verdict: str
    """Words of the page on the run."""
    second: str = ""
    """Words on a second law, if there is one."""


@record()
class Claim:
    """A claim in one sentence, with what was tried against it."""

    claim: str
    """The sentence: numbers that were found by name, those of its conditions in digits. No test tells them apart."""
    numbers: Mapping[str, str]
    """Numbers by name: a file of docs/data and a pointer into it (RFC 6901)."""
    command: str
    """The command that finds its numbers."""
    where: Sequence[str]
    """The pages with the sentence; the first tells what was tried too."""
    conditions: Conditions
    not_tried: str
    tried: Sequence[Tried] = field(default_factory=tuple)
    shown: Sequence[Shown] = field(default_factory=tuple)


class Number(float):
    """A number of the data: a format of `ms`, `mm` or `%` is in that unit, without its name."""

    def __format__(self, spec: str) -> str:
        digits, unit = re.fullmatch(r"(.*?)(ms|mm|%|)", spec).groups()  # type: ignore[union-attr]
        factor = {"ms": 1e3, "mm": 1e3, "%": 1e2, "": 1.0}[unit]
        return format(factor * float(self), digits or ".4g")


@cache
def _data(name: str) -> Any:
    return json.loads((DATA / name).read_text(encoding="utf-8"))


def number_at(reference: str) -> Number:
    """The number of `FILE#POINTER`; raises `UsageError` if there is none."""
    name, _, pointer = reference.partition("#")
    try:
        value = _data(name)
        for part in pointer.removeprefix("/").split("/"):
            key = part.replace("~1", "/").replace("~0", "~")
            value = value[int(key)] if isinstance(value, list) else value[key]
    except (OSError, LookupError, ValueError, TypeError):
        raise UsageError(f"{reference}: leads to nothing in docs/data") from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise UsageError(f"{reference}: expected a number, found {str(value)[:40]}")
    return Number(value)


def load_claim(path: Path) -> Claim:
    """Read a record; raises `UsageError` for an unknown key and a number that is not in the data."""
    try:
        claim = parsed(read_toml(path, "record of a claim"), Claim)
        if not claim.where:
            raise UsageError("where = []: expected the page that tells it, and others with its sentence")
        _filled(claim, claim.claim)
        for one in claim.tried:
            _filled(claim, one.number)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from None
    return claim


@cache
def load_claims() -> dict[str, Claim]:
    """All records by name."""
    return {path.stem: load_claim(path) for path in sorted(CLAIMS.glob("*.toml"))}


def _filled(claim: Claim, text: str) -> str:
    known = {name: number_at(reference) for name, reference in claim.numbers.items()}
    try:
        return text.format_map(known)
    except (KeyError, ValueError) as error:
        raise UsageError(f"{text}: {error} is no number of the record") from None


def sentence(claim: Claim) -> str:
    """The sentence with its numbers, and a mark if little was tried against it."""
    return _filled(claim, claim.claim) + ("" if len(claim.tried) >= ENOUGH else f" ({ONE_ONLY})")


def told(claim: Claim) -> str:
    """The sentence, the conditions, and what was and was not tried against it."""
    of = claim.conditions
    lines = [
        wrapped(f"**{sentence(claim)}**"),
        "",
        wrapped(f"`{claim.command}` ({of.vehicle}; {of.starts}; {of.horizon}; held: {of.constant}). Tried against it:"),
        "",
    ]
    for one in claim.tried:
        how = "" if one.command == claim.command else f" (`{one.command.removeprefix(COMPARED)}`)"
        lines.append(wrapped(f"- {one.against}: {_filled(claim, one.number)}{how}: *{one.verdict}*", "  "))
    return "\n".join([*lines, "", wrapped(f"*Not tried:* {claim.not_tried}.")])


def steps() -> list[Shown]:
    """What all claims show, in their order."""
    return sorted((one for claim in load_claims().values() for one in claim.shown), key=lambda one: one.step)


def told_in_steps() -> str:
    """The steps, each with its verdict and the claim that it shows."""
    homes = {one.step: claim for claim in load_claims().values() for one in claim.shown}
    texts = []
    for one in steps():
        home, at = Path(homes[one.step].where[0]).relative_to("docs"), f"#{one.at}" if one.at else ""
        second = f"; the second law: **{one.second}**" if one.second else ""
        texts += [
            wrapped(f"{one.step}. {one.says} [Open it]({LIVE}{at}): **{one.verdict}**{second}.", "   "), "",
        ]  # fmt: skip
        if homes.get(one.step + 1) is not homes[one.step]:
            texts += [textwrap.indent(wrapped(f"[The claim]({home}): {sentence(homes[one.step])}"), "   "), ""]
    return "\n".join(texts[:-1])


def wrapped(text: str, indent: str = "") -> str:
    """The text in lines as long as those of the pages."""
    return textwrap.fill(text, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def files_of(claim: Claim) -> Iterator[str]:
    """The files that its commands name, and the sections of `make findings`."""
    for command in (claim.command, *(one.command for one in claim.tried)):
        found = [place.format(name) for text, place in FILES.items() for name in re.findall(text, command)]
        found += [f"section {name}" for name in re.findall(r"python -m docs\.make_findings (\w+)", command)]
        if not found:
            raise UsageError(f"{command}: expected a study, a comparison or a section of docs.make_findings")
        yield from found


def blocks() -> dict[str, dict[str, str]]:
    """By page: the texts between its markers, by their names."""
    pages: dict[str, dict[str, str]] = {}
    listed: dict[str, list[str]] = {}
    for name, claim in load_claims().items():
        home, *others = claim.where
        pages.setdefault(home, {})[f"claim {name}"] = told(claim)
        for page in others:
            pages.setdefault(page, {})[f"claim {name}"] = wrapped(sentence(claim))
        listed.setdefault(home, []).append(wrapped(f"- {sentence(claim)}", "  "))
    pages[STEPS] = {"claims shown": told_in_steps()}
    pages[SUMMARY] = {f"claims of {Path(home).stem}": "\n".join(lines) for home, lines in listed.items()}
    return pages


def write() -> list[str]:
    """Write the sentences into all pages; the pages."""
    found = blocks()
    for page, texts in found.items():
        fill(ROOT / page, texts)
    return [*found]


if __name__ == "__main__":
    print(*write(), sep="\n")
