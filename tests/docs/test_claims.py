"""Claims are records: their numbers are in the data, their commands exist, and the pages say what they say."""

import json
from pathlib import Path

import pytest

from docs import claim_records as records
from orchestration.foundation.basics.errors import UsageError
from quadcosim import Scenario, fly

CLAIMS = records.load_claims()
BY_HAND = {"crazyflie_firmware"}
"""Data from the tables of two studies, which need the sources of a firmware"""


def test_pages_say_what_the_records_say() -> None:
    for page, texts in records.blocks().items():
        content = (records.ROOT / page).read_text(encoding="utf-8")
        for name, text in texts.items():
            assert f"<!-- {name} -->\n\n{text}\n\n<!-- end -->" in content, (
                f"{page}, {name}: expected what its record says, as `python -m docs.claim_records` writes it"
            )


def test_every_marked_place_has_its_record() -> None:
    pages = records.blocks()
    for page in (records.ROOT / "README.md", *(records.ROOT / "docs").rglob("*.md")):
        marked = records.MARKED.findall(page.read_text(encoding="utf-8"))
        recorded = {*pages.get(str(page.relative_to(records.ROOT)), {})}
        assert {*marked} == recorded, (
            f"{', '.join({*marked} ^ recorded)}: expected the comments `claim NAME` and `end` in {page}, and it in "
            f"`where` of docs/claims/NAME.toml"
        )


@pytest.mark.parametrize("name", CLAIMS)
def test_every_command_names_a_study_or_a_section_that_exists(name: str) -> None:
    from docs import make_findings  # not before: each process that collects would load it

    for place in records.files_of(CLAIMS[name]):
        if place.startswith("section "):
            known = place.removeprefix("section ") in make_findings.SECTIONS
        else:
            known = (records.ROOT / place).is_file()
        assert known, f"docs/claims/{name}.toml: its commands name {place}, which does not exist"


@pytest.mark.parametrize("name", CLAIMS)
def test_the_commands_of_a_record_write_the_data_of_its_numbers(name: str) -> None:
    written = {Path(place.removeprefix("section ")).stem for place in records.files_of(CLAIMS[name])} | BY_HAND
    read = {Path(reference.partition("#")[0]).stem for reference in CLAIMS[name].numbers.values()}
    assert read <= written, (
        f"docs/claims/{name}.toml: its numbers are in docs/data/{', '.join(sorted(read - written))}.json: expected a "
        f"command that names the study, the comparison or the section of docs.make_findings which writes it"
    )


@pytest.mark.parametrize("name", CLAIMS)
def test_every_number_of_a_record_is_said(name: str) -> None:
    claim = CLAIMS[name]
    text = " ".join([claim.claim, *(one.number for one in claim.tried)])
    unsaid = [number for number in claim.numbers if f"{{{number}:" not in text]
    assert not unsaid, f"docs/claims/{name}.toml: no sentence has {{{', '.join(unsaid)}:…}}, which [numbers] declares"


STEPS = records.steps()


def values_of(at: str, prefix: str = "") -> dict[str, float]:
    """The values of an address of the page; those of the second law have a prefix."""
    pairs = [pair.partition("=")[::2] for pair in at.split("&") if "=" in pair]
    own = {path: float(value) for path, value in pairs if not path.startswith("second.")}
    return own | {
        path.removeprefix(prefix): float(value) for path, value in pairs if prefix and path.startswith(prefix)
    }


def test_what_is_shown_is_what_is_flown() -> None:
    shown = [(values_of(one.at), one.verdict) for one in STEPS]
    shown += [(values_of(one.at, "second."), one.second) for one in STEPS if one.second]
    usual = {"timing.period": 0.01, "controller.coupling": 1.0}
    paths = dict.fromkeys(path for values, _ in shown for path in values)
    flights = fly(Scenario(), {path: [values.get(path, usual.get(path, 0.0)) for values, _ in shown] for path in paths})
    for (_, verdict), good, diverged, settling, end in zip(
        shown, *(flights[name] for name in ("good", "diverged", "settling_time", "divergence_time"))
    ):
        survives = f"settles in {settling:.2f} s" if good else "survives, does not settle"
        assert verdict == (f"diverges at {end:.2f} s" if diverged else survives)
    assert [one.step for one in STEPS] == [*range(1, len(STEPS) + 1)]


def record(folder: Path, **changes: object) -> Path:
    """A record as a file, with changes."""
    numbers = {"n": "periods.json#/cells/3/settles"}
    of = {"vehicle": "one", "starts": "many", "horizon": "60 s", "constant": "all"}
    tables = {"claim": "{n:g} of 200 settle.", "numbers": numbers, "command": "quadcosim sweep studies/period.toml",
              "where": ["README.md"], "conditions": of, "not_tried": "all else", **changes}  # fmt: skip
    path = folder / "one.toml"
    path.write_text("\n".join(f"{key} = {inline(value)}" for key, value in tables.items()), encoding="utf-8")
    return path


def inline(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline(one)}" for key, one in value.items()) + "}"
    return f"[{', '.join(map(inline, value))}]" if isinstance(value, list) else json.dumps(value)


def test_a_claim_with_fewer_than_two_refuters_is_marked(tmp_path: Path) -> None:
    tried = {"against": "x", "command": "python -m docs.make_findings period", "number": "{n:g}", "verdict": "holds"}
    texts = [records.sentence(records.load_claim(record(tmp_path, tried=[tried] * count))) for count in (0, 1, 2)]
    assert [records.ONE_ONLY in text for text in texts] == [True, True, False]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"numbers": {"n": "periods.json#/cells/3000/settles"}}, "leads to nothing"),
        ({"numbers": {"n": "periods.json#/cells/3/controller"}}, "expected a number"),
        ({"numbers": {"n": "no.json#/cells"}}, "leads to nothing"),
        ({"claim": "{m:g} of 200 settle."}, "'m' is no number of the record"),
        ({"proof": "none"}, "proof"),
        ({"where": []}, "expected the page that tells it"),
    ],
)
def test_what_a_record_may_not_say_is_refused(tmp_path: Path, changes: dict[str, object], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        records.load_claim(record(tmp_path, **changes))
