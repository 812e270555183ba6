"""The metrics of a run: the objectives and the criterion of its system."""

import operator
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from orchestration.foundation.basics.errors import UsageError, shown, told_apart
from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.foundation.basics.times import instants_of
from orchestration.foundation.basics.unit_algebra import after
from orchestration.foundation.recording.recording import Chunk, Events, InMemory, Recording
from orchestration.simulation.results import display_names as labels
from orchestration.simulation.results.own_points import Points, cut_at_points, on_lines, rows_at_points
from orchestration.systems.expressions.over_run import Recorded, Spans, evaluate, expect_names, expect_number, vectors
from orchestration.systems.expressions.syntax import Name, Node, Number, Operation, names, parse
from orchestration.systems.expressions.syntax import text as text_of
from orchestration.systems.system.model import DIVERGED, TERMINATED, System, expressions
from orchestration.systems.system.request import Request, system_of

Metrics = dict[str, float | int | bool | str | None]

GOOD = "criterion.good"
OUTCOME = "outcome"
FIXED = (OUTCOME, "good", "horizon", "diverged", "divergence_time", "steps")
"""Metrics that every run has beside its objectives."""
PRINTED = ("wall_time", "largest_lateness", "engine")
"""Names that `run` prints beside them, where there are any"""


def how_runs_ended(outcomes: Mapping[str | None, int], total: int) -> str:
    """How many of some runs have ended in which way, the most frequent first; those without an outcome do not count."""
    counts = sorted(((count, name) for name, count in outcomes.items() if name), reverse=True)
    ended = ", ".join(f"{count} {name}" for count, name in counts)
    return f"{ended or 'no outcome'} of {total} runs"


def undecided(system: System, outcomes: Mapping[str | None, int]) -> str:
    """What to know if most of some runs are neither good nor diverged at their end; empty if few are, or none can."""
    good, other = system.criterion.outcomes
    count, total = outcomes.get(other, 0), sum(outcomes.values())
    if system.criterion.diverged is None or 2 * count <= total:
        return ""
    return f"{count} of {total} runs are {other}, neither {good} nor {DIVERGED}: a longer stop_time may tell"


def compute(
    system: System,
    spans: Spans,
    *,
    end: float,
    divergence_time: float | None,
    steps: int,
    terminated: bool = False,
) -> Metrics:
    """The objectives of a run by name, and its outcome at its `end` [s].

    A run that diverged has no objectives: an average over the time that it lasted would favour runs that end early.
    One that an FMU has `terminated` has those of the time that it lasted, and is not good for the same reason.
    Raises `UsageError`, naming it, for an objective that cannot be evaluated.
    """
    values = None
    if divergence_time is None:
        good = {} if system.criterion.good is None else {GOOD: system.criterion.good}
        values = evaluate({name: parse(text) for name, text in {**system.objectives, **good}.items()}, spans)
    return metrics_of(
        system,
        values,
        end=end,
        stop_time=system.stop_time,
        divergence_time=divergence_time,
        steps=steps,
        terminated=terminated,
    )


def metrics_of(
    system: System,
    values: Mapping[str, float | None] | None,
    *,
    end: float,
    stop_time: float,
    divergence_time: float | None,
    steps: int,
    terminated: bool = False,
) -> Metrics:
    """The metrics of a run from the `values` of its expressions, that of `GOOD` included; None: it diverged.

    `system` has the names of the expressions and of the outcomes.
    """
    objectives: dict[str, float | None] = dict.fromkeys((*system.objectives, *system.optional))
    good = None if system.criterion.good is None else False
    if values is not None:
        objectives |= values
        if good is not None:
            good = bool(objectives.pop(GOOD)) and not terminated
    return {
        "outcome": DIVERGED if values is None else TERMINATED if terminated else outcome(system, good),
        "good": good,
        "horizon": stop_time if values is None else end,
        **objectives,
        "diverged": values is None,
        "divergence_time": divergence_time,
        "steps": steps,
    }


