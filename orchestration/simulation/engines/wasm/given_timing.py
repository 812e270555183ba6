"""Timing that a page has from Python, for what it cannot draw itself with the same bits: tables of all instants."""

from typing import Any

import numpy as np

from orchestration.foundation.basics.times import seconds
from orchestration.simulation.engines.batch.run_numbers import RunNumbers
from orchestration.simulation.engines.batch.shape import Shape
from orchestration.simulation.engines.resolved import source_values
from orchestration.simulation.engines.wasm.sources_in_c import number_text
from orchestration.systems.schedule.common_timetable import Span
from orchestration.systems.schedule.streams import Streams
from orchestration.systems.schedule.timetable import Timetable
from orchestration.systems.system.connection import component_of
from orchestration.systems.system.distribution import Distribution
from orchestration.systems.system.model import System

EXACT = ("hover", "step")
"""Motions of sums and products alone, whose C has the bits of Python's"""
_ALL = 2**40
"""More instants than a page has"""


def reason(system: System) -> str | None:
    """Why the timing of a system is computed in Python, in some words; None: a page computes it."""
    if system.uses_scheduler:
        return "computers and networks are scheduled"
    for name, component in system.components.items():
        if component.sampling is not None and isinstance(component.sampling.jitter, Distribution):
            return f"components.{name}.sampling.jitter is a distribution"
    for x in system.connections:
        for key in ("delay", "delay_jitter", "loss"):
            if isinstance(getattr(x, key), Distribution):
                return f"connections.{x.name}.{key} is a distribution"
    for name, source in system.sources.items():
        if source.to and source.signal not in EXACT and (source.is_built_in or source.is_motion or source.signal):
            return f"sources.{name} is a function of time"
    return None


def _table(kind: str, name: str, values: Any) -> str:
    """The C of an array."""
    text = number_text if kind == "double" else str
    return f"static const {kind} {name}[] = {{{', '.join(map(text, np.asarray(values).ravel().tolist() or [0]))}}};"


class GivenTiming:
    """The instants and messages of a run, and the values of its sources at each, as C."""

    def __init__(self, shape: Shape) -> None:
        system = shape.system
        streams, self._numbers = Streams(system.seed, system.streams), RunNumbers(shape)
        timetable = Timetable(system, streams)
        first, stop = timetable.first_samples, timetable.stop
        (span,) = timetable.spans(_ALL)
        self.size = len(span.regular) + sum(len(t) for t in (span.own, span.exchanged, span.posted, span.measured))
        """Number of instants and messages"""
        sampled = [shape.names[i] for i in shape.wires.sampled]
        self.timing = "\n".join(
            [_table("int64_t", "given_first_samples", [first.get(name, stop) for name in sampled]), *_tables(span)]
        )
        self.sources = self._sources(shape, span, streams)

    def number(self, shape: Shape, name: str) -> float:
        """The value of a measure of jobs."""
        return self._numbers.of(0, shape.system, name)

    def _sources(self, shape: Shape, span: Span, streams: Streams) -> str:
        system, parameters = shape.system, self._numbers.parameters(0, shape.system)
        values = {name: source_values(system, name, parameters, streams) for name in system.sources}
        seen = [values[name] for name in shape.seen]
        fed = [name for name, source in system.sources.items() if source.to]
        texts = [_table("double", "given_at_first", [x for name in fed for x in values[name].at(0.0)])]
        for name, instants in (("regular", span.regular), ("own", span.own)):
            t = seconds(instants.times)
            sampled = np.isin(instants.times, span.sampled)[:, None]
            given = [t[:, None][:, :0]]
            for each in fed:
                all_sample = all(system.components[component_of(end)].sampling for end in system.sources[each].to)
                needed = values[each].at_each(t)
                given.append(np.where(sampled, needed, 0.0) if all_sample else needed)
            texts.append(_table("double", f"seen_{name}", np.hstack([given[0], *(each.over(t) for each in seen)])))
            texts.append(_table("double", f"given_{name}", np.hstack(given)))
        return "\n".join(texts)


def _tables(span: Span) -> list[str]:
    texts = []
    for name, instants in (("regular", span.regular), ("own", span.own)):
        texts.append(_table("int64_t", f"given_{name}", instants.times))
        texts.append(_table("uint8_t", f"given_{name}_stepped", instants.stepped.astype(np.uint8)))
        texts.append(f"enum {{ GIVEN_{name.upper()} = {len(instants)} }};")
    for name in ("posted", "measured", "arrivals", "exchanged", "samples", "sampled"):
        rows = getattr(span, name)
        texts += [_table("int64_t", f"given_{name}", rows), f"enum {{ GIVEN_{name.upper()} = {len(rows)} }};"]
    return texts
