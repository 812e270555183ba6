"""A system file for some FMUs, proposed from what they say of themselves, with comments on what it leaves open."""

import itertools
import json
import os
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from orchestration.basics.errors import UsageError
from orchestration.fmi.model import Model
from orchestration.system.matching import Match, match
from orchestration.system.variable_names import component_of

STEP, PERIOD, STOP = 0.001, 0.01, 10.0
"""[s], where no FMU says how it is meant to be run"""
WIDTH = 110
"""Characters of a line beyond which a list has a line for each of its members"""
_TO_FILL_IN = (
    "# What a run comes to, and when it is good, which `quadcosim limit` asks for. Fill in, for instance:",
    "# [objectives]",
    '# peak = "max(abs({0}))"',
    '# final = "max(abs({0}) * (time >= 0.75 * stop_time))"',
    "#",
    "# [criterion]",
    '# good = "final < 0.05"',
    '# diverged = "abs({0}) > 1e3"',
)
TAKEN = frozenset(("rows", "time", "stop_time", "sampled"))
"""Names that no component can have"""


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A system file as text, what it guesses, and what it does not decide."""

    text: str
    guessed: tuple[str, ...]
    """connections of variables with different names, and who is a controller"""
    undecided: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Resources:
    """What else is proposed: computers and networks of other files."""

    tables: Mapping[str, Any] = field(default_factory=dict)
    """of a system file"""
    guessed: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()


def propose(fmus: Sequence[tuple[str, Model]], folder: Path, resources: Resources | None = None) -> Proposal:
    """Components named after their models, connected by name, type and unit; for a file that lies in `folder`.

    Each FMU is given by the path or name that the user wrote, with what it says of itself.

    One whose outputs are all discrete is proposed as sampled, and so is the controller of a loop; any other in
    continuous time. Raises `UsageError` without any FMU.
    """
    resources = resources or Resources()
    if not (fmus or resources.tables):
        raise UsageError("expected at least one FMU")
    models = [model for _, model in fmus]
    named = dict(zip(_names(models), models))
    matches = match(named)
    sampled = {name: "all its outputs are discrete" for name, model in named.items() if _is_discrete(model)}
    guessed = _controllers(named, matches.found, sampled)
    sampled |= guessed
    stop = max((_experiment(model, "stopTime") or 0.0 for model in models), default=0.0) or STOP
    blocks = [
        [
            "# Proposed from what the FMUs say of themselves. Look at each line: names are no proof."
            if fmus
            else "# Proposed from what the files of tasks and messages say. Look at each line.",
            f"stop_time = {stop!r}",
        ],
        *(_component(name, text, model, folder, sampled.get(name)) for name, (text, model) in zip(named, fmus)),
        *_connections(sorted(matches.found, key=lambda m: list(named).index(component_of(m.start)))),
    ]
    blocks += _resources(resources.tables)
    undecided = (*matches.undecided, *resources.undecided)
    if undecided:
        blocks.append(["# Not decided:", *(f"# - {line}" for line in undecided)])
    moving = sorted(named, key=lambda name: name in sampled)
    first = next((f"{n}.{v}" for n in moving for v in named[n].names("output", kinds=("Real",))), None)
    if first is not None:
        blocks.append([line.format(first) for line in _TO_FILL_IN])
    return Proposal(
        text="\n\n".join("\n".join(block) for block in blocks) + "\n",
        guessed=(
            *_guesses(matches.found),
            *(f"{name} is sampled, as {why}" for name, why in guessed.items()),
            *resources.guessed,
        ),
        undecided=undecided,
    )


def _resources(tables: Mapping[str, Any]) -> list[list[str]]:
    import tomli_w

    return [
        [
            f"[{table}.{_key(name)}]",
            *tomli_w.dumps({key: value for key, value in one.items() if key != parts}).splitlines(),
            *(f"{parts}.{_key(part)} = {_inline(keys)}" for part, keys in one[parts].items()),
        ]
        for table, parts in (("computers", "tasks"), ("networks", "messages"))
        for name, one in tables.get(table, {}).items()
    ]


def _inline(keys: Mapping[str, Any]) -> str:
    said = (f"{key} = {_text(value) if isinstance(value, str) else repr(value)}" for key, value in keys.items())
    return f"{{ {', '.join(said)} }}"


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _names(models: Iterable[Model]) -> list[str]:
    """The models' names as names of components, each once."""
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
    """Of each two in continuous time that feed each other, the one that seems to be the controller, and why."""
    pairs = {(component_of(m.start), component_of(m.end)) for m in found}
    loops = [(a, b) for a, b in pairs if (b, a) in pairs and a not in sampled and b not in sampled]
    by_answer = {a: _ANSWERS for a, b in loops if _answers_at_once(named[a]) and not _answers_at_once(named[b])}
    by_name = {a: _NAMED for a, b in loops if _NAMES.search(a) and not _NAMES.search(b)}
    return dict(sorted((by_answer | by_name).items()))


_NAMES = re.compile(r"control|ctrl|pid|lqr|regulator|autopilot", re.IGNORECASE)
_NAMED, _ANSWERS = "its name is that of a controller", "all its outputs follow its inputs at once, as a controller's do"


def _answers_at_once(model: Model) -> bool:
    return all(model.depends_on(output) for output in model.names("output"))


def _component(name: str, fmu: str, model: Model, folder: Path, sampled: str | None) -> list[str]:
    """`sampled` says why it is."""
    place = _relative(Path(fmu), folder) if fmu.endswith(".fmu") else fmu
    lines = [f"[components.{name}]", f"fmu = {_text(place)}"]
    step = _experiment(model, "stepSize")
    if sampled is not None:
        said = "" if step else "; its FMU does not say how often"
        lines.append(f"sampling = {{ period = {step or PERIOD!r} }}    # sampled, as {sampled}{said}")
    else:
        said = "" if step else "    # its FMU does not say how long"
        lines.append(f"step = {step or STEP!r}{said}")
    return lines


def _relative(path: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()


def _experiment(model: Model, key: str) -> float | None:
    """A number of the FMU's default experiment, if it is there and positive."""
    try:
        value = float(getattr(model.description.defaultExperiment, key, None) or 0.0)
    except ValueError:
        return None
    return value if value > 0.0 else None


def _connections(found: Sequence[Match]) -> list[list[str]]:
    """A message for each pair of components, or more where signals are converted differently."""
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
    lines += _list("from", [m.start for m in members])
    lines += _list("to", [m.end for m in members])
    if converted:
        conversion = members[0].conversion
        lines.append(f"scale = {conversion.scale!r}    # its units differ")
        lines += [f"offset = {conversion.offset!r}"] if conversion.offset else []
    return [*(f"# {guess}" for guess in _guesses(members)), *lines]


def _guesses(matches: Iterable[Match]) -> tuple[str, ...]:
    return tuple(f"{m.end} has {m.start} because {m.why}" for m in matches if m.why is not None)


def _list(key: str, ends: Sequence[str]) -> list[str]:
    line = f"{key} = [{', '.join(map(_text, ends))}]"
    return [line] if len(line) <= WIDTH else [f"{key} = [", *(f"    {_text(end)}," for end in ends), "]"]


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
