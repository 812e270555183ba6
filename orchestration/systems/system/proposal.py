"""Proposes a system file for some FMUs from their model descriptions, with comments on what is undecided."""

import itertools
import json
import os
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestration.components.building.models import PATHS
from orchestration.components.fmi.access import SCHEDULED, Access
from orchestration.components.fmi.read_description import Model, called, declared_of
from orchestration.foundation.basics.errors import UsageError
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.matching import Match, match

STEP, PERIOD, STOP = 0.001, 0.01, 10.0
"""Step, period and stop time [s] where no FMU has a default experiment"""
WIDTH = 110
"""Characters of a line; a longer list has a line for each of its members"""
_TO_FILL_IN = (
    "# Objectives of a run, and the criterion of a good one, which `quadcosim limit` needs. Fill in, for instance:",
    "# [objectives]",
    '# peak = "max(abs({0}))"',
    '# final = "max(abs({0}) * (time >= 0.75 * stop_time))"',
    "#",
    "# [criterion]",
    '# good = "final < 0.05"',
    '# diverged = "abs({0}) > 1e3"',
)


def to_fill_in(signal: str) -> list[str]:
    """Comments on objectives and a criterion, about a signal."""
    return [line.format(signal) for line in _TO_FILL_IN]


TAKEN = frozenset(("rows", "time", "stop_time", "sampled"))
"""Names that no component can have"""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A system file as text, its guesses, and what it leaves undecided."""

    text: str
    guessed: tuple[str, ...]
    """connections of variables with different names, and which components are controllers"""
    undecided: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class ProposedResources:
    """Computers and networks of other files, for the proposal."""

    tables: Mapping[str, Any] = field(default_factory=dict)
    """Tables of a system file"""
    guessed: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()


def propose(fmus: Sequence[tuple[str, Model]], folder: Path, resources: ProposedResources | None = None) -> Proposal:
    """Components named after their models, connected by name, type and unit; for a file that lies in `folder`.

    Each FMU is given by the path or name that the user wrote, with its model description.

    An FMU whose outputs are all discrete is proposed as sampled, and so is the controller of a loop; any other in
    continuous time. Raises `UsageError` without any FMU, and for one whose clocks cannot tick.
    """
    resources = resources or ProposedResources()
    if not (fmus or resources.tables):
        raise UsageError("expected at least one FMU")
    fmus = [(text, each) for text, model in fmus for each in _whose_clocks_tick(model)]
    models = [model for _, model in fmus]
    named = dict(zip(component_names(models), models))
    matches = match(named)
    sampled = {name: "all its outputs are discrete" for name, model in named.items() if _is_discrete(model)}
    sampled |= {name: "its clock ticks then" for name, model in named.items() if model.ticking}
    guessed = _controllers(named, matches.matches, sampled)
    sampled |= guessed
    stop = max((experiment(model, "stopTime") or 0.0 for model in models), default=0.0) or STOP
    blocks = [
        [
            "# Proposed from what the FMUs say of themselves. Look at each line: names are no proof."
            if fmus
            else "# Proposed from what the files of tasks and messages say. Look at each line.",
            f"stop_time = {stop!r}",
        ],
        *(_component(name, text, model, folder, sampled.get(name)) for name, (text, model) in zip(named, fmus)),
        *_connections(sorted(matches.matches, key=lambda m: list(named).index(component_of(m.start)))),
    ]
    blocks += _resources(resources.tables)
    undecided = (*matches.undecided, *resources.undecided)
    if undecided:
        blocks.append(["# Not decided:", *(f"# - {line}" for line in undecided)])
    moving = sorted(named, key=lambda name: name in sampled)
    first = next((f"{n}.{v}" for n in moving for v in named[n].names("output", kinds=("Real",))), None)
    if first is not None:
        blocks.append(to_fill_in(first))
    return Proposal(
        text="\n\n".join("\n".join(block) for block in blocks) + "\n",
        guessed=(
            *_guesses(matches.matches),
            *(f"{name} is sampled, as {why}" for name, why in guessed.items()),
            *resources.guessed,
        ),
        undecided=undecided,
    )


def _whose_clocks_tick(model: Model) -> list[Model]:
    """The FMU, in event mode if it has clocks, or its partitions; raises `UsageError` if its clocks cannot tick."""
    if model.interface == SCHEDULED:
        return [called(model, Access(interface=SCHEDULED, clock=clock.name)) for clock in model.clocks]
    if model.clocks and "event-mode" in declared_of(model.description):
        return [called(model, Access(interface="event-mode"))]
    model.expect_clocks_that_tick()
    return [model]


def _resources(tables: Mapping[str, Any]) -> list[list[str]]:
    import tomli_w

    return [
        [
            f"[{table}.{key_of(name)}]",
            *tomli_w.dumps({key: value for key, value in one.items() if key != parts}).splitlines(),
            *(f"{parts}.{key_of(part)} = {_inline(keys)}" for part, keys in one[parts].items()),
        ]
        for table, parts in (("computers", "tasks"), ("networks", "messages"))
        for name, one in tables.get(table, {}).items()
    ]


def _inline(keys: Mapping[str, Any]) -> str:
    pairs = (f"{key} = {_text(value) if isinstance(value, str) else repr(value)}" for key, value in keys.items())
    return f"{{ {', '.join(pairs)} }}"


def key_of(name: str) -> str:
    """A name as a key, in quotes where it needs them."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def component_names(models: Iterable[Model]) -> list[str]:
    """Unique names of components after the names of the models."""
    names: list[str] = []
    for model in models:
        plain = re.sub(r"\W+", "_", model.name.rpartition(".")[2], flags=re.ASCII).strip("_") or "component"
        plain = f"_{plain}" if plain[0].isdigit() else plain
        numbered = (plain, *(f"{plain}_{k}" for k in range(2, 2 + len(names))), f"{plain}_{2 + len(names)}")
        names.append(next(name for name in numbered if name not in names and name not in TAKEN))
    return names