def outcome(system: System, good: bool | None) -> str | None:
    """The outcome of a run that reached its end; None if its system has no criterion."""
    return None if good is None else system.criterion.outcomes[0 if good else 1]


class OnlyUsed(InMemory):
    """A recorder that keeps what the expressions of a request use."""

    def __init__(self, request: Request) -> None:
        super().__init__()
        self._request, self._places = request, np.array([], dtype=np.int64)

    def begin(self, columns: tuple[str, ...]) -> None:
        """As `Recorder`."""
        super().begin(columns_used(system_of(self._request), columns))
        self._places = np.array([columns.index(name) for name in self.columns])

    def take(self, chunk: Chunk) -> None:
        """As `Recorder`."""
        super().take(replace(chunk, columns=self.columns, rows=chunk.rows[:, self._places]))


def columns_used(system: System, columns: Sequence[str]) -> tuple[str, ...]:
    """The time, and the columns that expressions of a system use."""
    named = {name for _, expression in expressions(system) for name in names(parse(expression))}
    return tuple(c for c in columns if c == "time" or c in named or c.rpartition(".")[0] in named)


def spans(
    system: System,
    recording: Recording,
    parameters: Mapping[str, float],
    end: float,
    points: Points | None,
    never_computed: Collection[str] = (),
) -> Iterator[Recorded]:
    """The data that expressions of a run up to `end` [s] use, chunk by chunk, each with the last row of the one before.

    `points` are those of its components in continuous time; None: all have one at every row. The first values of
    connections that are `never_computed` do not count to a first-order hold. The `stop_time` is the
    end, so that the last third of an interrupted run is that of its recording.
    """
    columns = columns_used(system, recording.columns)
    lines = {x.name: _Line(x.name not in never_computed) for x in system.connections if x.hold == "first"}
    before: Floats | None = None
    chunks = recording.chunks(columns)
    for chunk in chunks if points is None else cut_at_points(system, chunks, points):
        rows = chunk.rows if before is None else np.vstack([before, chunk.rows])
        goes_on = before is not None
        known = {} if points is None else rows_at_points(system, chunk.columns, rows, points)
        before = rows[-1:]
        rows = on_lines(chunk.columns, rows, known) if known else rows
        signals = {name: rows[:, i] for i, name in enumerate(chunk.columns)}
        arrivals = _arrivals(system, signals["time"], chunk.events)
        yield Recorded(
            time=signals["time"],
            signals={name: values for name, values in signals.items() if name != "time"},
            ends=_ends(system, signals, arrivals, lines),
            numbers=parameters,
            arrivals=arrivals,
            stop_time=end,
            goes_on=goes_on,
            known=known,
        )


def not_finite(spans: Spans) -> str | None:
    """The first value that is not finite of the signals that expressions use, as text; None if all are finite."""
    for span in spans():
        for name, values in span.signals.items():
            for place in np.flatnonzero(~np.isfinite(values))[:1]:
                return f"{name} = {values[place]} at t = {span.time[place]:g} s: what uses it may have no value"
    return None


def _arrivals(system: System, time: Floats, events: Events) -> dict[str, Booleans]:
    """By connection, the rows at which a message of it arrived, or was measured and not lost."""
    instants = instants_of(time)
    rows = {}
    for x in system.connections:
        arrived = events.table[events.are("arrived", x.name)]
        sampled, lost = events.table[events.are("sampled", x.name)], events.table[events.are("lost", x.name)]
        if len(lost):
            sampled = sampled[~np.isin(sampled[:, 3], lost[:, 3])]  # the event of a loss has the time of its sample
        times = np.concatenate([arrived[:, 0], sampled[:, 0]])
        times = times[(times >= instants[0]) & (times <= instants[-1])]
        at = np.searchsorted(instants, times)
        rows[x.name] = np.zeros(len(instants), dtype=np.bool_)
        rows[x.name][at[instants[at] == times]] = True
    return rows


