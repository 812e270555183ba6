"""Controllers that exist only as C: the file that describes one, and the FMU that is made of it.

name = "Pd"
period = 0.01                     # what the code believes
sources = ["pd.c"]
headers = ["pd.h"]
declare = "static pd_in in; static pd_out out;"
init = "pd_init();"
step = "pd_step(&in, &out);"      # any statements
[inputs]
position = { c = "in.x", unit = "m" }      # any lvalue
[outputs]
force = { c = "out.u", unit = "m/s2" }
[parameters]
k_p = "pd_kp"                     # start values are read from the code after init
"""

import hashlib
import json
import keyword
import logging
import re
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import Any

from fmu_kit.archive import read_wrapped
from fmu_kit.units import base_unit_exponents
from orchestration.components.building import consent
from orchestration.components.building.models import FMI3, WRAPPED
from orchestration.foundation.basics.documents import read_text, toml_of
from orchestration.foundation.basics.errors import QuadcosimError, UsageError, prefixed
from orchestration.foundation.basics.records import record
from orchestration.foundation.basics.times import common_step
from orchestration.foundation.processes import subprocesses

WHAT = "file of a controller in C"
_DEGREES = re.compile("deg|°")
NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
"""The name of a variable"""
REFUSED = 2
"""Exit code of the packer for code that cannot be wrapped as it is"""
MOST_WARNINGS = 10
"""The most of the compiler's warnings that are shown"""
_NOTES = logging.getLogger("quadcosim")


@record()
class WrappedVariable:
    """A variable of the FMU: any lvalue of the code."""

    c: str
    """The lvalue, as `in.x`, `rtU.speed`, `gains[2]`."""
    unit: str = "1"
    """Its unit in SI; "" for one that is not of SI, which nothing checks or converts."""
    description: str = ""
    """Description of the variable."""
    min: float | int | None = None
    """Least value, of a parameter."""
    max: float | int | None = None
    """Largest value, of a parameter."""


@record()
class WrappedTask:
    """A task of the code, with a period of its own."""

    name: str
    """Its name."""
    period: float | int
    """Its period [s], a whole multiple of the shortest common one."""
    step: str
    """Its statements."""