def _is_discrete(model: Model) -> bool:
    outputs = model.names("output")
    return bool(outputs) and all(model.variables[name].variability != "continuous" for name in outputs)


def _controllers(named: Mapping[str, Model], found: Iterable[Match], sampled: Container[str]) -> dict[str, str]:
    """The likely controller of each two components in continuous time that feed each other, and the reason."""
    pairs = {(component_of(m.start), component_of(m.end)) for m in found}
    loops = [(a, b) for a, b in pairs if (b, a) in pairs and a not in sampled and b not in sampled]
    by_feedthrough = {
        a: _FEEDTHROUGH for a, b in loops if _has_feedthrough(named[a]) and not _has_feedthrough(named[b])
    }
    by_name = {a: _NAMED for a, b in loops if _NAMES.search(a) and not _NAMES.search(b)}
    return dict(sorted((by_feedthrough | by_name).items()))


_NAMES = re.compile(r"control|ctrl|pid|lqr|regulator|autopilot", re.IGNORECASE)
_NAMED, _FEEDTHROUGH = (
    "its name is that of a controller",
    "all its outputs follow its inputs at once, as a controller's do",
)


def _has_feedthrough(model: Model) -> bool:
    return all(model.depends_on(output) for output in model.names("output"))


def _component(name: str, fmu: str, model: Model, folder: Path, sampled: str | None) -> list[str]:
    """The lines of a component; `sampled` is the reason for sampling it."""
    lines = [f"[components.{name}]", f"fmu = {placed(fmu, folder)}"]
    step = experiment(model, "stepSize")
    if model.ticking:
        clock, scheduled = model.ticking[0], model.interface == SCHEDULED
        keys = [f"fmu_clock = {_text(clock.name)}"] * (not scheduled)
        keys += [f"period = {step or PERIOD!r}"] * (clock.interval is None)
        lines += [f"partition = {_text(clock.name)}"] * scheduled
        lines += [f"sampling = {{ {', '.join(keys)} }}"] * bool(keys)
    elif sampled is not None:
        note = "" if step else "; its FMU does not say how often"
        lines.append(f"sampling = {{ period = {step or PERIOD!r} }}    # sampled, as {sampled}{note}")
    else:
        note = "" if step else "    # its FMU does not say how long"
        lines.append(f"step = {step or STEP!r}{note}")
    return lines


def placed(fmu: str, folder: Path) -> str:
    """The value of the key `fmu` in a file that lies in `folder`, of the path or name that the user wrote."""
    return _text(_relative(Path(fmu), folder) if fmu.endswith(PATHS) else fmu)


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()


def experiment(model: Model, key: str) -> float | None:
    """A number of the FMU's default experiment, if present and positive."""
    try:
        value = float(getattr(model.description.defaultExperiment, key, None) or 0.0)
    except ValueError:
        return None
    return value if value > 0.0 else None


def _connections(found: Sequence[Match]) -> list[list[str]]:
    """A message for each pair of components, or several where signals are converted differently."""
    groups: dict[tuple[str, str, str], list[Match]] = {}
    for m in found:
        pair = component_of(m.start), component_of(m.end)
        groups.setdefault((*pair, "" if m.conversion.is_none else str(m.conversion)), []).append(m)
    counts: dict[str, itertools.count[int]] = {}
    blocks = []
    for (sender, receiver, converted), members in groups.items():
        base = f"{sender}_to_{receiver}"
        count = next(counts.setdefault(base, itertools.count(1)))
        blocks.append(_connection(base if count == 1 else f"{base}_{count}", members, converted))
    return blocks


def _connection(name: str, members: Sequence[Match], converted: str) -> list[str]:
    lines = ["[[connections]]", f"name = {_text(name)}"]
    lines += listed("from", [m.start for m in members])
    lines += listed("to", [m.end for m in members])
    if converted:
        conversion = members[0].conversion
        lines.append(f"scale = {conversion.scale!r}    # its units differ")
        lines += [f"offset = {conversion.offset!r}"] if conversion.offset else []
    return [*(f"# {guess}" for guess in _guesses(members)), *lines]


def _guesses(matches: Iterable[Match]) -> tuple[str, ...]:
    return tuple(f"{m.end} has {m.start} because {m.why}" for m in matches if m.why is not None)


def listed(key: str, ends: Sequence[str]) -> list[str]:
    """The lines of a key whose value is a list of texts."""
    line = f"{key} = [{', '.join(map(_text, ends))}]"
    return [line] if len(line) <= WIDTH else [f"{key} = [", *(f"    {_text(end)}," for end in ends), "]"]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