def with_own_objectives(system: System, objectives: Mapping[str, str], table: str) -> System:
    """The system with further objectives, of a table in errors; raises `UsageError` for what cannot be one."""
    if not isinstance(objectives, Mapping):
        raise UsageError(f"{table} = {shown(repr(objectives))}: expected a dictionary of expressions by name")
    taken = [*system.objectives, *system.optional, *FIXED]
    for name, text in objectives.items():
        if name in taken:
            raise UsageError(f"{table}: {name}: expected another name; this one is taken")
        if not isinstance(text, str):
            raise UsageError(
                f"{table}: {name} = {shown(text)}: expected an expression as text, as in 'max(plant.tilt)'"
            )
    return replace(system, objectives={**system.objectives, **objectives}) if objectives else system


def with_available_objectives(system: System, signals: set[str], numbers: set[str]) -> System:
    """`system` without the optional objectives whose variables its FMUs do not have.

    Raises `UsageError` for an expression with an unknown name or with a value at each instant, and for a name that is
    taken.
    """
    valid = {"time", "stop_time", *signals, *vectors(dict.fromkeys(signals)), *numbers}
    courses = valid - numbers - {"stop_time"}
    available = {}
    for name, text in system.objectives.items():
        if name in (*FIXED, *PRINTED):
            raise UsageError(f"objectives.{name}: every run has a result of that name, expected another")
        if name in valid:
            raise UsageError(f"objectives.{name}: that name has another meaning in expressions, expected another")
        if name in system.optional and not valid.issuperset(names(parse(text))):
            continue
        _expect_known(parse(text), valid, f"objectives.{name}", system)
        expect_number(parse(text), courses, f"objectives.{name}")
        available[name] = text
        valid.add(name)
    for place, expression in (("good", system.criterion.good), ("diverged", system.criterion.diverged)):
        if expression is not None:
            _expect_known(parse(expression), valid, f"criterion.{place}", system)
    if system.criterion.good is not None:
        expect_number(parse(system.criterion.good), courses, "criterion.good")
    return system if len(available) == len(system.objectives) else replace(system, objectives=available)


def _expect_known(node: Node, valid: set[str], place: str, system: System) -> None:
    """Raise `UsageError` as `expect_names`; for an input that a source feeds it names the source's signal."""
    fed = {end: x for key, one in system.sources.items() for end, x in zip(one.to, one.signals(key))}
    for name in names(node):
        if name not in valid and name in fed:
            raise UsageError(f"{place}: {name} is no signal of a run: expected {fed[name]}, the source that feeds it")
    expect_names(node, valid, place)


def _ends(
    system: System, signals: Mapping[str, Floats], arrivals: Mapping[str, Booleans], lines: Mapping[str, "_Line"]
) -> dict[str, Floats]:
    """The value of every signal that is held between rows, just before the next row."""
    ends: dict[str, Floats] = {}
    for name, component in system.components.items():
        if component.sampling is not None:
            ends |= {key: values[:-1] for key, values in signals.items() if key.startswith(f"{name}.")}
    for x in system.connections:
        held = [end for end in x.end if end in signals]
        if x.hold == "zero":
            ends |= {end: signals[end][:-1] for end in held}
        else:
            ends |= lines[x.name].ends(signals["time"], {end: signals[end] for end in held}, arrivals[x.name])
    for name, source in system.sources.items():
        if source.is_held:
            ends |= {key: values[:-1] for key, values in signals.items() if key.startswith(f"{name}.")}
    return ends