@record()
class WrapFile:
    """A controller in C: its sources, the statements that call it, and its variables."""

    name: str
    """Name of the FMU."""
    sources: tuple[str, ...]
    """C or C++ sources, objects and static libraries; paths start at the folder of the file."""
    period: float | int | None = None
    """Sampling period that the code believes [s]."""
    step: str | None = None
    """Statements that are a step."""
    tasks: tuple[WrappedTask, ...] = ()
    """Tasks of several periods, in place of `step`; for FMI 3.0 each is a partition."""
    init: str = ""
    """Statements that run once, before the parameters are set."""
    after_parameters: str = ""
    """Statements that run once, after the parameters are set, as for filters that are computed from them."""
    declare: str = ""
    """Declarations beside the headers, such as `static` variables for inputs and outputs."""
    include: tuple[str, ...] = ()
    """Folders in which headers are searched, before that of the file."""
    defines: tuple[str, ...] = ()
    """Definitions of the preprocessor, as `NDEBUG` or `RATE=100`."""
    headers: tuple[str, ...] = ()
    """Headers that the statements need."""
    sanitize: bool = False
    """Whether the code is checked while it runs: an index out of bounds and its like are crashes that name the line."""
    description: str = ""
    """Description of the FMU, in one line."""
    author: str = ""
    """Author of the code."""
    license: str = ""
    """Its licence; if given, the FMU contains the sources."""
    inputs: Mapping[str, str | WrappedVariable] = field(default_factory=dict)
    """Inputs by name."""
    outputs: Mapping[str, str | WrappedVariable] = field(default_factory=dict)
    """Outputs by name."""
    parameters: Mapping[str, str | WrappedVariable] = field(default_factory=dict)
    """Parameters by name, set before a run."""

    def __post_init__(self) -> None:
        """Raise `UsageError` for what does not fit together."""
        if not (self.name.isascii() and self.name.isidentifier() and not keyword.iskeyword(self.name)):
            raise UsageError(f"name = {self.name!r}: expected letters, digits and _, no digit first")
        if not self.sources:
            raise UsageError("sources = []: expected at least one source")
        if not self.outputs:
            raise UsageError("outputs: expected at least one")
        if (self.step is None) == (not self.tasks):
            raise UsageError("step: expected it, or [[tasks]] with name, period and step; not both")
        if self.period is None and not self.tasks:
            raise UsageError("period: expected the sampling period that the code believes [s]")
        if self.period is not None:
            _expect_period("period", self.period)
        if self.tasks and self.period is not None and self.period != self.shortest_period:
            raise UsageError(f"period = {self.period}: expected {self.shortest_period:g}, that of all tasks together")
        taken = dict.fromkeys((task.name for task in self.tasks), "tasks, which are clocks in FMI 3.0")
        for kind, name, variable in self.variables():
            if name in taken:
                raise UsageError(f"{kind}.{name}: expected another name than one of the {taken[name]}")
            taken[name] = kind
            if not NAME.fullmatch(name):
                raise UsageError(f"{kind}.{name}: expected a name of letters, digits and _, parts with dots between")
            try:
                base_unit_exponents(variable.unit or "1")
            except ValueError as error:
                inside = "after_parameters" if kind == "parameters" else "step"
                hint = f"; degrees are rad here, and converted in {inside}" if _DEGREES.search(variable.unit) else ""
                raise UsageError(f"{kind}.{name}: {error}{hint}") from None
            if kind != "parameters" and (variable.min is not None or variable.max is not None):
                raise UsageError(f"{kind}.{name}: expected min and max of parameters only")

    @property
    def shortest_period(self) -> float:
        """The period of a step [s]: the longest of which that of every task is a multiple."""
        return float(self._common)

    def ratio_of(self, task: WrappedTask) -> int:
        """The period of a task in steps."""
        return int(Fraction(str(task.period)) / self._common)

    @property
    def _common(self) -> Fraction:
        return common_step([Fraction(str(task.period)) for task in self.tasks] or [Fraction(str(self.period))])

    def variables(self) -> Iterator[tuple[str, str, WrappedVariable]]:
        """Each variable with its table and its name: inputs, outputs, parameters."""
        for kind in ("inputs", "outputs", "parameters"):
            for name, given in getattr(self, kind).items():
                yield kind, name, WrappedVariable(c=given) if isinstance(given, str) else given


def fmu_of(path: Path, version: int = 2) -> Path:
    """The FMU that is made of a file, beside it, or in fmi3/ for FMI 3.0; raises `UsageError` for an invalid file."""
    name = load(path).name
    return path.parent / ("" if version == 2 else FMI3) / f"{name}.fmu"


def described_by(path: Path) -> tuple[Path, int]:
    """The file that a path stands for, and the version of FMI of its FMU: `fmi3/NAME.toml` is of NAME.toml beside."""
    if path.parent.name == FMI3 and not path.is_file():
        return path.parent.parent / path.name, 3
    return path, 2


def load(path: Path) -> WrapFile:
    """Read a file; raises `UsageError` that names what is wrong."""
    return _parsed(path, read_text(path, WHAT))


def locate(path: Path, announce: Callable[[str], None] | None = None) -> Path:
    """The FMU of a file, made first if it is missing or its sources have changed; where consent is required for that,
    `UsageError` states how to give it.
    """
    path, version = described_by(path)
    fmu = fmu_of(path, version)
    if is_out_of_date(fmu, path):
        consent.expect(fmu, path.parent)
        if announce is not None:
            announce(f"building {fmu}")
        build(path, fmu, version=version)
    return fmu


def is_out_of_date(fmu: Path, path: Path) -> bool:
    """Whether an FMU is missing, or was made of other sources, by another kit or of another file."""
    from fmu_kit.compiler.pack.freshness import wrapping_hash

    stored = read_wrapped(fmu)
    if stored is None or stored.get("kit") != wrapping_hash() or stored.get("toml") != _hash_of(path):
        return True
    read: Mapping[str, str] = stored.get("read", {})
    return any(_hash_of(path.parent / name) != known for name, known in read.items())


