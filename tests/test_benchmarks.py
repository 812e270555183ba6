"""Computations of the benchmarks."""

import pytest

from benchmarks.stack import deepest

GRAPH = """graph: { title: "a.c"
node: { title: "step" label: "step\\na.c:9:5\\n32 bytes (static)" }
node: { title: "a.c:law" label: "law\\na.c:5:5\\n700 bytes (static)" }
node: { title: "a.c:root" label: "root\\na.c:3:5\\n8 bytes (static)" }
node: { title: "memset" label: "memset\\n<built-in>" shape : ellipse }
edge: { sourcename: "step" targetname: "a.c:root" label: "a.c:10:3" }
edge: { sourcename: "step" targetname: "a.c:law" }
edge: { sourcename: "a.c:law" targetname: "a.c:root" }
edge: { sourcename: "a.c:law" targetname: "memset" }
"""


def test_the_stack_is_that_of_the_deepest_path_of_calls() -> None:
    assert deepest(GRAPH) == {"step": 740, "a.c:law": 708, "a.c:root": 8, "memset": 0}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('edge: { sourcename: "a.c:law" targetname: "memset" }', 'edge: { sourcename: "a.c:law" targetname: "step" }',
         "functions that do not call themselves"),
        ("700 bytes (static)", "700 bytes (dynamic)", "frames of one size"),
        ("memset", "__indirect_call", "calls by name"),
    ],
)  # fmt: skip
def test_a_stack_without_a_bound_that_is_known_is_refused(old: str, new: str, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        deepest(GRAPH.replace(old, new))
