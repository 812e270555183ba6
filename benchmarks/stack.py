"""The deepest stack of compiled C: the frames along the deepest path of calls, both as reported by gcc."""

import re
from collections.abc import Mapping
from functools import cache

OPTIONS = ("-fstack-usage", "-fcallgraph-info=su")
"""options of gcc 10 and newer that write the graph NAME.ci beside an object NAME.o"""
_NODE = re.compile(r'node: \{ title: "([^"]*)" label: "([^"]*)"')
_FRAME = re.compile(r"(\d+) bytes \(([^)]*)\)")
_EDGE = re.compile(r'edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"')


def deepest(graph: str) -> dict[str, int]:
    """The largest stack [bytes] of a call of each function of a graph, without library functions.

    Raises `ValueError` if it has no known bound: recursion, calls by address, arrays of variable length.
    """
    frames = {name: _frame(name, label) for name, label in _NODE.findall(graph)}
    called: dict[str, set[str]] = {name: set() for name in frames}
    for caller, callee in _EDGE.findall(graph):
        called[caller].add(callee)
    return _depths(frames, called)


def _frame(name: str, label: str) -> int:
    found = _FRAME.search(label)
    if name == "__indirect_call" or (found is not None and found[2] != "static"):
        raise ValueError(f"{name}: expected calls by name and frames of one size")
    return 0 if found is None else int(found[1])


def _depths(frames: Mapping[str, int], called: Mapping[str, set[str]]) -> dict[str, int]:
    @cache
    def depth(name: str) -> int:
        return frames[name] + max(map(depth, called[name]), default=0)

    try:
        return {name: depth(name) for name in frames}
    except RecursionError:
        raise ValueError("expected functions that do not call themselves") from None
