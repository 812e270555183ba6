"""The tables of numpy's normal numbers (the ziggurat of Marsaglia and Tsang), as C, measured on the numpy that runs."""

import functools
import itertools
import math
from collections.abc import Sequence

import numpy as np

TAIL = 3.6541528853610088
"""The end of the lowest layer, where the tail begins"""
_LAYERS, _PLACES = 256, 2**52
_TRIES = 60_000
"""Numbers that are drawn: of each layer hundreds"""


@functools.cache
def widths() -> tuple[float, ...]:
    """By layer, the factor from a whole number of 52 bits to a normal one.

    A draw that takes one word of the generator, or two, is that product, rounded: many of them leave one factor.
    """
    bits, before = np.random.PCG64(0), np.random.PCG64(0)
    generator = np.random.Generator(bits)
    found: list[dict[float, None]] = [{} for _ in range(_LAYERS)]
    samples: list[list[tuple[int, float]]] = [[] for _ in range(_LAYERS)]
    for _ in range(_TRIES):
        before.state = bits.state
        word = int(before.random_raw())
        x = abs(float(generator.standard_normal()))
        layer, place = word & 0xFF, word >> 9 & (_PLACES - 1)
        ends = [before.state["state"]]
        before.random_raw()
        if bits.state["state"] in (*ends, before.state["state"]) and place:
            samples[layer].append((place, x))
    for layer, pairs in enumerate(samples):
        place, x = max(pairs)
        near = [x / place]
        for _ in range(3):
            near = [math.nextafter(near[0], 0.0), *near, math.nextafter(near[-1], 1.0)]
        for width in near:
            if all(place * width == x for place, x in pairs):
                found[layer][width] = None
    if any(len(each) != 1 for each in found):
        raise AssertionError("the normal numbers of this numpy are not those of a ziggurat of 256 layers")
    return tuple(next(iter(each)) for each in found)


def tables() -> str:
    """The C of the tables."""
    edges = [width * _PLACES for width in widths()]
    heights = [1.0, *(math.exp(-0.5 * x * x) for x in edges[1:])]
    inner = [int(TAIL / edges[0] * _PLACES), 0, *(int(a / b * _PLACES) for a, b in itertools.pairwise(edges[1:]))]
    return "\n".join([
        _table("double", "normal_widths", [*map(repr, widths())]),
        _table("double", "normal_heights", [*map(repr, heights)]),
        _table("uint64_t", "normal_inner", [*map(str, inner)]),
        f"#define NORMAL_TAIL {TAIL!r}", f"#define NORMAL_TAIL_INVERSE {1.0 / TAIL!r}",
    ])  # fmt: skip


def _table(kind: str, name: str, values: Sequence[str]) -> str:
    return f"static const {kind} {name}[] = {{{', '.join(values)}}};"