def in_double(fmu: str) -> Path | None:
    """The FMU of the same code with its floats as doubles, made once in the user's cache; `fmu` as for `fmus.locate`.

    None for any other, for code without floats, and for an FMU without its file and sources beside it, or with those
    of another. Raises `UsageError` for code that cannot be compiled so.
    """
    from fmu_kit.compiler.pack.in_double import has_floats

    path = Path(fmu)
    made = locate(path) if path.suffix == WRAPPED else path
    stored = read_wrapped(made) if made.suffix == ".fmu" else None
    if stored is None:
        return None
    folder = made.parent.parent if made.parent.name == FMI3 else made.parent
    file = folder / stored["file"] if "file" in stored else described_by(path)[0]
    if is_out_of_date(made, file) or not any(map(has_floats, _texts(file, stored["read"]))):
        return None
    twin = in_double_folder() / hashlib.sha256(made.read_bytes()).hexdigest() / made.name
    if not twin.is_file():
        try:
            twin.parent.mkdir(parents=True, exist_ok=True)
            build(file, twin, version=3 if made.parent.name == FMI3 else 2, in_double=True)
        except UsageError as error:
            raise UsageError(f"the linear theory takes floats in double precision, and {error}") from None
        except OSError as error:
            raise QuadcosimError(f"{twin}: expected a place for the code in double precision: {error}") from None
    return twin


