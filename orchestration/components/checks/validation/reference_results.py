"""Results that an FMU carries of itself, by the layered standard fmi-ls-ref: a run of it has to give them again."""

import csv
import itertools
import math
import posixpath
from collections.abc import Iterator, Sequence
from xml.etree.ElementTree import ParseError, fromstring

from orchestration.components.checks.validation.finding import Note
from orchestration.components.checks.validation.instance import Row, Value
from orchestration.components.checks.validation.probe import Probe
from orchestration.components.checks.validation.run_comparison import TOLERANCE
from orchestration.components.fmi.read_description import Variable

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST = f"{FOLDER}/fmi-ls-manifest.xml"


def carried_results(probe: Probe) -> Iterator[str]:
    """Results that it carries by fmi-ls-ref are those of a run of it with start values, through their times."""
    files = probe.fmu.archive.files
    for source in _sources(files.get(MANIFEST, b"<fmiReferences/>")):
        place = posixpath.normpath(posixpath.join(FOLDER, source))
        if place not in files:
            yield Note(f"{source}: {MANIFEST} names these results, but they are not there")
        elif not probe.first.is_complete:
            yield Note(f"{source}: not compared, as the FMU is slow")
        else:
            yield from _compared(probe, source, files[place].decode("utf-8", "replace"))


def _sources(manifest: bytes) -> Iterator[str]:
    """The tables among the files that a manifest lists as results."""
    try:
        related = fromstring(manifest).findall("Related")
    except ParseError:
        return
    for each in related:
        if each.get("role") == "result" and each.get("type") == "text/csv":
            yield each.get("source", "")


def _compared(probe: Probe, source: str, text: str) -> Iterator[str]:
    """What a run differs by from a table, the first column of which is the time."""
    table = [row for row in csv.reader(text.splitlines()) if row]
    wholes: dict[str, list[Variable]] = {}
    for v in probe.elements:
        wholes.setdefault(v.whole, []).append(v)
    unknown = [name for name in table[0][1:] if name not in wholes] if table else []
    if unknown:
        yield f"{source}: it has {', '.join(unknown)}; expected variables of the FMU"
        return
    columns = [wholes[name] for name in table[0][1:]] if table else []
    try:
        times, expected = _read(table[1:], columns)
    except ValueError as error:
        yield f"{source}: {error}"
        return
    found = _run(probe, times, [v for elements in columns for v in elements])
    yield from _differences(source, found, expected)


def _read(rows: Sequence[Sequence[str]], columns: Sequence[Sequence[Variable]]) -> tuple[list[float], list[Row]]:
    """The times [s], and a row for each; of rows of one time the last. Raises `ValueError` for an invalid table."""
    found: dict[float, Row] = {}
    before = -math.inf
    for number, (time, *cells) in enumerate(rows, 2):
        row: Row = {}
        for elements, cell in zip(columns, cells):
            parts = cell.split() if elements[0].length else [cell]
            if len(parts) != len(elements):
                raise ValueError(f"row {number}: {cell}: expected {len(elements)} values of {elements[0].whole}")
            row |= {v.name: _value(v, part) for v, part in zip(elements, parts)}
        if len(cells) != len(columns) or not before <= float(time) < math.inf:
            raise ValueError(f"row {number}: expected a time after that before, and {len(columns)} cells")
        before = float(time)
        found[before] = row
    if not found:
        raise ValueError("it has no rows")
    return list(found), list(found.values())


def _value(v: Variable, text: str) -> Value:
    if v.kind == "String":
        return text
    if v.kind == "Binary":
        return bytes.fromhex(text)
    number = float({"true": 1, "false": 0}.get(text.strip().lower(), text))
    return number if v.kind == "Real" else number != 0.0 if v.kind == "Boolean" else round(number)


def _run(probe: Probe, times: Sequence[float], variables: Sequence[Variable]) -> list[Row]:
    """The values at these times, or up to that at which the FMU ends the run."""
    with probe.instance() as instance:
        instance.start({}, times[0])
        rows, goes_on = [instance.row(variables)], True
        for t, end in itertools.pairwise(times):
            if not goes_on:
                break
            goes_on = instance.advance(t, end - t)
            rows.append(instance.row(variables))
        return rows


def _differences(source: str, found: Sequence[Row], expected: Sequence[Row]) -> Iterator[str]:
    if len(found) < len(expected):
        yield f"{source}: it has {len(expected)} rows, but the FMU ends the run after {len(found)}"
        return
    largest = 0.0
    for name in found[0]:
        pairs = [(row[name], known[name]) for row, known in zip(found, expected)]
        size = max((abs(b) for _, b in pairs if isinstance(b, float)), default=0.0)
        for k, (a, b) in enumerate(pairs):
            apart = abs(a - b) if isinstance(a, float) and isinstance(b, float) else 0.0 if a == b else math.inf
            if not apart <= TOLERANCE * size:
                yield f"{source}: {name} = {b!r} in its row {k + 1} of {len(expected)}, but the FMU has {a!r}"
                return
            largest = max(largest, apart)
    yield Note(f"{source}: {len(expected)} rows, the largest difference is {largest!r}")


RULES = (carried_results,)
"""Rules for FMUs that carry results"""