class _Line:
    """First-order hold: the line through the last two values that arrived, continued from chunk to chunk."""

    def __init__(self, from_first_exchange: bool) -> None:
        self._begins = from_first_exchange
        self._last: dict[str, list[tuple[float, float]]] = {}

    def ends(self, time: Floats, values: Mapping[str, Floats], arrived: Booleans) -> dict[str, Floats]:
        """The values on the line just before each next row."""
        return {name: self._end(name, time, held, arrived) for name, held in values.items()}

    def _end(self, name: str, time: Floats, held: Floats, arrived: Booleans) -> Floats:
        past = self._last.get(name)
        rows = np.flatnonzero(arrived)
        if past is None:  # the value of initialisation is the first, or one from which no line rises
            past = [(float(time[0]) if self._begins or arrived[0] else -np.inf, float(held[0]))]
            rows = rows[rows > 0]
        points = [*past, *((float(time[i]), float(held[i])) for i in rows)]
        times, heights = np.array(points).T
        slopes = np.concatenate([[0.0], np.diff(heights) / np.diff(times)])
        latest = np.searchsorted(times, time[:-1], side="right") - 1
        self._last[name] = points[-2:]
        return held[:-1] + slopes[latest] * np.diff(time)


_HOLDS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def judged_objective(system: System) -> str | None:
    """The objective that the criterion judges, or else the first one; None if there is none."""
    named = names(parse(system.criterion.good)) if system.criterion.good is not None else ()
    return next((name for name in named if name in system.objectives), next(iter(system.objectives), None))


def bound_of(system: System, metric: str) -> float | None:
    """The bound of a criterion, or of a part that `and` joins, that is only `metric < number`, or alike; else None."""
    if system.criterion.good is None:
        return None
    for part in _parts(parse(system.criterion.good)):
        match part:
            case Operation(operation, (Name(name), Number(bound))) if name == metric and operation in _HOLDS:
                return bound
    return None


def criterion_in_words(system: System, units: Mapping[str, str]) -> str:
    """The condition by which a run is good, with the names and units of its objectives; `units` as in `unmet`."""
    return " and ".join(_in_words(part, units) for part in _parts(parse(system.criterion.good or "")))


def missed_objective(system: System, metrics: Mapping[str, Any]) -> str | None:
    """The first objective of which a run that did not diverge misses a bound; None: there is none."""
    if unmet(system, metrics, {}) is None or system.criterion.good is None:
        return None
    parts = _parts(parse(system.criterion.good))
    return next((names(part)[0] for part in parts if _missed(part, metrics, {})), None)


def unmet(system: System, metrics: Mapping[str, Any], units: Mapping[str, str]) -> str | None:
    """The parts of the criterion that a run did not meet, with value and bound; None: it met all, or diverged.

    `units` are those of its metrics, by name. Parts are joined by `and`; for one that is no comparison of an objective
    with a number the text is only that it does not hold.
    """
    if system.criterion.good is None or metrics["good"] is not False or metrics["outcome"] == "diverged":
        return None
    parts = [text for part in _parts(parse(system.criterion.good)) if (text := _missed(part, metrics, units))]
    return "; ".join(parts) or f"{system.criterion.good} does not hold"


def _parts(node: Node) -> Iterator[Node]:
    match node:
        case Operation("and", (left, right)):
            yield from _parts(left)
            yield from _parts(right)
        case _:
            yield node


def _in_words(part: Node, units: Mapping[str, str]) -> str:
    match part:
        case Operation(operation, (Name(name), Number(bound))) if operation in _HOLDS:
            unit = units.get(name) or labels.METRICS.get(name, ("", None))[1]
            return f"{labels.metric(name)} {operation} {labels.amount(bound, unit, 6)}"
        case Operation("or"):
            return f"({text_of(part)})"
    return text_of(part)


def _missed(part: Node, metrics: Mapping[str, Any], units: Mapping[str, str]) -> str | None:
    match part:
        case Operation(operation, (Name(name), Number(bound))) if operation in _HOLDS and name in metrics:
            value = metrics[name]
            if value is not None and _HOLDS[operation](value, bound):
                return None
            unit = after(units.get(name))
            shown, limit = ("", f"{bound:g}") if value is None else told_apart(value, bound, digits=4)
            return f"{name} {f'= {shown}{unit}' if shown else 'has no value'}, expected {operation} {limit}{unit}"
    return None