def in_double_folder() -> Path:
    """The folder of FMUs in double precision."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("quadcosim")) / "double"


def _texts(file: Path, read: Iterable[str]) -> Iterator[str]:
    """The file of a controller, and the sources and headers that were read for its FMU."""
    for path in (file, *(file.parent / name for name in read)):
        if path.suffix not in (".a", ".o"):
            yield path.read_text(encoding="utf-8", errors="replace")


def _hash_of(path: Path) -> str | None:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None


def build(
    path: Path,
    out: Path,
    *,
    version: int = 2,
    systems: str | None = None,
    sanitize: bool = False,
    in_double: bool = False,
) -> Path:
    """Make the FMU `out` of a file, in a separate process, since the code runs for its start values.

    With `sanitize` the code is checked while it runs, also where its file does not say so; `in_double` its floats are
    doubles.
    Raises `UsageError` for code that cannot be wrapped as it is, naming line and symbol, and `QuadcosimError` for what
    is missing here.
    """
    content = json.dumps({**description_of(path), "in_double": in_double, **({"sanitize": True} if sanitize else {})})
    done = subprocess.run(
        subprocesses.command("fmu_kit.compiler.pack.wrapping", out.resolve(), version, systems or ""),
        input=content, capture_output=True, text=True, errors="replace", env=subprocesses.environment(), check=False,
    )  # fmt: skip
    lines = done.stderr.strip().splitlines()
    said = "" if done.returncode == 0 else lines.pop() if lines else "no output"
    if done.returncode not in (0, REFUSED):
        raise QuadcosimError(f"building {out} failed: {said}")
    for line in lines[:MOST_WARNINGS]:
        _NOTES.warning("warning: %s", path.parent / line)
    if len(lines) > MOST_WARNINGS:
        _NOTES.warning("warning: and %d more of the compiler", len(lines) - MOST_WARNINGS)
    if said:
        raise UsageError(str(path.parent / said))
    return out


def _parsed(path: Path, text: str) -> WrapFile:
    if path.suffix != WRAPPED:
        raise UsageError(
            f"{path}: expected the {WRAPPED} file that describes the code, as from quadcosim new controller NAME --c"
        )
    tables = toml_of(text, str(path))
    with prefixed(f"{path}: "):
        for kind in ("inputs", "outputs", "parameters"):
            found = tables.get(kind, {})
            if isinstance(found, dict):
                tables[kind] = {name: _variable(kind, name, value) for name, value in _flat(found)}
    tables["tasks"] = _tasks(path, text.splitlines(), tables.get("tasks", ()))
    with prefixed(f"{path}: "):
        return WrapFile(**tables)


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The variables of a table: `position.x = …` is a table of a table."""
    for name, value in table.items():
        if isinstance(value, dict) and value and "c" not in value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _variable(kind: str, name: str, value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    with prefixed(f"{kind}.{name}."):
        return WrappedVariable(**value)


def _tasks(path: Path, lines: Sequence[str], given: Any) -> Any:
    """The tasks of a file; raises `UsageError` with the line of what is wrong."""
    if not isinstance(given, list):
        return given
    found: dict[str, WrappedTask] = {}
    for number, one in enumerate(given):
        with prefixed(f"{path}:{_line_of(lines, 'tasks', 'name', number)}: tasks: "):
            if not isinstance(one, dict):
                raise UsageError("expected [[tasks]] with name, period and step")
            task = WrappedTask(**one)
            if not re.fullmatch(r"[A-Za-z_]\w*", task.name, re.ASCII):
                raise UsageError(f"name = {task.name!r}: expected letters, digits and _, no digit first")
            if task.name in found:
                raise UsageError(f"name = {task.name}: expected another name than that of a task before")
        with prefixed(f"{path}:{_line_of(lines, 'tasks', 'period', number)}: tasks.{task.name}."):
            _expect_period("period", task.period)
        found[task.name] = task
    return tuple(found.values())


def _expect_period(place: str, period: float) -> None:
    if not (period > 0.0 and isfinite(period)):
        raise UsageError(f"{place} = {period}: expected a positive number of seconds")


def description_of(path: Path) -> dict[str, Any]:
    """What the packer needs to know, with the lines of what is C."""
    text = read_text(path, WHAT)
    file, lines = _parsed(path, text), text.splitlines()

    def code(words: str, table: str, key: str, number: int = 0) -> dict[str, Any]:
        return {"text": words, "line": _line_of(lines, table, key, number)}

    def optional(key: str) -> dict[str, Any] | None:
        return code(getattr(file, key), "", key) if getattr(file, key) else None

    steps = [
        {
            "step": code(task.step, "tasks", "step", number),
            "ratio": file.ratio_of(task),
            "name": task.name,
            "period": float(task.period),
        }
        for number, task in enumerate(file.tasks)
    ]
    return {
        **{name: getattr(file, name) for name in _UNCHANGED},
        **{name: optional(name) for name in ("declare", "init", "after_parameters")},
        "file": path.name,
        "hash": _hash_of(path),
        "folder": str(path.parent.resolve()),
        "period": file.shortest_period,
        "headers": [code(header, "", "headers") for header in file.headers],
        "tasks": steps or [{"step": code(file.step or "", "", "step"), "ratio": 1}],
        "places": [
            {
                "name": name,
                "causality": kind.removesuffix("s"),
                "lvalue": code(variable.c, kind, name),
                "unit": variable.unit or None,
                "description": variable.description,
                "minimum": variable.min,
                "maximum": variable.max,
            }
            for kind, name, variable in file.variables()
        ],
    }


_UNCHANGED = ("name", "description", "author", "license", "sources", "include", "defines", "sanitize")


def _line_of(lines: Sequence[str], table: str, key: str, number: int = 0) -> int:
    """The line, from 1, of what a key of a table stands for, or of the table where it is written otherwise.

    A text of several lines begins on the line after its quotes. `number`: of the table, among several of this name.
    """
    current, seen, fallback = "", -1, 1
    named = re.compile(rf"""\s*(?:\w+\.)*["']?{re.escape(key)}["']?\s*=\s*(?P<value>.*)""")
    for line, text in enumerate(lines, 1):
        header = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", text)
        if header and "=" not in text:
            current, seen = header[1].strip("\"'"), seen + (header[1] == table)
            fallback = line if current == table else fallback
        inside = current == table or current.startswith(f"{table}.")
        local = key.removeprefix(f"{current.removeprefix(table).lstrip('.')}.") if inside else key
        found = named.match(text) or (local != key and re.match(rf"\s*{re.escape(local)}\s*=\s*(?P<value>.*)", text))
        if inside and found and seen >= min(number, seen if not table else number):
            return line + (found["value"].strip() in ('"""', "'''"))
    return fallback
