"""The first exchange of values, at initialisation: in the order of dependencies, with iteration around loops."""

from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy as np

from orchestration.foundation.basics.simulator import Booleans, Floats
from orchestration.systems.system.connection import Connection, variable_of

ITERATIONS, CONVERGED = 100, 1e-12
"""The most iterations around a loop, and the relative change below which it has converged"""
PassOn = Callable[[int, Booleans], tuple[Floats, Floats]]
"""Carries out a connection in the runs that have not converged; returns the values of its receiver before and after"""
Dependencies = Callable[[str, str], Collection[str] | None]
"""The inputs of a component that one of its outputs depends on at initialisation; None: on all of them"""


def groups(connections: Sequence[Connection], dependencies: Dependencies) -> tuple[tuple[int, ...], ...]:
    """Indices of connections in the order of the first exchange, in groups of mutual dependency."""
    before = {
        i: [j for j, other in enumerate(connections) if _needs(x, other, dependencies)]
        for i, x in enumerate(connections)
    }
    return _components(before)


def exchange(
    group: Sequence[int], pass_on: PassOn, runs: tuple[int, ...] = (), *, iterations: int = ITERATIONS
) -> Booleans:
    """Carry out the connections of a group, repeatedly until the values converge if they form a loop.

    `runs` is the shape of the runs that are carried out together. Returns those that have not converged.
    """
    open_: Any = np.ones(runs, dtype=np.bool_)
    for _ in range(iterations):
        settled: Any = np.ones(runs, dtype=np.bool_)
        for index in group:
            before, after = pass_on(index, open_)
            settled &= (np.abs(after - before) <= CONVERGED * np.maximum(1.0, np.abs(after))).all(axis=0)
        open_ = open_ & ~settled
        if len(group) == 1 or not open_.any():
            return np.zeros(runs, dtype=np.bool_)
    return np.asarray(open_)


def _needs(x: Connection, other: Connection, dependencies: Dependencies) -> bool:
    """Whether what `x` carries depends on what `other` delivers."""
    if other.receiver != x.sender:
        return False
    delivered = {variable_of(end) for end in other.end}
    for start in x.start:
        needed = dependencies(x.sender, variable_of(start))
        if needed is None or delivered.intersection(needed):
            return True
    return False


def _components(before: dict[int, list[int]]) -> tuple[tuple[int, ...], ...]:
    """Strongly connected components of a graph, those that others need first (Tarjan, with an explicit stack)."""
    index: dict[int, int] = {}
    low: dict[int, int] = {}
    path: list[int] = []
    components: list[tuple[int, ...]] = []
    for root in before:
        work = [(root, iter(before[root]))] if root not in index else []
        while work:
            node, needed = work[-1]
            if node not in index:
                index[node] = low[node] = len(index)
                path.append(node)
            for other in needed:
                if other not in index:
                    work.append((other, iter(before[other])))
                    break
                if other in path:
                    low[node] = min(low[node], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    place = path.index(node)
                    components.append(tuple(sorted(path[place:])))
                    del path[place:]
    return tuple(components)
