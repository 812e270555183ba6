"""The work of writing a slave out as C grows with its operations, not with the ways through their graph."""

import itertools
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from fmu_kit.bundle import Target
from fmu_kit.compiler.emit.standards import STANDARDS
from fmu_kit.compiler.pack.building import c_sources, modules_of
from fmu_kit.compiler.passes.precomputing import precompute
from fmu_kit.compiler.trace.tracing import trace
from fmu_kit.packaging import slave_class

LAWS = {
    "a series of a matrix that a parameter fixes": """
        a = [[0.0, 1.0], [-2.0, -self.p]]
        term = sums = [[1.0, 0.0], [0.0, 1.0]]
        for n in range(1, 40):
            term = [[sum(a[i][k] * term[k][j] for k in range(2)) / n for j in range(2)] for i in range(2)]
            sums = [[sums[i][j] + term[i][j] for j in range(2)] for i in range(2)]
        self.y = sums[0][0] * self.u + sums[0][1]
""",
    "guards that are used in several others": """
        far = self.u > 100.0
        for n in range(40):
            far = (far | (self.u > 101.0 + n)) | (far | (self.u < -101.0 - n))
        if far:
            raise ValueError("far")
        self.y = self.u
""",
}
SLAVE = '''
from fmu_kit.interface import Input, Output, Parameter
from fmu_kit.slave import Slave


class Law(Slave):
    """A law."""

    u = Input("A number.", None)
    y = Output("A number.", None)
    p = Parameter("A number.", None, 1.0)

    def step(self, t, h):
'''
MOST_CALLS = 1_000_000
"""Calls of Python's functions: each of the laws needs a quarter of them, and without sharing some 10¹²"""


@pytest.mark.parametrize("law", LAWS)
def test_a_law_whose_values_are_used_several_times_is_written_out(
    law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (name,) = (f"law_{number}" for number, each in enumerate(LAWS) if each == law)
    (tmp_path / f"{name}.py").write_text(SLAVE + LAWS[law])
    monkeypatch.syspath_prepend(tmp_path)
    target = Target.parse(f"{name}:Law", tmp_path)
    program = trace(slave_class(target), modules_of(target))
    calls = itertools.count()

    def count(frame: FrameType, event: str, given: Any) -> None:
        if event == "call":
            assert next(calls) < MOST_CALLS, f"more calls than expected, at last of {frame.f_code.co_name}"

    sys.setprofile(count)
    try:
        c_sources(precompute(program), "", STANDARDS[2])
    finally:
        sys.setprofile(None)
